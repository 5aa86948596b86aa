"""Every check that a log can be put to without a simulator."""

from pathlib import Path

from selfmodel.logs.errors import SchemaMismatchError
from selfmodel.logs.reader import TrialLog, read_log
from selfmodel.robot.mjcf.untrusted import checked_model


def verify(path: Path) -> tuple[TrialLog, bool]:
    """Returns the trial in a log that has passed every check, and whether its model was loaded.

    The checks are those of ``read_log``; that its model asks for no files and for bounded sizes;
    and, where there is MuJoCo, that it loads and is of the robot that the messages are of.

    Raises:
        LogError: One does not hold; the sentence names the file.
        InputError: There is no such file.
    """
    log = read_log(path)
    try:
        checked_model(log.mjcf, log.assets)
    except ValueError as error:
        raise SchemaMismatchError(path, str(error), good="what was observed reads well") from error
    return log, _load(log)


def _load(log: TrialLog) -> bool:
    try:
        from selfmodel.logs.robots import robot_of  # noqa: PLC0415  # it needs MuJoCo
    except ImportError:
        return False
    robot_of(log)
    return True
