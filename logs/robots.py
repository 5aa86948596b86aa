"""Robot of a log, built from the untrusted model in the log."""

from collections.abc import Sequence
from contextlib import suppress

from selfmodel.errors import InputError, WorkError
from selfmodel.logs.errors import GOOD, SchemaMismatchError
from selfmodel.logs.reader import TrialLog
from selfmodel.robot.mjcf.load import MAX_SUBSTEPS, check_compiles
from selfmodel.robot.mjcf.untrusted import checked_model
from selfmodel.robot.mujoco_errors import MUJOCO_ERRORS, uncounted_warnings
from selfmodel.robot.robot import Robot
from selfmodel.trials.signals import Names


def robot_of(log: TrialLog) -> Robot:
    """Returns the robot of the model in a log.

    MuJoCo can read no files but the log's attachments. A child process compiles and steps the model
    before this process compiles it.

    Raises:
        LogError: The model is invalid, names other files, or is of another robot than the messages.
        WorkError: The child process ended for a reason other than the model.
    """

    def mismatch(what: str) -> SchemaMismatchError:
        return SchemaMismatchError(log.trial.path, what, good=GOOD)

    try:
        mjcf, files = checked_model(log.mjcf, log.assets)
        check_compiles(mjcf, files, log.control_timestep)
        with uncounted_warnings():
            robot = Robot(log.trial.robot, mjcf, log.control_timestep, files)
    except WorkError:  # a failure of this computer says nothing about the log
        raise
    except MUJOCO_ERRORS as error:
        reason = " ".join(str(error).split())
        raise mismatch(f"its model cannot be loaded: {reason}") from error
    if robot.substeps > MAX_SUBSTEPS:
        raise mismatch(
            f"its model takes {robot.substeps:.6g} physics steps for each of "
            f"{log.control_timestep} s, expected at most {MAX_SUBSTEPS}"
        )
    names = log.trial.trajectory.names
    if (robot.anatomy.names, robot.root) != (names, log.root):
        difference = describe_difference(robot.anatomy.names, names)
        raise mismatch(
            f"its model is of another robot than its messages: {difference}; the base is "
            f"{robot.root!r} in the model and {log.root!r} in the messages"
        )
    return robot


def describe_difference(names: Names, other: Names) -> str:
    """Returns the differences between a robot's names and those of another, as text."""
    differences = []
    for what in ("sensors", "motors", "hinges"):
        own, recorded = getattr(names, what), getattr(other, what)
        if own != recorded:
            lacks = [name for name in recorded if name not in own]
            differences.append(
                f"it has {len(own)} {what}, the other {len(recorded)}"
                + (f", of which it lacks {', '.join(lacks[:3])}" if lacks else " or in other order")
            )
    return "; ".join(differences) or "their parts have the same names"


def common_robot(logs: Sequence[TrialLog]) -> Robot:
    """Returns the common robot of logs; see ``robot_of``.

    Raises:
        InputError: There is no log, or two logs are of different robots.
        LogError: The model of the first log cannot be loaded.
    """
    if not logs:
        raise InputError("expected at least one log, got none")
    first = logs[0]
    for other in logs[1:]:
        if _identity(other) != _identity(first):
            same = other.trial.robot == first.trial.robot
            what = "of different models of the same name" if same else "of different robots"
            raise InputError(
                f"the logs are {what}: {first.trial.path} is of {first.trial.robot!r}, "
                f"{other.trial.path} of {other.trial.robot!r}; give logs of one robot"
            )
    return robot_of(first)


def _identity(log: TrialLog) -> tuple[object, ...]:
    """What logs of one robot have in common; a log of a robot of a log has no comments of MJCF."""
    trial, model = log.trial, (log.mjcf, dict(log.assets))
    with suppress(InputError):  # which ``robot_of`` explains
        model = checked_model(*model)
    return trial.robot, model, log.control_timestep, trial.trajectory.names
