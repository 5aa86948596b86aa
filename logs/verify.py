"""Every check that a log can be put to without a simulator."""

from pathlib import Path

from selfmodel.logs.errors import SchemaMismatchError
from selfmodel.logs.reader import TrialLog, read_log
from selfmodel.logs.untrusted import checked_model


def verify(path: Path) -> TrialLog:
    """Returns the trial in a log that has passed every check.

    Those of ``read_log``, and that its model asks for no files and for bounded sizes.

    Raises:
        LogError: One does not hold; the sentence names the file.
        InputError: There is no such file.
    """
    log = read_log(path)
    try:
        checked_model(log.mjcf, log.assets)
    except ValueError as error:
        raise SchemaMismatchError(path, str(error), good="what was observed reads well") from error
    return log
