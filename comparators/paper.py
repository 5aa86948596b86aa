"""The paper's comparator, and one of all that the paper's robots measure."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.comparators.sensor_series import SensorSeries, geman_mcclure
from selfmodel.diagnosis.comparator import Prepared, TrialRefusedError
from selfmodel.simulation.requests import ClosedLoop
from selfmodel.trials.trajectory import Trajectory, forward_displacement
from selfmodel.trials.trial import Trial

DISPLACEMENT_SHARE = 0.2
"""Share of the displacement in the distance."""
RELATIVE_ERROR, MIN_ERROR = 0.25, 0.1
"""Difference of displacements that counts as large: as a part of the trial's displacement, and its
lower bound, m."""

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
        """Returns the displacement of the trial; refuses one whose way is unknown."""
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

    def prepare(self, trial: Trial) -> Prepared:
        """Returns the readings and the displacement of the trial; a trial needs readings."""
        series = READINGS.prepare(trial)
        record = (*series.request.record, "base_position")
        return Prepared(ClosedLoop(record), partial(_losses, series, trial.displacement))


def _losses(series: Prepared, displacement: float, simulated: Trajectory) -> FloatArray:
    """Returns the loss of each window, and of the displacement if the trial has one.

    The losses, ``(n, windows)`` or ``(n, windows + 1)``, are weighted so that their mean is the
    distance.
    """
    windows = np.asarray(series.losses(simulated))
    if not np.isfinite(displacement):
        return windows
    pieces = windows.shape[1] + 1
    large = max(RELATIVE_ERROR * abs(displacement), MIN_ERROR)
    end = geman_mcclure((forward_displacement(simulated) - displacement) / large)
    scaled = windows * ((1 - DISPLACEMENT_SHARE) * pieces / (pieces - 1))
    return np.column_stack([scaled, end * (DISPLACEMENT_SHARE * pieces)])


FORWARD_DISPLACEMENT = ForwardDisplacement()
PAPER_SENSORS = PaperSensors()
