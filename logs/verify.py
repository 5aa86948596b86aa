"""Verification of a log: checksums, format and model, without simulation."""

from dataclasses import dataclass
from pathlib import Path

from selfmodel.logs.errors import GOOD, CorruptError, SchemaMismatchError
from selfmodel.logs.mcap.contents import read_contents
from selfmodel.logs.mcap.provenance import UNTIED
from selfmodel.logs.reader import TrialLog, interpret
from selfmodel.robot.mjcf.untrusted import checked_model


@dataclass(frozen=True, eq=False)
class Verified:
    """Result of a verification.

    Attributes:
        log: Content of the log.
        model_loaded: Whether MuJoCo is installed and has loaded the model.
        digest: SHA-256 over records, files and messages; "" in a log of an earlier version, whose
            messages are not tied to their trial.
    """

    log: TrialLog
    model_loaded: bool
    digest: str


def verify(path: Path, expected: str = "") -> Verified:
    """Verifies a log.

    Verified are the checks of ``read_log``; that the hidden faults of a simulated robot are those
    of the trial; that the model names no other files; and, if MuJoCo is installed, that the model
    loads and is of the robot of the messages.

    Args:
        path: The log.
        expected: Digest that the log must have, or "".

    Raises:
        LogError: A check failed.
        InputError: The file does not exist.
    """
    contents = read_contents(path)
    log = interpret(path, contents)
    if expected and contents.digest != expected:
        has = f"the digest {contents.digest}" if contents.digest else f"no digest: {UNTIED}"
        what = f"expected the log with the digest {expected}; this log has {has}"
        raise CorruptError(path, what, advice="get the expected log from its origin again")
    try:
        checked_model(log.mjcf, log.assets)
    except ValueError as error:
        raise SchemaMismatchError(path, str(error), good=GOOD) from error
    return Verified(log, _load(log), contents.digest)


def _load(log: TrialLog) -> bool:
    try:
        from selfmodel.logs.robots import robot_of  # noqa: PLC0415  # it needs MuJoCo
    except ImportError:
        return False
    robot_of(log)
    return True
