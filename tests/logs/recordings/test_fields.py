"""A topic of any type that a bag defines is a table of the numbers in its messages."""

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from rosbags.typesys import get_types_from_msg

from selfmodel.errors import InputError
from selfmodel.logs.recordings.bags import read_bag
from selfmodel.logs.recordings.mapping_file import parse_mapping
from selfmodel.logs.recordings.suggest import suggest
from selfmodel.robot.robot import Robot
from tests.logs.recordings.bags import (
    ROS,
    T0,
    Defined,
    header,
    low_command,
    low_state,
    made,
    storage,
    write_bag,
    write_defined,
)
from tests.logs.recordings.conftest import imported

PARTS = ("hip", "thigh", "calf")
OURS = [f"{leg}_{part}" for leg in ("FL", "FR", "RL", "RR") for part in PARTS]
THEIRS = [f"{leg}_{part}" for leg in ("FR", "FL", "RR", "RL") for part in PARTS]
"""Joints in the order of the model, and of Unitree's messages."""


@pytest.fixture(scope="module")
def go() -> Robot:
    """Four legs of three hinges, in another order than Unitree's."""
    legs = "".join(
        f'<body pos="0 {k} 0"><joint name="{leg}_hip_joint"/><geom size="0.1"/>'
        f'<body><joint name="{leg}_thigh_joint" axis="0 1 0"/><geom size="0.1"/>'
        f'<body><joint name="{leg}_calf_joint" axis="0 1 0"/><geom size="0.1"/>'
        f'<site name="{leg}_sole"/></body></body></body>'
        for k, leg in enumerate(("FL", "FR", "RL", "RR"))
    )
    motors = "".join(f'<position name="{j}" joint="{j}_joint" kp="9"/>' for j in OURS)
    touch = "".join(f'<touch name="{j}_touch" site="{j}_sole"/>' for j in ("FL", "FR", "RL", "RR"))
    mjcf = (
        f'<mujoco model="go"><worldbody><body name="trunk" pos="0 0 1"><freejoint/>'
        f'<geom size="0.1"/>{legs}</body></worldbody><actuator>{motors}</actuator>'
        f"<sensor>{touch}</sensor></mujoco>"
    )
    return Robot("go", mjcf, 0.01)


def walked(folder: Path, form: str = "mcap") -> Path:
    """A bag of a Unitree robot at 500 Hz: joint k of its messages is at k / 10, and moves at k."""
    items = []
    for k in range(500):
        time, place = T0 + k * 2_000_000, np.arange(12.0)
        state = low_state(
            place / 10 + k / 1000,
            place,
            -place,
            wxyz=(np.cos(0.1), np.sin(0.1), 0, 0),
            gyroscope=(0, 0, 0.5),
            feet=(0, 30, 0, 30),
        )
        items += [("/lowstate", time, state), ("/lowcmd", time + 1, low_command(place / 10 + 1))]
        if k % 25 == 0:
            items.append(("/lf/lowstate", time, state))
    return write_bag(folder, items, form)


@pytest.mark.parametrize("defined", [True, False], ids=["mcap", "sqlite of Humble"])
def test_a_bag_of_unitree_is_imported_by_the_suggested_mapping(
    *, defined: bool, go: Robot, tmp_path: Path
):
    bag = walked(tmp_path / "bag", "mcap" if defined else "sqlite")
    if not defined:
        with closing(sqlite3.connect(storage(bag))) as database:
            database.execute("DROP TABLE message_definitions")  # as before Iron
    text = suggest(bag, go, "go.xml", with_timestep=True)
    assert "CHANGE:" not in text

    recording = imported(bag, go, text)

    signals, steps = recording.trajectory, recording.trajectory.steps
    places = np.array([THEIRS.index(joint) for joint in OURS])
    assert steps == 100
    moved = np.arange(steps)[:, np.newaxis] * 5 / 1000
    assert np.allclose(signals["joint_positions"], places / 10 + moved, atol=1e-6)
    assert np.allclose(signals["joint_velocities"], places)
    assert np.allclose(signals["joint_efforts"], -places)
    assert np.allclose(signals["commands"][1:], places / 10 + 1, atol=1e-6)
    assert signals["sensors"][0].tolist() == [1, 0, 1, 0]
    assert np.allclose(signals["base_orientation"], [np.cos(0.1), np.sin(0.1), 0, 0])
    assert np.allclose(signals["base_angular_velocity"], [0, 0, 0.5])
    assert np.allclose(recording.acceleration, [0, 0, 9.5])
    assert recording.qualities.keys() == {"/lowstate", "/lowcmd"}


STATE = """\
std_msgs/Header header
lab_msgs/Joint[] joints
float64[4] wanted
string mode
================================================================================
MSG: lab_msgs/Joint
string name
float32 angle
"""
MAPPING = """\
robot = "biped.xml"
control_timestep = 0.01
[joints]
topic = "/state"
unit = "rad"
[joints.names]
left_hip_x = "joints[0].angle"
left_hip_y = { name = "joints[1].angle", sign = -1, offset = 0.1 }
right_hip_x = "joints[2].angle"
right_hip_y = "joints[3].angle"
[commands]
topic = "/state"
unit = "rad"
[commands.names]
left_hip_x = "wanted[0]"
left_hip_y = "wanted[1]"
right_hip_x = "wanted[2]"
right_hip_y = "wanted[3]"
"""


@pytest.fixture(scope="module")
def of_lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bag of a laboratory's own type, whose list has three joints in messages 0 and 20 to 23."""
    kind = "lab_msgs/msg/State"
    ROS.register(get_types_from_msg(STATE, kind))
    path = tmp_path_factory.mktemp("lab") / "bag.mcap"
    topics = Defined("/state", kind, STATE), Defined("/undefined", kind, STATE, "ros2idl")
    rows = []
    for k in range(50):
        stamp, seen = T0 + k * 10**7, 3 if k < 1 or 20 <= k < 24 else 4
        joints = [made("lab_msgs/msg/Joint", angle=k / 100 + j) for j in range(seen)]
        message = made(kind, header=header(stamp), joints=joints, wanted=[1, 2, 3, 4])
        data = ROS.serialize_cdr(message, kind)
        rows += [(topic, stamp + 5_000_000, data) for topic in topics]
    write_defined(path, rows)
    return path


def test_numbers_of_a_type_of_ones_own_are_named_by_their_place_in_a_message(
    of_lab: Path, biped: Robot
):
    recording = imported(of_lab, biped, MAPPING)
    angles = recording.trajectory["joint_positions"]
    time = recording.trajectory.time

    assert np.allclose(angles[:, 0], 0.01 + time, atol=1e-6)
    assert np.allclose(angles[:, 1], 0.1 - (1.01 + time), atol=1e-6)
    assert np.flatnonzero(np.isnan(angles[:, 3])).tolist() == [19, 20, 21, 22]
    assert np.allclose(recording.trajectory["commands"], [1, 2, 3, 4])
    assert recording.qualities["/state"].latency == pytest.approx(0.005)


@pytest.mark.parametrize(
    ("right", "wrong", "named"),
    [
        (
            "joints[2].angle",
            "joints[4].angle",
            r"9: .*number on /state 'joints\[4\].angle': did .*",
        ),
        (
            '"/state"',
            '"/undefined"',
            "4: .*lab_msgs/msg/State, which the bag does not define, or whose .* numbers.* /state",
        ),
        ("[commands]\n", '[imu]\ntopic = "/state"\n[commands]\n', "11: .*under orientation or ang"),
    ],
)
def test_a_mistake_has_its_line(right: str, wrong: str, named: str, of_lab: Path, biped: Robot):
    text = MAPPING.replace(right, wrong, 1)
    with pytest.raises(InputError, match=rf"^MAP\.toml:{named}") as caught:
        imported(of_lab, biped, text)
    assert len(str(caught.value)) < 1000


def test_a_type_of_the_bag_goes_before_that_of_ros(biped: Robot, tmp_path: Path):
    """Types differ between distributions; and a suggestion reads topics that nobody needs."""
    path = tmp_path / "bag.mcap"
    newer = Defined("/newer", "geometry_msgs/msg/Twist", "float64[2] linear\nuint8 more\n")
    other = Defined("/other", "geometry_msgs/msg/Accel")
    data = b"\0\1\0\0" + np.array([1.0, 2.0]).tobytes() + b"\7"
    write_defined(path, [(newer, T0, data), (other, T0, data)])

    found = read_bag(path).series

    columns = found["/newer"].columns
    assert {name: column.values.item() for name, column in columns.items()} == {
        "linear[0]": 1.0,
        "linear[1]": 2.0,
        "more": 7.0,
    }
    assert (found["/other"].names, found["/other"].count) == ((), 1)
    assert 'topic = "?"' in suggest(path, biped, "b.xml", with_timestep=True)


LINE = "=" * 80


@pytest.mark.parametrize(
    ("definition", "is_defined"),
    [
        ("uint8 header", True),
        (f"lab_msgs/Header header\n{LINE}\nMSG: lab_msgs/Header\nuint8 x", True),
        ("lab_msgs/Nowhere x", False),
        ("lab_msgs/Odd x", False),
        (f"E[100000000] q\n{LINE}\nMSG: lab_msgs/E\n", False),
    ],
)
def test_an_odd_definition_damages_no_bag(*, definition: str, is_defined: bool, tmp_path: Path):
    path = tmp_path / "bag.mcap"
    write_defined(path, [(Defined("/odd", "lab_msgs/msg/Odd", definition), T0, b"\0\1\0\0\7")])

    series = read_bag(path).series["/odd"]

    assert [column.values.item() for column in series.columns.values()] == [7.0] * is_defined
    assert series.stamps.tolist() == [0] * is_defined


def test_a_motor_that_is_commanded_no_angle_has_none(tmp_path: Path):
    bag = write_bag(tmp_path / "bag", [("/lowcmd", T0, low_command([1.0, 2.146e9]))])
    columns = read_bag(bag).series["/lowcmd"].columns
    assert [columns[f"motor_cmd[{k}].q"].values.item() for k in range(2)] == [1.0, np.inf]


def test_only_the_numbers_that_a_mapping_names_are_kept(of_lab: Path):
    places = parse_mapping(MAPPING, "m").places.values()
    series = read_bag(of_lab, {"/state": {name for one in places for name in one.columns}})
    columns = series.series["/state"].columns
    assert {name: len(column.index) for name, column in columns.items()} == {
        **{f"joints[{k}].angle": 50 for k in range(4)},
        **{f"wanted[{k}]": 50 for k in range(4)},
        "header.stamp.sec": 1,
        "header.stamp.nanosec": 1,
    }
