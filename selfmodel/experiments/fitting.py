"""A calibration as the commands make it and tell of it."""

import dataclasses
from collections.abc import Sequence
from typing import Any

from selfmodel.errors import InputError
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration import Calibration, calibrate
from selfmodel.trials.trial import Trial


def fitted(robot: Robot, trials: Sequence[Trial], threads: int) -> Calibration:
    """Calibrates where nobody asked for it; see ``calibrate``.

    Raises:
        InputError: It cannot be done; the message names the option that does without.
    """
    try:
        return calibrate(robot, trials, threads)
    except InputError as error:
        raise InputError(f"{error}, or give --no-calibrate") from error


def calibration_values(fit: Calibration | None) -> dict[str, Any] | None:
    """Returns a calibration as JSON has it; None where there was none."""
    if fit is None:
        return None
    return {
        **dataclasses.asdict(fit.parameters),
        "deviations": [float(deviation) for deviation in fit.deviations],
        "error_before": fit.error_before,
        "error": fit.error,
    }
