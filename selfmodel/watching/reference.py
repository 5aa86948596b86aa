"""What the healthy trials show: how wrong predictions of a healthy robot are, and of what motions.

The scores of the segments of each half of the healthy trials are **held out**: the self-model that
predicts them is fitted to the other halves. The p-value of a score of a watched robot is its rank
among them; beyond the largest, its predictive probability by the largest tenth, if these have a
Pareto tail of unknown index. Its **e-value** is proportional to 1 / p down to ``SMALLEST_P``. The
expected value of a healthy score is at most 1 if it is exchangeable with those and the tail is
right, on average over healthy trials; given some of them, it may be larger, the more the fewer they
are.

Besides, neighbouring segments depend on each other, and gaits differ in how well they are
predicted. So a score is first divided by a **margin** of its channel: the smallest with which no
stretch of the healthy trials is evidence against them, or the largest. Of each stretch, compared
with all other stretches, the products of 1 to ``DEPENDENT`` neighbouring e-values are to have an
expected value of at most 1, by a log-normal distribution with the mean and the variance of their
logarithms, which is lower than theirs. The margin has to absorb all that; no proof says that it
does.

Sources: Shafer, "Testing by betting", Journal of the Royal Statistical Society A 184 (2021), for
e-values of p-values. The predictive tail is the posterior mean over the index, whose prior is
proportional to its inverse.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.comparators.segment_prediction import MIN_SEGMENTS, SegmentPrediction
from selfmodel.diagnosis.adequacy import COVERAGE
from selfmodel.diagnosis.comparator import TrialRefusedError
from selfmodel.diagnosis.significance import LOSS_FLOOR
from selfmodel.errors import InputError
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trajectory import Trajectory, samples_of
from selfmodel.trials.trial import Trial, command_speeds
from selfmodel.watching.segments import Window, scores_of

MIN_HELD_OUT = 50
"""Held-out segments, at least: the largest tenth is their tail."""

STRETCH = 40
"""Segments of a stretch that is compared with the others: 5 s at 100 Hz, as long as a gait."""

DEPENDENT = 8
"""Segments, at most, whose e-values are multiplied to set a margin: a second."""

SMALLEST_P = 1e-4
"""Smallest p-value: with it, an alarm needs two segments or more. The delays and the false alarms
of four robots were about the same from 1e-4 to 1e-6."""

TAIL = 0.1
"""Share of the healthy scores, the largest, that tell how their tail goes on."""

MARGINS = tuple(float(1.25**power) for power in range(1, 16))
"""Margins that are tried, up to 28; the smallest is that of the speeds of commands."""


@dataclass(frozen=True, eq=False)
class Reference:
    """The healthy robot, as its trials show it.

    Attributes:
        robot: The self-model, fitted.
        channels: Names of the scores.
        scores: Held-out scores of each channel in increasing order, ``(n, channels)``.
        margins: Factor by which a score may be larger than those, ``(channels,)``.
        loss: Median held-out loss of the comparator.
        speeds: Largest speed of each motor's commands, per s, ``(motors,)``.
        lowest: Lowest command of each motor, ``(motors,)``.
        highest: Highest command, likewise.
    """

    robot: Robot
    channels: tuple[str, ...]
    scores: FloatArray
    margins: FloatArray
    loss: float
    speeds: FloatArray
    lowest: FloatArray
    highest: FloatArray

    def log_e_values(self, scores: FloatArray) -> FloatArray:
        """Returns the logarithms of the e-values of a segment; 0 for what was not observed."""
        channels = zip(_allowed(scores, self.margins), self.scores.T, strict=True)
        logs = np.array([_log_e_values(own, healthy) for own, healthy in channels])
        return np.where(np.isnan(scores), 0.0, logs)

    def loss_with(self, hinges: Sequence[int]) -> float:
        """Returns the median held-out loss of the comparator with those of some hinges."""
        return self.loss + float(np.median(self.scores[:, list(hinges)], axis=0).sum())

    def uncovered(self, trial: Trial, steps: int) -> str:
        """Returns why the healthy trials do not cover the last steps of a trial; "" if they do."""
        rows = trial.trajectory.rows(slice(-steps - 1, None))
        lowest, highest, speeds = _extent([rows])
        slack = (COVERAGE - 1) * (self.highest - self.lowest)
        for k, motor in enumerate(rows.names.motors):
            if speeds[k] > COVERAGE * self.speeds[k]:
                return (
                    f"{motor} is commanded at {speeds[k]:.2g} rad/s, in the healthy trials at "
                    f"{self.speeds[k]:.2g} rad/s at most"
                )
            if lowest[k] < self.lowest[k] - slack[k] or highest[k] > self.highest[k] + slack[k]:
                return (
                    f"{motor} is commanded from {lowest[k]:.2g} to {highest[k]:.2g}, in the "
                    f"healthy trials from {self.lowest[k]:.2g} to {self.highest[k]:.2g}"
                )
        return ""


def reference_of(
    robot: Robot,
    trials: Sequence[Trial],
    comparator: SegmentPrediction,
    fitted: Callable[[Sequence[Trial]], Robot],
) -> Reference:
    """Returns what healthy trials show of a robot, compared with self-models ``fitted`` to others.

    Raises:
        InputError: The trials are too short.
    """
    halves = [_halves(trial) for trial in trials]
    stretches, channels = list[FloatArray](), tuple[str, ...]()
    for held_out, others in ((0, 1), (1, 0)):
        simulator = Simulator(fitted([each[others] for each in halves]), threads=1)
        for half in (each[held_out] for each in halves):
            window, scores = Window(robot, comparator.horizon), list[FloatArray]()
            for newest in filter(None, map(window.add, samples_of(half.trajectory))):
                with suppress(TrialRefusedError):
                    own, channels = scores_of(simulator, comparator, newest)
                    # A healthy robot may lack a value at times; its watch says nothing then.
                    scores.append(np.where(np.isnan(own), np.inf, own))
            if scores:
                count = max(1, round(len(scores) / STRETCH))
                stretches += np.array_split(np.array(scores), count)
    if (count := sum(map(len, stretches))) < MIN_HELD_OUT or len(stretches) == 1:
        needed = MIN_HELD_OUT + 2 * len(trials) * MIN_SEGMENTS
        seconds = needed * comparator.horizon * robot.control_timestep
        raise InputError(
            f"expected healthy trials of {seconds:.0f} s or more together, with "
            f"{MIN_HELD_OUT} segments without late steps, got {count}: record more"
        )
    lowest, highest, speeds = _extent([trial.trajectory for trial in trials])
    names, every = robot.anatomy.names, np.concatenate(stretches)
    first_signal = len(names.hinges) + len(names.sensors)
    return Reference(
        robot=fitted(trials),
        channels=channels,
        scores=np.sort(every, axis=0),
        margins=_margins(stretches),
        loss=float(np.median(every[:, first_signal:].sum(axis=1))),
        speeds=speeds,
        lowest=lowest,
        highest=highest,
    )


def _halves(trial: Trial) -> list[Trial]:
    rows, middle = trial.trajectory, trial.trajectory.steps // 2
    second = rows.rows(slice(middle, None))
    second = replace(second, time=second.time - second.time[0])
    return [
        replace(trial, trajectory=half, path=f"{trial.path}, {name} half")
        for name, half in (("first", rows.first(middle)), ("second", second))
    ]


def _margins(stretches: Sequence[FloatArray]) -> FloatArray:
    """Returns the margin of each channel; see the module."""
    columns = zip(*(scores.T for scores in stretches), strict=True)
    return np.array(
        [next((m for m in MARGINS if _is_enough(m, own)), MARGINS[-1]) for own in columns]
    )


def _is_enough(margin: float, stretches: Sequence[FloatArray]) -> bool:
    """Returns whether no stretch is evidence against the others."""
    for number, own in enumerate(stretches):
        others = np.sort(np.concatenate([*stretches[:number], *stretches[number + 1 :]]))
        logs_of = _log_e_values(_allowed(own, margin), others)
        sums = np.append(0.0, np.cumsum(logs_of))
        for length in range(1, min(DEPENDENT, len(own)) + 1):
            logs = sums[length:] - sums[:-length]
            if logs.mean() + logs.var() / 2 > 0.0:
                return False
    return True


def _allowed(scores: FloatArray, margin: FloatArray | float) -> FloatArray:
    """Returns scores less what a healthy robot may have beyond its healthy trials."""
    return np.asarray(np.maximum(scores / margin - LOSS_FLOOR, 0.0))


def _log_e_values(scores: FloatArray, healthy: FloatArray) -> FloatArray:
    """Returns the logarithms of the e-values of scores, by healthy ones in increasing order."""
    above, n = len(healthy) - np.searchsorted(healthy, scores), len(healthy)
    largest = healthy[-max(1, round(TAIL * n)) - 1 :]
    p, count = (above + 1) / (n + 1), len(largest) - 1
    if 0.0 < largest[0] < largest[-1] < np.inf:
        spread = np.log(largest[1:] / largest[0]).sum()
        beyond = np.log(np.maximum(scores, largest[-1]) / largest[0]) / spread
        tail = (count + 1) / (n + 1) * (1.0 + beyond) ** -count
        p = np.where(scores > largest[-1], np.minimum(p, tail), p)
    return np.asarray(-np.log(np.maximum(p, SMALLEST_P)) - np.log(1.0 - np.log(SMALLEST_P)))


def _extent(trajectories: Sequence[Trajectory]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Returns the lowest and highest command and the largest speed of each motor; NaN if none."""
    commands = np.concatenate([rows["commands"] for rows in trajectories])
    speeds = np.concatenate([command_speeds(rows) for rows in trajectories])
    lowest, highest = (one.reduce(commands, axis=0) for one in (np.fmin, np.fmax))
    return lowest, highest, np.asarray(np.fmax.reduce(speeds, axis=0))
