"""Checks of a score from a plug-in: the signals that it names, and the values that it returns."""

import dataclasses
from functools import partial

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.scores.fitness import Score
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.signals import SIGNALS

LARGEST = 1e10
"""Magnitude above which MuJoCo takes a simulation as diverged."""


def checked(score: Score, name: str) -> Score:
    """Returns a score whose signals and values are checked.

    Args:
        score: Score from a plug-in.
        name: Name of the plug-in, for the messages.

    Raises:
        InputError: ``record`` is no tuple of known signals. A call of the new score raises it if
            the function reads another signal, or returns other than one number per run.
    """
    record = score.record
    if not isinstance(record, tuple) or not record or any(one not in SIGNALS for one in record):
        raise InputError(
            f"the score {name!r} has record={record!r}: expected a tuple of one or more of "
            f"{', '.join(SIGNALS)}; correct `record` of the score"
        )
    return dataclasses.replace(score, of=partial(_checked, score, name))


def _checked(
    score: Score, name: str, robot: Robot, hypothesis: Hypothesis, behaviour: Behaviour
) -> FloatArray:
    runs = len(behaviour[score.record[0]])
    expected = f"the score {name!r}: expected one number for each of {runs} runs"
    try:
        found: object = score.of(robot, hypothesis, behaviour)
    except KeyError as error:
        if "was not recorded" not in str(error):
            raise
        raise InputError(
            f"the score {name!r} reads a signal that it does not name: {error.args[0]}; add the "
            f"signal to `record` of the score"
        ) from error
    try:
        values = np.asarray(found, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{expected}, got {type(found).__name__} ({error}); return an array of numbers from "
            f"`of` of the score"
        ) from error
    if values.shape != (runs,):
        raise InputError(
            f"{expected}, an array of shape ({runs},), got shape {values.shape}; `of` of the score "
            f"gets signals of shape (runs, steps, width): sum over the steps, not over the runs"
        )
    wrong = np.isnan(values) | np.isposinf(values)
    if wrong.any() and (wrong := wrong & _known(score, behaviour)).any():
        raise InputError(
            f"{expected}, got {values[wrong][0]:g} for {wrong.sum()} of them, whose signals are "
            f"all finite; return a number, the lowest for the worst run, from `of` of the score"
        )
    return values


def _known(score: Score, behaviour: Behaviour) -> BoolArray:
    """Returns the runs that were observed whole and did not diverge, ``(n,)``."""
    signals = [np.abs(behaviour[signal]) <= LARGEST for signal in score.record]
    return np.asarray(np.all([values.all(axis=(1, 2)) for values in signals], axis=0))
