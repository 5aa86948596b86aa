"""Calibration in experiments and commands, and its JSON."""

import dataclasses
from collections.abc import Sequence
from typing import Any

from selfmodel.errors import InputError
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration import Calibration, calibrate
from selfmodel.trials.trial import Trial


def fitted(robot: Robot, trials: Sequence[Trial], threads: int) -> Calibration:
    """Returns a self-model fitted to healthy trials, for callers that calibrate by default.

    Raises:
        InputError: The fit failed; the message names the option that omits calibration.
    """
    try:
        return calibrate(robot, trials, threads)
    except InputError as error:
        raise InputError(f"{error}, or give --no-calibrate") from error


def calibration_to_dict(fit: Calibration | None) -> dict[str, Any] | None:
    """Returns a calibration as JSON; None without a calibration."""
    if fit is None:
        return None
    return {
        **dataclasses.asdict(fit.parameters),
        "deviations": [float(deviation) for deviation in fit.deviations],
        "error_before": fit.error_before,
        "error": fit.error,
    }
