"""Errors of short predictions with models of one robot, and the losses that compare them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby, takewhile

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.faults.build import apply_faults
from selfmodel.faults.hypothesis import INTACT
from selfmodel.robot.robot import Robot
from selfmodel.simulation.batch import SimulationStats, largest_batch
from selfmodel.simulation.model_factors import Parameters, model_with_parameters
from selfmodel.simulation.prediction import predict
from selfmodel.simulation.requests import Segments
from selfmodel.simulation.segments import ObservedSegments
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.estimation import BASE, JOINTS
from selfmodel.trials.signals import CALIBRATION_ERROR_SCALES, Signal, difference

MAX_ERROR = 1e6
"""Bound on the absolute error of a prediction, in ``CALIBRATION_ERROR_SCALES``: the error of a
simulation that is no longer finite. The solver does not end on numbers that are not finite."""

_JOINTS: Signal = "joint_positions"


def is_better(one: FloatArray, other: FloatArray, min_z: float) -> bool:
    """Returns whether the losses of segments are significantly lower, paired over the segments.

    Args:
        one: Losses of the segments, ``(segments,)``.
        other: Losses of the same segments, to be undercut.
        min_z: Smallest mean difference, in standard errors.
    """
    gains = other - one
    error = float(gains.std(ddof=1)) / np.sqrt(len(gains)) if len(gains) > 1 else np.inf
    return bool(gains.mean() > min_z * error and gains.mean() > 0)


def root_mean_square(errors: FloatArray) -> float:
    """Returns the root mean square of errors."""
    return float(np.sqrt(np.mean(errors**2)))


def pseudo_huber(errors: FloatArray) -> FloatArray:
    """Returns pseudo-Huber residuals: their squares grow linearly with errors above 1."""
    return np.asarray(np.sign(errors) * np.sqrt(2 * (np.sqrt(1 + errors**2) - 1)))


@dataclass(frozen=True, eq=False)
class SegmentErrors:
    """Errors of predictions of segments with models of a robot.

    Attributes:
        robot: The robot as its model describes it.
        data: Segments of at least one trial of the healthy robot.
        threads: Threads of MuJoCo's steps.
    """

    robot: Robot
    data: Sequence[ObservedSegments]
    threads: int

    @cached_property
    def segment_of_error(self) -> IndexArray:
        """Number of the segment of each error, over all trials, ``(errors,)``."""
        first, numbers = 0, []
        for own in self.data:
            numbers += [
                first + np.nonzero(own.compared(signal))[0] for signal in _compared_signals(own)
            ]
            first += len(own.valid)
        return np.concatenate(numbers)

    @property
    def segments(self) -> int:
        """Number of segments of all trials."""
        return sum(len(own.valid) for own in self.data)

    @property
    def overlap(self) -> float:
        """Number of segments that contain a step, on average over the steps; at least 1."""
        return sum(own.valid.size for own in self.data) / sum(own.steps for own in self.data)

    def folds(self, count: int) -> IndexArray:
        """Returns the part of each segment, ``(segments,)``: each trial cut in time."""
        parts = [np.arange(len(own.valid)) * count // len(own.valid) for own in self.data]
        return np.concatenate(parts)

    def losses(self, errors: FloatArray) -> FloatArray:
        """Returns the mean loss of each segment, ``(segments,)``, from errors, ``(errors,)``.

        A segment without a valid step has a loss of 0.
        """
        number = self.segment_of_error
        sums = np.bincount(number, pseudo_huber(errors) ** 2, self.segments)
        return np.asarray(sums / np.maximum(np.bincount(number, minlength=self.segments), 1))

    def joint_errors(self, errors: FloatArray) -> FloatArray:
        """Returns the errors of joint positions, ``(valid steps, hinges)``, rad.

        The error of an unknown hinge is 0.

        Args:
            errors: All errors of one model, ``(errors,)``.
        """
        first, found = 0, []
        for own in self.data:
            counts = {signal: int(own.compared(signal).sum()) for signal in _compared_signals(own)}
            begin = first + sum(counts[signal] for signal in takewhile(_JOINTS.__ne__, counts))
            known = own.compared(_JOINTS)[own.valid]
            rows = np.zeros(known.shape)
            rows[known] = errors[begin : begin + counts[_JOINTS]]
            found.append(rows)
            first += sum(counts.values())
        return np.concatenate(found) * CALIBRATION_ERROR_SCALES[_JOINTS]

    def of(self, models: Sequence[Parameters], stats: SimulationStats | None = None) -> FloatArray:
        """Returns prediction errors divided by their scales, ``(errors, models)``, all finite.

        The models are predicted in batches, so that their memory is bounded.

        Args:
            models: At least one model; adjacent ones with one control delay share batches.
            stats: Statistics that are updated.
        """
        stats = SimulationStats() if stats is None else stats
        size = min(largest_batch(self.robot, own.segments, steps=0) for own in self.data)
        batches = [
            same[first : first + size]
            for same in (list(group) for _, group in groupby(models, lambda own: own.delay))
            for first in range(0, len(same), size)
        ]
        return np.concatenate([self._of_batch(batch, stats) for batch in batches], axis=1)

    def with_estimated_states(self, parameters: Parameters) -> "SegmentErrors":
        """Returns the errors of independent segments.

        An unknown state begins as the parameters predict it.
        """
        predict_with = self._predictor([parameters], SimulationStats())

        def independent(own: ObservedSegments) -> ObservedSegments:
            segments = own.segments
            if segments.independent:
                return own
            predicted = predict_with(replace(segments, record=(*BASE, *JOINTS)))
            states = dict(segments.states)
            for signal in predicted.signals:
                begin = predicted[signal][0, :, 0]
                known = states.get(signal, np.full_like(begin, np.nan))
                states[signal] = np.where(np.isnan(known), begin, known)
            return replace(own, segments=replace(segments, states=states))

        return replace(self, data=[independent(own) for own in self.data])

    def _of_batch(self, models: Sequence[Parameters], stats: SimulationStats) -> FloatArray:
        predict_with = self._predictor(models, stats)
        rows = []
        for own in self.data:
            predicted = predict_with(own.segments)
            for signal in _compared_signals(own):
                with np.errstate(over="ignore", invalid="ignore"):  # bounded below
                    error = difference(signal, predicted[signal][:, :, 1:], own.observed[signal])
                    error = error / CALIBRATION_ERROR_SCALES[signal]
                rows.append(error[:, own.compared(signal)])
        errors = np.nan_to_num(np.concatenate(rows, axis=1).T, nan=MAX_ERROR)
        return np.clip(errors, -MAX_ERROR, MAX_ERROR)

    def _predictor(
        self, models: Sequence[Parameters], stats: SimulationStats
    ) -> Callable[[Segments], Behaviour]:
        """Returns a function that predicts segments with models of equal delay.

        The signals of its result are ``(models, segments, horizon + 1, width)``.
        """
        robot, delay = self.robot, models[0].delay
        embodiments = [
            apply_faults(model_with_parameters(robot, parameters), robot.anatomy, INTACT)
            for parameters in models
        ]

        def predict_with(segments: Segments) -> Behaviour:
            return predict(
                robot, embodiments, segments, threads=self.threads, stats=stats, delay=delay
            ).behaviour

        return predict_with


def _compared_signals(own: ObservedSegments) -> list[Signal]:
    return [signal for signal in CALIBRATION_ERROR_SCALES if signal in own.observed]
