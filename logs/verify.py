"""Verification of a log: checksums, format and model, without simulation."""

from pathlib import Path

from selfmodel.logs.errors import SchemaMismatchError
from selfmodel.logs.reader import TrialLog, read_log
from selfmodel.robot.mjcf.untrusted import checked_model
from selfmodel.sandbox.budget import DEFAULT_BUDGET, Budget


def verify(path: Path, budget: Budget = DEFAULT_BUDGET) -> tuple[TrialLog, bool]:
    """Returns the trial of a verified log, and whether its model was loaded.

    Verified are the checks of ``read_log``; that the model names no other files and has bounded
    sizes; and, if MuJoCo is installed, that the model loads and is of the robot of the messages.

    Args:
        path: The log.
        budget: Memory that the file may take.

    Raises:
        LogError: A check failed.
        InputError: The file does not exist.
    """
    log = read_log(path, budget)
    try:
        checked_model(log.mjcf, log.assets)
    except ValueError as error:
        raise SchemaMismatchError(path, str(error), good="its observations are intact") from error
    return log, _load(log)


def _load(log: TrialLog) -> bool:
    try:
        from selfmodel.logs.robots import robot_of  # noqa: PLC0415  # it needs MuJoCo
    except ImportError:
        return False
    robot_of(log)
    return True
