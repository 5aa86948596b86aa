"""Time series of the sensors of the paper's robots, and the final displacement."""

from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.comparators.sensor_series import PreparedSeries, SensorSeries, geman_mcclure
from selfmodel.simulation.requests import ClosedLoop
from selfmodel.trials.behaviour import Behaviour, forward_displacement
from selfmodel.trials.trial import Trial

DISPLACEMENT_SHARE = 0.2
"""Share of the displacement in the distance."""
RELATIVE_ERROR = 0.25
"""Difference of displacements that counts as large, as a part of the trial's displacement."""
MIN_ERROR = 0.1
"""Lower bound of the difference that counts as large, m."""
READINGS = SensorSeries("paper-sensors", ("sensors",))


@dataclass(frozen=True)
class PaperSensors:
    """``sensor-series`` on the controller's readings, and the final forward displacement.

    Source: the paper, section III: touch, joint angles and displacement are all that its robots
    measure.

    Limits: those of ``sensor-series``; a joint without a sensor of the controller (most knees)
    shows only in its effect on the motion.

    Attributes:
        name: The comparator's name.
        series: The comparator of the readings.
    """

    name: str = "paper-sensors"
    series: SensorSeries = READINGS

    def prepare(self, trial: Trial) -> "PreparedPaperSensors":
        """Returns the readings and the displacement of the trial.

        Raises:
            InputError: The trial has no readings.
        """
        series = self.series.prepare(trial)
        return PreparedPaperSensors(
            series=series,
            displacement=trial.displacement,
            request=ClosedLoop(record=(*series.request.record, "base_position")),
        )


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

    def losses(self, simulated: Behaviour) -> FloatArray:
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
        return np.column_stack(
            [
                windows * ((1 - DISPLACEMENT_SHARE) * pieces / (pieces - 1)),
                end * (DISPLACEMENT_SHARE * pieces),
            ]
        )


PAPER_SENSORS = PaperSensors()
