"""Segments of a trial for calibration, with the observed states that they are compared with."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.errors import InputError
from selfmodel.simulation.requests import LEAD, Segments, command_steps, cut_segments
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.estimation import (
    JOINTS,
    ONBOARD,
    STATE,
    estimated_states,
    known_steps,
)
from selfmodel.trials.signals import Signal
from selfmodel.trials.trial import Trial, check_magnitudes

MAX_SEGMENTS = 40
"""Largest number of segments of a trial in which the base was observed."""

HORIZON = 10
"""Length of a segment, control steps."""

MIN_BASE_SHARE = 0.25
"""Smallest share of usable segments with an observed base at which the base is used."""

MIN_COMPLETE_SHARE = 0.25
"""Smallest share of the known steps at which every hinge is known, for other steps to be left out.
"""


@dataclass(frozen=True, eq=False)
class CalibrationSegments:
    """A trial cut into segments for calibration.

    Attributes:
        segments: Initial states and commands.
        observed: Estimated state after each step, ``(segments, horizon, width)`` for each signal.
        judged: Mask of the steps whose prediction has an error, ``(segments, horizon)``: the state
            after the step is known, and so are the commands that led there. Single hinges may be
            unknown; see ``compared``.
        steps: Number of different steps of the trial in all segments, which may overlap.
    """

    segments: Segments
    observed: Mapping[Signal, FloatArray]
    judged: BoolArray
    steps: int

    def compared(self, signal: Signal) -> BoolArray:
        """Returns a mask of the errors of one signal, ``(segments, horizon, columns)``.

        Errors of an orientation have three columns: all of them are known, or none.
        """
        values = self.observed[signal]
        known = np.isfinite(values) if signal in JOINTS else np.ones((*values.shape[:2], 3), bool)
        return np.asarray(known & self.judged[..., np.newaxis])


def calibration_segments_of(trial: Trial) -> CalibrationSegments:
    """Returns segments of a trial in which the state and the commands are known.

    The segments are spread over the trial and known completely. If the base's position and linear
    velocity are known in less than a quarter of the segments in which all other signals are, both
    are left out, and segments follow each other from the start of the trial, in the model's initial
    pose: each begins with the base in the predicted state at the end of the segment before. Of a
    trial in which a hinge is unknown most of the time, the other hinges are used in the same way.

    Raises:
        InputError: Too few states and commands are known for any segments, or a value is infinite
            or absurdly large.
    """
    if trial.behaviour.steps <= LEAD + HORIZON:
        raise _unusable(trial, f"the trial has {trial.behaviour.steps}")
    segments = _spread(trial.behaviour) or _sequential(trial.behaviour)
    if segments is None:
        never = _never_known(trial.behaviour)
        raise _unusable(
            trial, f"the log never has {never}" if never else "the log has no such segment"
        )
    check_magnitudes(trial, (*segments.observed, "commands"))
    return segments


def _spread(behaviour: Behaviour) -> CalibrationSegments | None:
    """Returns segments of the whole state; None if there are too few.

    They are independent and spread over the trial. With unknown hinges, which continue from the
    segment before, they follow each other.
    """
    last = behaviour.steps - 1 - HORIZON
    begins = np.unique(np.linspace(LEAD, last, MAX_SEGMENTS).round().astype(np.intp))
    states = estimated_states(behaviour, STATE)
    onboard = _known({signal: states[signal] for signal in ONBOARD}) & _steady(behaviour)
    known = onboard & _known(states)
    whole = _all_known(known, begins)
    if not whole.any() or whole.sum() < MIN_BASE_SHARE * _all_known(onboard, begins).sum():
        return None
    if any(np.isnan(states[signal][known]).any() for signal in JOINTS):
        begins = np.arange(LEAD, last + 1, HORIZON)
        whole = _all_known(known, begins)
        if not whole.any():
            return None
    return _with_observed(behaviour, states, begins[whole])


def _sequential(behaviour: Behaviour) -> CalibrationSegments | None:
    """Returns consecutive segments of the onboard state; None if too few steps can be judged.

    Every segment with a known initial state and known commands is simulated, because later segments
    continue from its end. A step is judged if its state was observed and no command before it, in
    the segment or in its lead, was held for other than a control time step.
    """
    begins = np.arange(0, behaviour.steps - HORIZON, HORIZON)
    states = estimated_states(behaviour, ONBOARD)
    commanded = np.asarray(np.isfinite(behaviour["commands"]).all(axis=1))
    starts = begins[_known(states)[begins] & _all_known(commanded, begins)]
    segments = _with_observed(behaviour, states, starts)
    return segments if segments.judged.sum() >= HORIZON else None


def _known(states: Mapping[Signal, FloatArray]) -> BoolArray:
    """Returns a mask of the steps at which a state is known, ``(steps,)``.

    It is known completely there; if that is rare, single hinges may be unknown.
    """
    complete = np.isfinite(np.hstack(list(states.values()))).all(axis=1)
    some = known_steps(states)
    return np.asarray(complete if complete.sum() >= MIN_COMPLETE_SHARE * some.sum() else some)


def _steady(behaviour: Behaviour) -> BoolArray:
    """Returns a mask of the known commands held for one control time step, ``(steps,)``."""
    return np.asarray(np.isfinite(behaviour.steady_commands).all(axis=1))


def _all_known(known: BoolArray, begins: IndexArray) -> BoolArray:
    """Returns a mask of the segments that are known with their lead, ``(segments,)``."""
    return np.array([known[max(k - LEAD, 0) : k + HORIZON + 1].all() for k in begins.tolist()])


def _with_observed(
    behaviour: Behaviour, states: Mapping[Signal, FloatArray], starts: IndexArray
) -> CalibrationSegments:
    before = np.maximum(command_steps(starts, HORIZON), 0)
    after = starts[:, np.newaxis] + np.arange(1, HORIZON + 1)
    steady = np.logical_and.accumulate(_steady(behaviour)[before], axis=1)
    return CalibrationSegments(
        segments=cut_segments(behaviour, states, starts, HORIZON, record=tuple(states)),
        observed={signal: values[after] for signal, values in states.items()},
        judged=steady[:, LEAD:] & _known(states)[after],
        steps=len(np.unique(after)),
    )


def _never_known(behaviour: Behaviour) -> str:
    """Returns the required signals that were never observed, with columns if only some are.

    Of the joints, one hinge is enough.
    """
    never = []
    signals: tuple[Signal, ...] = (*ONBOARD, "commands")
    for signal in signals:
        names = np.array(behaviour.names.columns(signal))
        lacking = ~np.isfinite(behaviour[signal]).any(axis=0)
        if lacking.all() or (lacking.any() and signal not in JOINTS):
            some = "" if lacking.all() else f" of {', '.join(names[lacking])}"
            never.append(signal + some)
    return ", ".join(never)


def _unusable(trial: Trial, reason: str) -> InputError:
    return InputError(
        f"{trial.path}: calibration needs segments of {LEAD + HORIZON + 1} steps or more, without "
        f"late steps, with {', '.join(ONBOARD)} and the commands, and {reason}: leave this log out"
    )
