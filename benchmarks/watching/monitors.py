"""Monitors of other methods: scores of the parts of a robot, larger as it changes.

A method is fitted to the first halves of the healthy trials of a watch. From a stream of samples it
makes a score of each part at each step, or at each segment, from that sample and earlier ones
alone. Its settings were chosen on the streams of the results, which flatters it.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from sklearn.ensemble import IsolationForest

from benchmarks.watching.streams import Machine, watch_of
from selfmodel import Trial
from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.comparators.segment_prediction import SEGMENT_PREDICTION
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trajectory import samples_of
from selfmodel.watching.segments import Window, scores_of

MAX_LAG = 30
"""Steps by which a joint may follow its command, at most."""

SMOOTHED = 100
"""Steps over which a tracking error is averaged: about a period of a gait."""

TOLERANCE, START, FORGETTING = 0.005, 30, 0.9999
"""Page-Hinkley: the change that is ignored, steps until it judges, and the factor by which the sum
is multiplied each step: the default values of river. Errors are in standard deviations."""

SPAN, STRIDE, EVERY = 48, 8, 12
"""Isolation forest: steps of a window, steps between the samples of it, and between windows."""

AHEAD, INNOVATIONS, MEMORY = 5, 25, 0.99
"""Joint models: steps of a prediction, innovations that are averaged, forgetting of the RLS."""

SMALLEST = 1e-6
"""Mahalanobis distance: scores below it, and above its inverse, are as this."""


class Scores(NamedTuple):
    """Steps of a stream, ``(n,)``, scores at them, ``(n, parts)``, and names of the parts."""

    steps: IndexArray
    values: FloatArray
    parts: tuple[str, ...]


Scorer = Callable[[Trial], Scores]


class Joints(NamedTuple):
    """Angles, speeds and commands of the joints of a stream, ``(steps, joints)`` each."""

    names: tuple[str, ...]
    angles: FloatArray
    speeds: FloatArray
    commands: FloatArray


@dataclass(frozen=True)
class Method:
    """A method: how it is fitted to a machine and its healthy trials.

    With ``in_common``, the largest healthy score of any part is that of all.
    """

    fitted: Callable[[Machine, Sequence[Trial]], Scorer]
    in_common: bool = False


def joints_of(machine: Machine, trial: Trial) -> Joints:
    """Returns the joints that one motor moves."""
    rows, names = trial.trajectory, trial.trajectory.names
    joints = [one for one in machine.model.anatomy.joints if len(one.hinges) == 1]
    hinges = [names.hinges.index(joint.hinges[0]) for joint in joints]
    motors = [names.motors.index(joint.motors[0]) for joint in joints]
    return Joints(
        tuple(joint.name for joint in joints),
        rows["joint_positions"][:, hinges],
        rows["joint_velocities"][:, hinges],
        rows["commands"][:, motors],
    )


def first_halves(machine: Machine, trials: Sequence[Trial]) -> list[Joints]:
    """Returns the joints in the first half of each trial."""
    halves = []
    for trial in trials:
        names, *signals = joints_of(machine, trial)
        halves.append(Joints(names, *(rows[: len(rows) // 2] for rows in signals)))
    return halves


def smoothed(rows: FloatArray, width: int) -> FloatArray:
    """Returns the mean of the newest rows at each row, 0 where there are fewer."""
    sums = np.cumsum(np.concatenate([np.zeros_like(rows[:1]), rows]), axis=0)
    means = np.zeros_like(rows)
    means[width - 1 :] = (sums[width:] - sums[:-width]) / width
    return means


def tracking_of(machine: Machine, trials: Sequence[Trial]) -> Callable[[Joints], FloatArray]:
    """Returns how far joints are from where their commands were, by the lag that fits best."""
    first = first_halves(machine, trials)[0]
    late = [
        np.mean(
            (first.commands[MAX_LAG - k : len(first.angles) - k] - first.angles[MAX_LAG:]) ** 2, 0
        )
        for k in range(MAX_LAG + 1)
    ]
    lags = np.argmin(late, axis=0)

    def errors(joints: Joints) -> FloatArray:
        rows = np.maximum(np.arange(len(joints.angles))[:, np.newaxis] - lags, 0)
        return np.abs(np.take_along_axis(joints.commands, rows, axis=0) - joints.angles)

    return errors


def tracking_error(machine: Machine, trials: Sequence[Trial]) -> Scorer:
    """Returns the mean tracking error of each joint: the plainest of monitors."""
    errors = tracking_of(machine, trials)

    def scores(trial: Trial) -> Scores:
        joints = joints_of(machine, trial)
        values = smoothed(errors(joints), SMOOTHED)
        return Scores(np.arange(len(values)), values, joints.names)

    return scores


def page_hinkley(machine: Machine, trials: Sequence[Trial]) -> Scorer:
    """Returns the test of Page and Hinkley of the tracking error of each joint.

    Source: Page, "Continuous inspection schemes", Biometrika 41 (1954); Hinkley, "Inference about
    the change-point from cumulative sum tests", Biometrika 58 (1971).
    """
    errors = tracking_of(machine, trials)
    healthy = np.concatenate([errors(joints) for joints in first_halves(machine, trials)])
    mean, deviation = healthy.mean(axis=0), healthy.std(axis=0)

    def scores(trial: Trial) -> Scores:
        joints = joints_of(machine, trial)
        rows = (errors(joints) - mean) / deviation
        values, average = np.zeros_like(rows), np.zeros(rows.shape[1])
        total, lowest = average, average
        for k, row in enumerate(rows):
            average = average + (row - average) / (k + 1)
            if k >= START:
                total = FORGETTING * total + row - average - TOLERANCE
                lowest = np.minimum(lowest, total)
                values[k] = total - lowest
        return Scores(np.arange(len(values)), values, joints.names)

    return scores


def isolation_forest(machine: Machine, trials: Sequence[Trial]) -> Scorer:
    """Returns 1 over the depth of windows of angle, speed and command in a forest of each joint.

    Source: Liu, Ting & Zhou, "Isolation forest", IEEE International Conference on Data Mining
    (2008); the program is scikit-learn's.
    """

    def windows(joints: Joints) -> tuple[IndexArray, FloatArray]:
        """Returns the last steps of windows, ``(n,)``, and windows, ``(joints, n, values)``."""
        rows = np.stack(joints[1:], axis=2)
        ends = np.arange(SPAN, len(rows), EVERY)
        chosen = rows[ends[:, np.newaxis] - np.arange(0, SPAN + 1, STRIDE)]
        return ends, chosen.transpose(2, 0, 1, 3).reshape(rows.shape[1], len(ends), -1)

    halves = [windows(joints)[1] for joints in first_halves(machine, trials)]
    forests = [
        IsolationForest(random_state=machine.seed).fit(own)
        for own in np.concatenate(halves, axis=1)
    ]

    def scores(trial: Trial) -> Scores:
        joints = joints_of(machine, trial)
        ends, rows = windows(joints)
        # A score is 2 to the power of minus the mean depth over that of healthy windows.
        depths = [-np.log2(-one.score_samples(own)) for one, own in zip(forests, rows, strict=True)]
        return Scores(ends, 1 / np.stack(depths, axis=1), joints.names)

    return scores


class JointModels(NamedTuple):
    """Linear models of joints: the speed some steps ahead by tracking error, speed and 1.

    Attributes:
        weights: ``(joints, 3)``.
        moments: Mean outer product of the inputs, ``(joints, 3, 3)``.
        variance: Mean squared error, ``(joints,)``.
    """

    weights: FloatArray
    moments: FloatArray
    variance: FloatArray


def inputs_of(joints: Joints) -> tuple[FloatArray, FloatArray]:
    """Returns inputs of the joint models, ``(n, joints, 3)``, and the speeds that follow."""
    errors = joints.commands - joints.angles
    inputs = np.stack([errors, joints.speeds, np.ones_like(errors)], axis=2)
    return inputs[:-AHEAD], joints.speeds[AHEAD:]


def joint_models(machine: Machine, trials: Sequence[Trial]) -> JointModels:
    """Returns the joint models of least squares of the first halves of healthy trials."""
    halves = [inputs_of(joints) for joints in first_halves(machine, trials)]
    inputs, speeds = (np.concatenate(rows) for rows in zip(*halves, strict=True))
    moments = np.einsum("nji,njk->jik", inputs, inputs) / len(inputs)
    products = np.einsum("nji,nj->ji", inputs, speeds) / len(inputs)
    weights = np.linalg.solve(moments, products[..., np.newaxis])[..., 0]
    variance = ((speeds - (inputs * weights).sum(axis=2)) ** 2).mean(axis=0)
    return JointModels(weights, moments, variance)


def recursive_least_squares(machine: Machine, trials: Sequence[Trial]) -> Scorer:
    """Returns the mean squared innovation of joint models that follow the robot.

    Source: Isermann, "Fault-diagnosis systems" (2006), chapter 9.
    """
    models = joint_models(machine, trials)

    def scores(trial: Trial) -> Scores:
        joints = joints_of(machine, trial)
        inputs, speeds = inputs_of(joints)
        weights = models.weights
        # That of endless healthy data.
        covariance = np.linalg.inv(models.moments) * (1 - MEMORY)
        squares = np.empty_like(speeds)
        for k, (row, speed) in enumerate(zip(inputs, speeds, strict=True)):
            innovation = speed - (row * weights).sum(axis=1)
            squares[k] = innovation**2 / models.variance
            spread = np.einsum("jik,jk->ji", covariance, row)
            gain = spread / (MEMORY + (row * spread).sum(axis=1))[:, np.newaxis]
            weights = weights + gain * innovation[:, np.newaxis]
            covariance = (covariance - gain[:, :, np.newaxis] * spread[:, np.newaxis]) / MEMORY
            covariance = (covariance + covariance.swapaxes(1, 2)) / 2  # rounding would grow
        steps = np.arange(AHEAD, AHEAD + len(squares))
        return Scores(steps, smoothed(squares, INNOVATIONS), joints.names)

    return scores


def multiple_model(machine: Machine, trials: Sequence[Trial]) -> Scorer:
    """Returns the log odds of the likeliest of two faulty models of each joint, at least 0.

    The models: the joint stands; its motor has half the torque. Angles and speeds are measured at
    each step, so the Kalman filter of each model is its prediction. The bound keeps a fault as
    likely as none, in place of the lower bound of a probability.

    Source: Maybeck, "Multiple model adaptive algorithms for detecting and compensating sensor and
    actuator/surface failures in aircraft flight control systems", International Journal of Robust
    and Nonlinear Control 9 (1999).
    """
    models = joint_models(machine, trials)

    def scores(trial: Trial) -> Scores:
        joints = joints_of(machine, trial)
        inputs, speeds = inputs_of(joints)
        healthy = speeds - (inputs * models.weights).sum(axis=2)
        weak = speeds - (inputs * models.weights * (0.5, 1.0, 0.5)).sum(axis=2)
        likelier = (healthy**2 - np.stack([speeds, weak]) ** 2) / (2 * models.variance)
        odds, values = np.zeros_like(likelier[:, 0]), np.empty_like(speeds)
        for k in range(len(values)):
            odds = np.maximum(odds + likelier[:, k], 0.0)
            values[k] = odds.max(axis=0)
        return Scores(np.arange(AHEAD, AHEAD + len(values)), values, joints.names)

    return scores


def mahalanobis(machine: Machine, trials: Sequence[Trial]) -> Scorer:
    """Returns the squared Mahalanobis distance of the logarithms of a watch's own scores.

    The self-model is that of the watch, so mean and covariance are of the second halves. The part
    is the joint or touch sensor whose score is the most standard deviations above its mean.
    """
    model = watch_of(machine).robot
    simulator = Simulator(model, threads=1)
    comparator = dataclasses.replace(SEGMENT_PREDICTION, only_last=True)
    anatomy = model.anatomy
    able = {joint.hinges[0]: joint.name for joint in anatomy.joints}
    able |= {sensor.name: sensor.name for sensor in anatomy.sensors if sensor.kind == "touch"}

    def logarithms(trial: Trial) -> tuple[IndexArray, FloatArray, tuple[str, ...]]:
        window, steps, rows, channels = Window(model, comparator.horizon), [], [], tuple[str, ...]()
        for sample in samples_of(trial.trajectory):
            if (newest := window.add(sample)) is not None:
                scores, channels = scores_of(simulator, comparator, newest)
                steps.append(window.steps - 1)
                rows.append(np.log(np.clip(scores, SMALLEST, 1 / SMALLEST)))
        return np.array(steps), np.array(rows), channels

    held_out = []
    for trial in trials:
        steps, rows, channels = logarithms(trial)
        held_out.append(rows[steps - comparator.horizon >= trial.trajectory.steps // 2])
    healthy = np.concatenate(held_out)
    mean, deviation = healthy.mean(axis=0), healthy.std(axis=0)
    inverse = np.linalg.inv(np.cov(healthy, rowvar=False))
    columns = [channels.index(name) for name in able]

    def scores(trial: Trial) -> Scores:
        steps, rows, _ = logarithms(trial)
        residuals = rows - mean
        distances = np.einsum("ni,ik,nk->n", residuals, inverse, residuals)
        shown = (residuals / deviation)[:, columns].argmax(axis=1)
        values = np.where(
            shown[:, np.newaxis] == np.arange(len(columns)), distances[:, np.newaxis], 0.0
        )
        return Scores(steps, values, tuple(able.values()))

    return scores


METHODS: Mapping[str, Method] = MappingProxyType(
    {
        "tracking error": Method(tracking_error),
        "Page-Hinkley": Method(page_hinkley),
        "isolation forest": Method(isolation_forest),
        "recursive least squares": Method(recursive_least_squares),
        "multiple models": Method(multiple_model),
        "Mahalanobis": Method(mahalanobis, in_common=True),
    }
)
"""The methods by name."""
