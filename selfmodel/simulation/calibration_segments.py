"""The stretches of a trial that calibration predicts, and what was observed in them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.errors import InputError
from selfmodel.robot.custom_numerics import MAX_CONTROL_DELAY
from selfmodel.simulation.requests import Past, Segments
from selfmodel.trials.behaviour import Behaviour, Signal
from selfmodel.trials.state_estimation import ONBOARD, STATE, estimated_states
from selfmodel.trials.trial import Trial

SEGMENTS, HORIZON, LEAD = 40, 10, MAX_CONTROL_DELAY
"""Stretches of a trial in which the base was seen, the length of one, and the commands from before
it that a delay may need."""

SEEN = 0.25
"""In how many of those with all of the rest the base must have been seen to be looked at."""


@dataclass(frozen=True, eq=False)
class CalibrationSegments:
    """A trial cut into stretches.

    Attributes:
        segments: Where they begin and what was commanded.
        observed: The state after each of their steps, as well as the log tells it,
            ``(segments, horizon, width)``.
        judged: Whether a prediction of it can be judged, ``(segments, horizon)``: it is known, and
            so is what led there.
    """

    segments: Segments
    observed: Mapping[Signal, FloatArray]
    judged: BoolArray


def cut_segments(trial: Trial) -> CalibrationSegments:
    """Returns stretches of a trial in which the state and the commands are known.

    They are spread over the trial, and all of each is known. Where the base's position and linear
    velocity are known in less than a quarter of those in which all the rest is, these are left out,
    and stretches follow each other from the start of the trial, in the model's start pose, on: each
    goes on from where the one before it left the base.

    Raises:
        InputError: There is too little to judge without them either.
    """
    if trial.behaviour.steps <= LEAD + HORIZON:
        raise _useless(trial, f"the trial has {trial.behaviour.steps}")
    found = _spread(trial.behaviour) or _sequential(trial.behaviour)
    if found is None:
        never = _never_known(trial.behaviour)
        raise _useless(trial, f"the log never has {never}" if never else "the log has none of use")
    return found


def _spread(behaviour: Behaviour) -> CalibrationSegments | None:
    """Stretches of the whole state, each by itself; None where there are too few."""
    last = behaviour.steps - 1 - HORIZON
    begins = np.unique(np.linspace(LEAD, last, SEGMENTS).round().astype(np.intp))
    states = estimated_states(behaviour, STATE)
    on_board = _known({signal: states[signal] for signal in ONBOARD}) & _steady(behaviour)
    whole = _all_known(on_board & _known(states), begins)
    if not whole.any() or whole.sum() < SEEN * _all_known(on_board, begins).sum():
        return None
    return _calibration_segments(behaviour, states, begins[whole])


def _sequential(behaviour: Behaviour) -> CalibrationSegments | None:
    """Stretches of what is on board, one after another; None where too little can be judged.

    What can be simulated is, for the sake of what goes on from it: all that begins in a known state
    under known commands. It is judged until a command stands for other than a time step, if none
    did just before, and where it was observed.
    """
    begins = np.arange(0, behaviour.steps - HORIZON, HORIZON)
    states = estimated_states(behaviour, ONBOARD)
    commanded = np.asarray(np.isfinite(behaviour["commands"]).all(axis=1))
    starts = begins[_known(states)[begins] & _all_known(commanded, begins)]
    found = _calibration_segments(behaviour, states, starts)
    return found if found.judged.sum() >= HORIZON else None


def _known(signals: Mapping[Signal, FloatArray]) -> BoolArray:
    """At which steps all of them are known, ``(steps,)``."""
    return np.asarray(np.isfinite(np.hstack(list(signals.values()))).all(axis=1))


def _steady(behaviour: Behaviour) -> BoolArray:
    """Whether each command is known to have stood for a control time step, ``(steps,)``."""
    return np.asarray(np.isfinite(behaviour.steady_commands).all(axis=1))


def _all_known(known: BoolArray, begins: IndexArray) -> BoolArray:
    """Whether all of a stretch is known, and the commands from before it."""
    return np.array([known[max(k - LEAD, 0) : k + HORIZON + 1].all() for k in begins.tolist()])


def _calibration_segments(
    behaviour: Behaviour, states: Mapping[Signal, FloatArray], starts: IndexArray
) -> CalibrationSegments:
    commands = behaviour["commands"]
    padded = np.concatenate([np.zeros((LEAD, commands.shape[1])), commands])
    before = starts[:, np.newaxis] + np.arange(-LEAD, HORIZON)
    after = starts[:, np.newaxis] + np.arange(1, HORIZON + 1)
    steady = np.logical_and.accumulate(_steady(behaviour)[np.maximum(before, 0)], axis=1)
    return CalibrationSegments(
        Segments(
            states={signal: values[starts] for signal, values in states.items()},
            commands=padded[before + LEAD],
            lead=LEAD,
            record=tuple(states),
            past=Past(commands, starts),
        ),
        observed={signal: values[after] for signal, values in states.items()},
        judged=steady[:, LEAD:] & _known(states)[after],
    )


def _never_known(behaviour: Behaviour) -> str:
    """What of that which is needed was never observed, by its columns where only some were not."""
    found = []
    signals: tuple[Signal, ...] = (*ONBOARD, "commands")
    for signal in signals:
        names = np.array(behaviour.names.columns(signal))
        lacking = ~np.isfinite(behaviour[signal]).any(axis=0)
        if lacking.any():
            some = "" if lacking.all() else f" of {', '.join(names[lacking])}"
            found.append(signal + some)
    return ", ".join(found)


def _useless(trial: Trial, has: str) -> InputError:
    """Says of a trial in which nothing can be predicted what it has instead."""
    return InputError(
        f"{trial.path}: calibration needs stretches of {LEAD + HORIZON + 1} steps or more, none of "
        f"them late, with {', '.join(ONBOARD)} and the commands, and {has}: leave this log out"
    )
