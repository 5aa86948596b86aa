"""The stretches of a trial that calibration predicts, and what was observed in them."""

from collections.abc import Mapping
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

SEEN = 0.25
"""Of how many of these the base must have been seen for it to be looked at."""


@dataclass(frozen=True, eq=False)
class Stretches:
    """A trial cut into stretches.

    Attributes:
        segments: Where they begin and what was commanded.
        observed: What of the state was logged after each of their steps,
            ``(segments, horizon, width)``; NaN where that cannot be judged.
    """

    segments: Segments
    observed: Mapping[Signal, FloatArray]


def cut(trial: Trial) -> Stretches:
    """Returns stretches of a trial in which the state and the commands are known.

    They are spread over the trial, and all of each is known. Where the base's position and linear
    velocity are known in less than a quarter of them, these are left out, and stretches follow each
    other from the start of the trial, in the model's start pose, on: each goes on from where the
    one before it left the base.

    Raises:
        InputError: There is nothing to judge without them either.
    """
    if trial.behaviour.steps <= LEAD + HORIZON:
        raise _useless(trial, f"the trial has {trial.behaviour.steps}")
    found = _spread(trial.behaviour) or _chained(trial.behaviour)
    if found is None:
        signals = {signal: trial.behaviour[signal] for signal in (*ONBOARD, "commands")}
        never = [signal for signal, values in signals.items() if not _rows_known(values).any()]
        has = f"the log never has {', '.join(never)}" if never else "the log has no such stretch"
        raise _useless(trial, has)
    return found


def _spread(behaviour: Behaviour) -> Stretches | None:
    """Stretches of the whole state, each by itself; None where there are too few."""
    last = behaviour.steps - 1 - HORIZON
    begins = np.unique(np.linspace(LEAD, last, SEGMENTS).round().astype(np.intp))
    states = estimated_states(behaviour, STATE)
    whole = _rows_known(np.hstack([*states.values(), behaviour.steady_commands]))
    starts = begins[_all_known(whole, begins)]
    if len(starts) < SEEN * len(begins):
        return None
    rows = starts[:, np.newaxis] + np.arange(1, HORIZON + 1)
    observed = {signal: values[rows] for signal, values in states.items()}
    return Stretches(_segments(behaviour, states, starts), observed)


def _chained(behaviour: Behaviour) -> Stretches | None:
    """Stretches of what is on board, one after another; None where nothing can be judged.

    One that can be simulated is kept for the sake of those after it. It is judged up to its first
    step that was late, at those steps that were observed.
    """
    begins = np.arange(0, behaviour.steps - HORIZON, HORIZON)
    states = estimated_states(behaviour, ONBOARD)
    beginning = _rows_known(np.hstack(list(states.values())))[begins]
    commanded = _all_known(_rows_known(behaviour["commands"]), begins)
    starts = begins[beginning & commanded]
    steady = _rows_known(behaviour.steady_commands)
    before = np.maximum(starts[:, np.newaxis] + np.arange(-LEAD, HORIZON), 0)
    so_far = np.logical_and.accumulate(steady[before], axis=1)[:, LEAD:, np.newaxis]
    rows = starts[:, np.newaxis] + np.arange(1, HORIZON + 1)
    observed = {signal: np.where(so_far, values[rows], np.nan) for signal, values in states.items()}
    if not any(np.isfinite(values).any() for values in observed.values()):
        return None
    return Stretches(_segments(behaviour, states, starts), observed)


def _rows_known(values: FloatArray) -> BoolArray:
    return np.asarray(np.isfinite(values).all(axis=1))


def _all_known(known: BoolArray, begins: IndexArray) -> BoolArray:
    """Whether all of a stretch is known, and the commands from before it."""
    return np.array([known[max(k - LEAD, 0) : k + HORIZON + 1].all() for k in begins.tolist()])


def _segments(
    behaviour: Behaviour, states: Mapping[Signal, FloatArray], starts: IndexArray
) -> Segments:
    commands = behaviour["commands"]
    padded = np.concatenate([np.zeros((LEAD, commands.shape[1])), commands])
    return Segments(
        states={signal: values[starts] for signal, values in states.items()},
        commands=padded[starts[:, np.newaxis] + np.arange(LEAD + HORIZON)],
        lead=LEAD,
        record=tuple(states),
        past=Past(commands, starts),
    )


def _useless(trial: Trial, has: str) -> InputError:
    """Says of a trial in which nothing can be predicted what it has instead."""
    return InputError(
        f"{trial.path}: calibration needs stretches of {LEAD + HORIZON + 1} steps or more, none of "
        f"them late, with {', '.join(ONBOARD)} and the commands, and {has}: leave this log out"
    )
