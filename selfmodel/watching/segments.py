"""The newest segment of a stream of samples, and how wrong its prediction is.

The newest segment is the last one of a trial of the newest steps, which the comparator of segments
prepares as any trial: it smooths positions, and fits encoders that follow commands, over them.
"""

import dataclasses
from collections import deque
from typing import cast

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.comparators.segment_prediction import MIN_SEGMENTS, SegmentPrediction
from selfmodel.controllers.playback import Playback
from selfmodel.diagnosis.comparator import Losses, Prepared, TrialRefusedError, piece_steps_of
from selfmodel.diagnosis.losses import simulate
from selfmodel.faults.hypothesis import INTACT
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import completed_trial
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.estimation import known_rows
from selfmodel.trials.signals import Signal
from selfmodel.trials.trajectory import Sample, collect
from selfmodel.trials.trial import Trial, TrialPlan

WINDOW = 12
"""Segments of the window, at most: 1.4 s at 100 Hz, in which the noise of an encoder shows."""

_COMMANDS: Signal = "commands"
"""A signal whose loss needs the controller's state, which a window does not have: no score."""


class Window:
    """The newest steps of a stream; ``steps`` is the number of all so far."""

    def __init__(self, robot: Robot, horizon: int) -> None:
        self._robot, self._horizon, self.steps = robot, horizon, 0
        self._samples: deque[Sample] = deque(maxlen=WINDOW * horizon + 1)

    def add(self, sample: Sample) -> Trial | None:
        """Adds a step, and returns the trial of the newest steps if it completes a segment."""
        self._samples.append(sample)
        self.steps += 1
        whole, left = divmod(self.steps - 1, self._horizon)
        return None if left or whole < MIN_SEGMENTS else self.trial(len(self._samples))

    def trial(self, steps: int) -> Trial:
        """Returns the trial of the newest steps, as many as are asked for and kept."""
        rows = collect(self._robot.anatomy.names, list(self._samples)[-steps:])
        time = np.arange(rows.steps, dtype=np.float64) * self._robot.control_timestep
        motors = rows.names.motors
        # Its commands are those of the steps: a window may begin with one that was not observed.
        driver = Playback(motors, np.zeros((1, len(motors))))
        plan = TrialPlan("watched", "single", driver, rows.steps, seed=0)
        rows = dataclasses.replace(rows, time=time)
        return Trial(plan, self._robot.name, rows, f"steps {self.steps - rows.steps} on")


def last_segment(robot: Robot, comparator: SegmentPrediction, trial: Trial) -> Prepared:
    """Returns the last segment of a trial, prepared.

    Raises:
        TrialRefusedError: The segment lacks a signal, or has a late step.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        prepared = comparator.prepare(completed_trial(robot, trial))
    steps = piece_steps_of(prepared)
    if steps is None or steps[-1:, 1].tolist() != [trial.trajectory.steps - 1]:
        rows = {
            s: trial.trajectory[s][-1 - comparator.horizon :]
            for s in (*comparator.state, _COMMANDS)
        }
        lacking = [signal for signal, own in rows.items() if not known_rows(signal, own).all()]
        reason = f"{lacking[0]} was not observed" if lacking else "a step is late"
        raise TrialRefusedError(reason)
    return prepared


def scores_of(
    simulator: Simulator, comparator: SegmentPrediction, trial: Trial
) -> tuple[FloatArray, tuple[str, ...]]:
    """Returns how wrong the prediction of the last segment of a trial is, and the names of scores.

    The scores, ``(channels,)``, are at least 0: the loss of each hinge, the mean absolute error of
    each sensor, of contacts the odds of an error, and the loss of each signal; NaN for what was not
    observed, infinite if the simulation diverged.

    Raises:
        TrialRefusedError: The segment lacks a signal, or has a late step.
    """
    prepared = last_segment(simulator.robot, comparator, trial)
    result = simulate(simulator, prepared.request, trial, [INTACT])
    with np.errstate(all="ignore"):
        losses = cast("Losses", prepared.losses(result.trajectory))
    hinges = cast("FloatArray", losses.by_hinge)[0, -1]
    logged = trial.trajectory["sensors"][-comparator.horizon :]
    errors = np.abs(result.trajectory["sensors"][0, -1, 1:] - logged).mean(axis=0)
    touch = np.array([sensor.kind == "touch" for sensor in simulator.robot.anatomy.sensors])
    least = 0.5 / comparator.horizon  # an error of all steps is finite
    errors = np.where(touch, (errors + least) / (1.0 - errors + least), errors)
    by_signal = {name: loss for name, loss in losses.by_signal.items() if name != _COMMANDS}
    signals = [float(loss[0, -1]) for loss in by_signal.values()]
    names = trial.trajectory.names
    scores = np.where(result.diverged[0], np.inf, np.concatenate([hinges, errors, signals]))
    return scores, (*names.hinges, *names.sensors, *by_signal)
