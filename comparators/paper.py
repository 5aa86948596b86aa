"""The paper's comparator, and one of all that the paper's robots measure."""

from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.comparators.sensor_series import PreparedSeries, SensorSeries, geman_mcclure
from selfmodel.diagnosis.comparator import TrialRefusedError
from selfmodel.simulation.requests import ClosedLoop
from selfmodel.trials.trajectory import Trajectory, forward_displacement
from selfmodel.trials.trial import Trial

DISPLACEMENT_SHARE = 0.2
"""Share of the displacement in the distance."""
RELATIVE_ERROR = 0.25
"""Difference of displacements that counts as large, as a part of the trial's displacement."""
MIN_ERROR = 0.1
"""Lower bound of the difference that counts as large, m."""

REQUEST = ClosedLoop(record=("base_position",))
READINGS = SensorSeries("paper-sensors", ("sensors",))


@dataclass(frozen=True)
class ForwardDisplacement:
    """The absolute difference of forward displacements, m.

    Source: the paper, section III (fitness of the diagnostic EA).

    Limits: one number contains little information about a run. Without a reality gap the true
    hypothesis is at exactly 0, but compounds of failures are hard to search for, because a
    half-right hypothesis need not be closer than a wrong one; with a gap, contact is chaotic and
    the number is mostly chance.
    """

    name: str = "forward-displacement"

    def prepare(self, trial: Trial) -> "PreparedDisplacement":
        """Returns the displacement of the trial.

        Raises:
            TrialRefusedError: The base's position is unknown at the first or the last step.
        """
        if not np.isfinite(trial.displacement):
            raise TrialRefusedError(
                f"{trial.path}: {self.name} needs base_position at the first and the last step, "
                f"and the log does not have it",
                "leave this log out, or give another comparator",
            )
        return PreparedDisplacement(trial.displacement)


@dataclass(frozen=True)
class PreparedDisplacement:
    """The forward displacement of a trial, m, and a request for that of a closed-loop rollout."""

    displacement: float
    request: ClosedLoop = REQUEST

    def distances(self, simulated: Trajectory) -> FloatArray:
        """Returns the distance of each simulation, ``(n,)``, m."""
        return np.abs(forward_displacement(simulated) - self.displacement)


@dataclass(frozen=True)
class PaperSensors:
    """``sensor-series`` on the controller's readings, and the final forward displacement.

    Source: the paper, section III: touch, joint angles and displacement are all that its robots
    measure.

    Limits: those of ``sensor-series``; a joint without a sensor of the controller (most knees)
    shows only in its effect on the motion.
    """

    name: str = "paper-sensors"
    series: SensorSeries = READINGS

    def prepare(self, trial: Trial) -> "PreparedPaperSensors":
        """Returns the readings and the displacement of the trial; a trial needs readings."""
        series = self.series.prepare(trial)
        record = (*series.request.record, "base_position")
        return PreparedPaperSensors(series, trial.displacement, ClosedLoop(record))


@dataclass(frozen=True, eq=False)
class PreparedPaperSensors:
    """A trial prepared for ``PaperSensors``.

    Attributes:
        series: The trial prepared for the comparison of the readings.
        displacement: Forward displacement of the trial, m; NaN if unknown.
        request: A closed-loop rollout that records the readings and ``base_position``.
    """

    series: PreparedSeries
    displacement: float
    request: ClosedLoop

    def losses(self, simulated: Trajectory) -> FloatArray:
        """Returns the loss of each window, and of the displacement if the trial has one.

        Returns:
            ``(n, windows)`` or ``(n, windows + 1)``, weighted so that their mean is the distance.
        """
        windows = self.series.losses(simulated)
        if not np.isfinite(self.displacement):
            return windows
        pieces = windows.shape[1] + 1
        large = max(RELATIVE_ERROR * abs(self.displacement), MIN_ERROR)
        end = geman_mcclure((forward_displacement(simulated) - self.displacement) / large)
        scaled = windows * ((1 - DISPLACEMENT_SHARE) * pieces / (pieces - 1))
        return np.column_stack([scaled, end * (DISPLACEMENT_SHARE * pieces)])


FORWARD_DISPLACEMENT = ForwardDisplacement()
PAPER_SENSORS = PaperSensors()
