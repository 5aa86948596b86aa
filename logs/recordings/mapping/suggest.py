"""Suggestion of a mapping from a recording and a robot.

Comments mark uncertain entries: ``CHECK`` marks a guess, ``CHANGE`` an entry to fill in.
"""

from pathlib import Path

from selfmodel.logs.recordings.mapping.quoting import quoted
from selfmodel.logs.recordings.mapping.suggest_bag import suggest_for_bag
from selfmodel.logs.recordings.mapping.suggest_table import suggest_for_table
from selfmodel.logs.recordings.tables.table import is_table
from selfmodel.robot.robot import Robot


def suggest(path: Path, robot: Robot, name: str, *, with_timestep: bool) -> str:
    """Returns the suggestion of a mapping, as TOML.

    Args:
        path: Folder or file of a bag, or a table.
        robot: Robot of the recording.
        name: Name of the robot in the mapping, or its MJCF or URDF file.
        with_timestep: Whether the mapping must contain the control time step.

    Raises:
        LogError: The recording is damaged.
        InputError: The recording cannot be read.
    """
    lines = [
        "# A suggestion. CHECK marks a guess; CHANGE must be filled in before it can be used.",
        f"robot = {quoted(name)}",
    ]
    if with_timestep:
        lines.append(
            f"control_timestep = {robot.control_timestep!r}  "
            f"# s; CHECK: how often the robot is commanded"
        )
    lines += [
        '# controller = "gait.npz"  # controller of the robot, if known',
        '# stage = "before"  # of the healthy robot',
        *(suggest_for_table if is_table(path) else suggest_for_bag)(path, robot),
    ]
    return "\n".join(lines).rstrip() + "\n"
