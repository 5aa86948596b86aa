"""What the tests of the import share: made-up recordings of the biped, and their mapping."""

from pathlib import Path

import numpy as np
import pytest

from selfmodel.logs.recordings.importer import ImportedTrial, import_recording
from selfmodel.logs.recordings.mapping_file import parse_mapping
from selfmodel.robot.robot import Robot
from tests.logs.conftest import biped  # noqa: F401 - a fixture
from tests.logs.recordings.bags import (
    T0,
    Item,
    array,
    imu,
    joint_state,
    odometry,
    wrench,
    write_bag,
)

JOINTS = ("LHX", "LHY", "RHX", "RHY")
HINGES = ("left_hip_x", "left_hip_y", "right_hip_x", "right_hip_y")

NAMES = """\
left_hip_x = "LHX"
left_hip_y = { name = "LHY", sign = -1, offset = 0.1 }
right_hip_x = "RHX"
right_hip_y = "RHY"
"""

MAPPING = f"""\
robot = "biped.xml"
control_timestep = 0.01

[joints]
topic = "/joint_states"
unit = "rad"
[joints.names]
{NAMES}
[commands]
topic = "/commands"
unit = "rad"
order = ["RHY", "RHX", "LHY", "LHX"]
[commands.names]
{NAMES}
[base]
topic = "/odom"

[imu]
topic = "/imu"

[touch.left_touch]
topic = "/left_foot"
threshold = 5.0
"""

JOINTS_ONLY = MAPPING.partition("[base]")[0].replace('order = ["RHY", "RHX", "LHY", "LHX"]\n', "")
"""A mapping of joints and of commands that have names."""


def angle(joint: int, seconds: float) -> float:
    """Where a joint of the made-up recording is."""
    return 0.3 * np.sin(3 * seconds + joint)


def recorded(seconds: float = 1.0) -> list[Item]:
    """A recording at 200, 100, 50, 100 and 100 Hz, each with its latency."""
    items: list[Item] = []
    for k in range(round(seconds * 200)):
        stamp = T0 + k * 5_000_000
        at = [angle(j, k / 200) for j in range(4)]
        items.append(("/joint_states", stamp + 2_000_000, joint_state(stamp, JOINTS, at, at)))
    for k in range(round(seconds * 100)):
        stamp = T0 + k * 10_000_000
        items.append(("/commands", stamp, array([angle(3 - j, k / 100) for j in range(4)])))
        items.append(("/left_foot", stamp + 10**6, wrench(stamp, (3, 0, 4 if k % 20 < 10 else 9))))
        felt = None if 20 <= k < 30 else (k, 0, 9)
        items.append(("/imu", stamp + 10**6, imu(stamp, (1, 0, 0, 0), (0, 0, k / 100), felt)))
    for k in range(round(seconds * 50)):
        stamp = T0 + k * 20_000_000
        half = 0.5 + k / 500
        items.append(
            (
                "/odom",
                stamp + 15_000_000,
                odometry(
                    stamp, (2, 3 + k / 100, 0.5), (np.cos(half), 0, 0, np.sin(half)), (0.5, 0, 0)
                ),
            )
        )
    return items


@pytest.fixture(scope="session")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A whole bag, which no test changes."""
    return write_bag(tmp_path_factory.mktemp("recorded") / "bag", recorded())


def imported(
    path: Path, robot: Robot, mapping: str = MAPPING, run: int | None = None
) -> ImportedTrial:
    """Imports a recording of the biped, by default a bag."""
    return import_recording(path, parse_mapping(mapping, "MAP.toml"), robot, run)
