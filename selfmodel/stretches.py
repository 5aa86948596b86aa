"""The stretches of a trial that calibration predicts, and what was observed in them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.behaviour import Behaviour, Signal
from selfmodel.comparator import Past, Segments
from selfmodel.errors import InputError
from selfmodel.estimate import ONBOARD, STATE, estimated_states
from selfmodel.robot import LONGEST_DELAY
from selfmodel.trial import Trial

SEGMENTS, HORIZON, LEAD = 40, 10, LONGEST_DELAY
"""Stretches of a trial in which the base was seen, the length of one, and the commands from before
it that a delay may need."""


@dataclass(frozen=True, eq=False)
class Stretches:
    """A trial cut into stretches.

    Attributes:
        segments: Where they begin and what was commanded.
        observed: What of the state was logged after each of their steps,
            ``(segments, horizon, width)``.
    """

    segments: Segments
    observed: Mapping[Signal, FloatArray]


def cut(trial: Trial) -> Stretches:
    """Returns stretches in which the commands and the state are known all along.

    They are spread over the trial. Where the log has no such stretch with the base's position and
    linear velocity, these are left out, and the stretches lie one after another from the start of
    the trial on, for each goes on from where the one before it left the base.

    Raises:
        InputError: There is none without them either.
    """
    behaviour = trial.behaviour
    last = behaviour.steps - 1 - HORIZON
    if last < LEAD:
        raise _useless(trial, f"the trial has {behaviour.steps}")
    spread = np.unique(np.linspace(LEAD, last, SEGMENTS).round().astype(np.intp))
    chained = np.arange(0, last + 1, HORIZON)
    for signals, begins in ((STATE, spread), (ONBOARD, chained)):
        states = estimated_states(behaviour, signals)
        known = {signal: _rows_known(values) for signal, values in states.items()}
        known["commands"] = _rows_known(behaviour.steady_commands)
        starts = _usable(begins, known.values())
        if len(starts):
            return _stretches(behaviour, states, starts)
    lacking = [signal for signal in known if not len(_usable(begins, [known[signal]]))]
    if lacking:
        raise _useless(trial, f"the log never has {', '.join(lacking)} for so long")
    raise _useless(trial, "the log has no such stretch with all of them")


def _rows_known(values: FloatArray) -> BoolArray:
    return np.asarray(np.isfinite(values).all(axis=1))


def _usable(begins: IndexArray, known: Iterable[BoolArray]) -> IndexArray:
    """Where stretches can begin in which all of this is known."""
    whole = np.logical_and.reduce(list(known))
    usable = [whole[max(k - LEAD, 0) : k + HORIZON + 1].all() for k in begins.tolist()]
    return begins[usable]


def _stretches(
    behaviour: Behaviour, states: Mapping[Signal, FloatArray], starts: IndexArray
) -> Stretches:
    commands = behaviour.steady_commands
    before = np.concatenate([np.zeros((LEAD, commands.shape[1])), commands])
    after = starts[:, np.newaxis] + np.arange(1, HORIZON + 1)
    return Stretches(
        Segments(
            states={signal: values[starts] for signal, values in states.items()},
            commands=before[starts[:, np.newaxis] + np.arange(LEAD + HORIZON)],
            lead=LEAD,
            record=tuple(states),
            past=Past(commands, starts),
        ),
        {signal: values[after] for signal, values in states.items()},
    )


def _useless(trial: Trial, has: str) -> InputError:
    """Says of a trial in which no stretch can begin what it has instead."""
    return InputError(
        f"{trial.path}: calibration needs stretches of {LEAD + HORIZON + 1} steps or more with "
        f"{', '.join(ONBOARD)} and the commands, and {has}: leave this log out"
    )
