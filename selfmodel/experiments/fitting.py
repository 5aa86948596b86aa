"""Calibration in experiments and commands."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from selfmodel.errors import InputError
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration import Calibration, calibrate
from selfmodel.trials.trial import Trial


def fitted(robot: Robot, trials: Sequence[Trial], threads: int) -> Calibration:
    """Returns a self-model fitted to healthy trials, for callers that calibrate by default.

    Raises:
        InputError: The fit failed; the message names the option that omits calibration.
    """
    with optional_calibration():
        return calibrate(robot, trials, threads)


@contextmanager
def optional_calibration() -> Iterator[None]:
    """Context manager that adds the option that omits calibration to an error's message."""
    try:
        yield
    except InputError as error:
        raise InputError(
            f"{error}, or leave the calibration out (--no-calibrate, calibrate=False)"
        ) from error
