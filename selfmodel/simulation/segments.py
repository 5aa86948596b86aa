"""Segments of a trial of the healthy robot, with the observed states they are compared with.

A robot that walks is predicted over a tenth of a second: contacts make longer simulations chaotic.
The joints of a fixed base are simulated for about a second without losing the trial: position
servos hold them to the commands, and in a second the commands move the joints there and back, which
shows gains, friction and inertia.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.errors import InputError
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import with_known_base
from selfmodel.simulation.requests import LEAD, Segments, command_steps, cut_segments
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.estimation import (
    JOINTS,
    ONBOARD,
    STATE,
    estimated_states,
    known_steps,
    lacks_joint_velocities,
    with_joint_velocities,
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

SEGMENT_SECONDS = 1.0
"""Length of a segment of a robot with a fixed base, s, in a trial that is long enough."""

MIN_SEGMENTS = 12
"""Smallest number of segments of a fixed base: a short trial has shorter segments."""

MIN_HORIZON = 5
"""Smallest length of a segment of a fixed base, control steps."""


@dataclass(frozen=True, eq=False)
class ObservedSegments:
    """Segments of a trial, and what was observed in them.

    Attributes:
        segments: Initial states and commands.
        observed: Estimated state after each step, ``(segments, horizon, width)`` for each signal
            that is compared.
        valid: Mask of the steps whose prediction has an error, ``(segments, horizon)``: the state
            after the step is known, and so are the commands that led there. Single hinges may be
            unknown; see ``compared``.
        steps: Number of different steps of the trial in all segments, which may overlap.
    """

    segments: Segments
    observed: Mapping[Signal, FloatArray]
    valid: BoolArray
    steps: int

    def compared(self, signal: Signal) -> BoolArray:
        """Returns a mask of the errors of one signal, ``(segments, horizon, columns)``.

        Errors of an orientation have three columns: all of them are known, or none.
        """
        values = self.observed[signal]
        known = np.isfinite(values) if signal in JOINTS else np.ones((*values.shape[:2], 3), bool)
        return np.asarray(known & self.valid[..., np.newaxis])


def observed_segments(robot: Robot, trial: Trial) -> ObservedSegments:
    """Returns segments of a trial in which the state and the commands are known.

    The segments are spread over the trial and known completely. If the base's position and linear
    velocity are known in less than a quarter of the segments in which all other signals are, both
    are left out, and segments follow each other from the start of the trial, in the model's initial
    pose: each begins with the base in the predicted state at the end of the segment before. Of a
    trial in which a hinge is unknown most of the time, the other hinges are used in the same way.

    With a fixed base, segments of up to a second follow each other, and joint positions are
    compared, and joint velocities if they were measured.

    Args:
        robot: The robot of the trial.
        trial: A trial of the healthy robot.

    Raises:
        InputError: Too few states and commands are known for any segments, or a value is infinite
            or absurdly large.
    """
    behaviour = with_known_base(robot, trial.behaviour)
    if robot.has_fixed_base:
        found = _consecutive(trial, behaviour)
    else:
        if behaviour.steps <= LEAD + HORIZON:
            raise _unusable(trial, f"the trial has {behaviour.steps}")
        some = _spread(behaviour) or _sequential(behaviour)
        if some is None:
            never = _never_known(behaviour)
            raise _unusable(
                trial, f"the log never has {never}" if never else "the log has no such segment"
            )
        found = some
    check_magnitudes(trial, (*found.observed, "commands"))
    return found


def _spread(behaviour: Behaviour) -> ObservedSegments | None:
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
    return _cut(behaviour, states, begins[whole], HORIZON, STATE)


def _sequential(behaviour: Behaviour) -> ObservedSegments | None:
    """Returns consecutive segments of the onboard state; None if too few steps are valid.

    Every segment with a known initial state and known commands is simulated, because later segments
    continue from its end. A step is valid if its state was observed and no command before it, in
    the segment or in its lead, was held for other than a control time step.
    """
    begins = np.arange(0, behaviour.steps - HORIZON, HORIZON)
    states = estimated_states(behaviour, ONBOARD)
    commanded = np.asarray(np.isfinite(behaviour["commands"]).all(axis=1))
    starts = begins[_known(states)[begins] & _all_known(commanded, begins)]
    segments = _cut(behaviour, states, starts, HORIZON, ONBOARD)
    return segments if segments.valid.sum() >= HORIZON else None


def _consecutive(trial: Trial, measured: Behaviour) -> ObservedSegments:
    """Returns segments of the joints of a fixed base that begin in a known state.

    Joint velocities that were not measured are estimated, as the initial velocity of a segment.
    """
    behaviour, steps = with_joint_velocities(measured), measured.steps
    compared = JOINTS[:1] if lacks_joint_velocities(measured) else JOINTS
    timestep = float(behaviour.time[1] - behaviour.time[0]) if steps > 1 else 1.0
    horizon = min(round(SEGMENT_SECONDS / timestep), (steps - 1 - LEAD) // MIN_SEGMENTS)
    if horizon < MIN_HORIZON:
        raise _unusable(trial, f"the trial has {steps} steps", fixed=True)
    states = estimated_states(behaviour, STATE)
    starts = np.arange(LEAD, steps - horizon, horizon)
    commanded = np.asarray(np.isfinite(behaviour["commands"]).all(axis=1))
    usable = _known(states)[starts] & commanded[command_steps(starts, horizon)].all(axis=1)
    starts = starts[usable]
    starts = starts[_cut(behaviour, states, starts, horizon, compared).valid.any(axis=1)]
    if len(starts) < MIN_SEGMENTS // 2:
        raise _unusable(trial, f"the log has {len(starts)} such segments", fixed=True)
    return _cut(behaviour, states, starts, horizon, compared)


def _cut(
    behaviour: Behaviour,
    states: Mapping[Signal, FloatArray],
    starts: IndexArray,
    horizon: int,
    compared: tuple[Signal, ...],
) -> ObservedSegments:
    before = np.maximum(command_steps(starts, horizon), 0)
    after = starts[:, np.newaxis] + np.arange(1, horizon + 1)
    steady = np.logical_and.accumulate(_steady(behaviour)[before], axis=1)
    observed = {signal: states[signal] for signal in compared}
    return ObservedSegments(
        segments=cut_segments(behaviour, states, starts, horizon, record=compared),
        observed={signal: values[after] for signal, values in observed.items()},
        valid=steady[:, LEAD:] & _known(observed)[after],
        steps=len(np.unique(after)),
    )


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


def _unusable(trial: Trial, reason: str, *, fixed: bool = False) -> InputError:
    needs = (
        f"calibration of a robot with a fixed base needs {MIN_SEGMENTS} segments of {MIN_HORIZON} "
        f"steps or more with joint positions and commands"
        if fixed
        else f"calibration needs segments of {LEAD + HORIZON + 1} steps or more, without late "
        f"steps, with {', '.join(ONBOARD)} and the commands"
    )
    return InputError(f"{trial.path}: {needs}, and {reason}: leave this log out")
