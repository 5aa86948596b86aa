"""What the paper's robots can sense, compared as time series."""

from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.comparators.bounded import bounded
from selfmodel.comparators.sensor_series import SensorSeries
from selfmodel.simulation.requests import ClosedLoop
from selfmodel.trials.behaviour import Behaviour, forward_displacement
from selfmodel.trials.trial import Trial

SHARE = 0.2
"""How much of the distance the displacement makes up."""
FAR = 0.25
"""A difference of displacements that is large, as a part of the displacement itself."""
FLOOR = 0.1
"""And at least this, m."""
READINGS = SensorSeries("paper-sensors", ("sensors",))


@dataclass(frozen=True)
class PaperSensors:
    """``sensor-series`` on what the controller received, and the forward displacement at the end.

    Source: the paper, section III: touch, joint angles and displacement are all that its robots
    measure.

    Limits: those of ``sensor-series``; what no sensor of the controller sees (most knees have
    none) shows only in how the robot moves on.
    """

    name: str = "paper-sensors"
    series: SensorSeries = READINGS

    def request(self, trial: Trial) -> ClosedLoop:
        """Returns that it looks at the controller's readings and at where the root body is.

        Raises:
            InputError: The trial has no readings.
        """
        return ClosedLoop(record=(*self.series.request(trial).record, "base_position"))

    def distances(self, simulated: Behaviour, trial: Trial) -> FloatArray:
        """Returns the distance of each simulation, ``(n,)``, from 0 to 1."""
        return np.asarray(self.losses(simulated, trial).mean(axis=1))

    def losses(self, simulated: Behaviour, trial: Trial) -> FloatArray:
        """Returns the loss of each window, and of the displacement where the trial has it.

        Returns:
            ``(n, windows)`` or ``(n, windows + 1)``, weighted so that their mean is the distance.
        """
        windows = self.series.losses(simulated, trial)
        if not np.isfinite(trial.displacement):
            return windows
        pieces = windows.shape[1] + 1
        far = max(FAR * abs(trial.displacement), FLOOR)
        end = bounded((forward_displacement(simulated) - trial.displacement) / far)
        return np.column_stack(
            [windows * ((1 - SHARE) * pieces / (pieces - 1)), end * (SHARE * pieces)]
        )


PAPER_SENSORS = PaperSensors()
