"""The paper's quadruped: four legs, each with a shoulder and a knee."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dm_control.utils import containers

from selfmodel.robot.robot import Robot

if TYPE_CHECKING:
    import numpy as np
    from dm_control.rl import control

    from selfmodel.faults.hypothesis import Hypothesis

CONTROL_TIMESTEP = 0.01
"""Seconds between two commands."""

CASES: Mapping[int, str] = {
    1: "break:front_left_knee",
    2: "break:front_left_shoulder",
    3: "sensor:front_left_touch",
    4: "break:front_left_shoulder+sensor:front_right_touch",
    5: "sensor:front_left_angle",
    6: "jam:front_left_shoulder",
    7: "break:front_left_shoulder+jam:back_left_shoulder",
    8: "break:front_left_shoulder+jam:back_left_shoulder+sensor:back_right_angle",
    9: "intact",
    10: "neuron:0",
}
"""The failures of Table I of the paper, in notation."""

SUITE = containers.TaggedTasks()


def robot() -> Robot:
    """Returns the robot with nothing wrong."""
    mjcf = Path(__file__).with_suffix(".xml").read_text(encoding="utf-8")
    return Robot(name="quadruped", mjcf=mjcf, control_timestep=CONTROL_TIMESTEP)


@SUITE.add("walking")
def walk(
    hypothesis: "str | Hypothesis" = "intact",
    time_limit: float = 10.0,
    random: "int | np.random.RandomState | None" = None,
    environment_kwargs: dict[str, Any] | None = None,
) -> "control.Environment":
    """Returns the task of walking forward; see ``walking.environment``."""
    # Here, because dm_control's physics looks for a display as it is imported.
    from selfmodel.tasks import walking  # noqa: PLC0415

    return walking.environment(robot(), hypothesis, time_limit, random, environment_kwargs)
