"""What is suggested is right where it is sure, and marked where it is not."""

from pathlib import Path

import numpy as np
import pytest

from selfmodel.logs.recordings.mapping_file import parse_mapping
from selfmodel.logs.recordings.names import classified, likeness, matched
from selfmodel.logs.recordings.suggest import suggest
from selfmodel.robot.robot import Robot
from tests.logs.recordings.bags import T0, joint_state, made, write_bag
from tests.logs.recordings.conftest import imported, recorded
from tests.logs.recordings.table_files import HINGES, write_csv, write_npz

LEGS = ("front_left", "front_right", "back_left", "back_right")
MODEL = [f"{leg}_{part}" for leg in LEGS for part in ("shoulder", "knee")]


@pytest.mark.parametrize(
    "legs", [("FL", "FR", "RL", "RR"), ("LF", "RF", "LH", "RH"), ("fl", "fr", "hl", "hr")]
)
@pytest.mark.parametrize(
    ("told", "parts"),
    [
        ("{}_{}_joint", ("thigh", "calf")),
        ("{}_{}", ("HFE", "KFE")),
        ("joint/{}/{}", ("shoulder", "knee")),
        ("{}{}", ("Shoulder", "Knee")),
    ],
)
def test_the_usual_names_are_known(told: str, parts: tuple, legs: tuple):
    names = [told.format(leg, part) for leg in legs for part in parts]
    found = matched(MODEL, names[::-1])
    assert [found[name][0] for name in MODEL] == names
    assert all(sure for _, sure in found.values())


def test_sides_are_never_confused():
    assert likeness("front_left_knee", "FR_knee") == 0
    assert likeness("front_left_knee", "RL_knee") == 0
    assert "front_left_knee" not in matched(["front_left_knee"], ["FR_knee", "arm"])


def test_commands_without_names_get_an_order_to_check(biped: Robot, bag: Path):
    text = suggest(bag, biped, "biped.xml", with_timestep=True)
    assert 'order = ["LHX", "LHY", "RHX", "RHY"]  # CHECK: the bag has no names' in text
    assert "control_timestep = 0.01" in text
    assert "# No topic is similar to right_touch" in text
    assert 'left_hip_x = "LHX"\n' in text
    assert imported(bag, biped, text).trajectory.steps == 99


def test_the_control_time_step_is_that_of_the_commands(biped: Robot, tmp_path: Path):
    items = recorded()
    commands = [item for item in items if item[0] == "/commands"][::3]
    others = [item for item in items if item[0] != "/commands"]
    bag = write_bag(tmp_path / "bag", [*others, *commands])
    assert "control_timestep = 0.03" in suggest(bag, biped, "biped.xml", with_timestep=True)


def test_names_that_hold_anything_stay_names(biped: Robot, tmp_path: Path):
    names = ['LHX\n"', "left\x1b[31m_hip_y\\", "right hip é x", "RHY"]
    items = [("/joints", T0, joint_state(T0, names, [0.0] * 4))]
    items.append(("/x\n\x7f", T0, joint_state(T0, names[:1], [0.0])))
    text = suggest(write_bag(tmp_path / "bag", items), biped, "b.xml", with_timestep=True)
    assert all(char.isprintable() or char == "\n" for char in text)
    for number in range(text.count('"?"')):
        text = text.replace('"?"', f'"{number}"', 1)
    told = {link.name for link in parse_mapping(text, "m").trial.joints.links.values()}
    assert {names[1], names[2], names[3]} <= told


def test_a_hinge_for_which_no_joint_is_left_has_no_encoder(biped: Robot, tmp_path: Path):
    items = [item for item in recorded() if item[0] != "/joint_states"]
    for k in range(200):
        stamp = T0 + k * 5_000_000
        items.append(("/joint_states", stamp, joint_state(stamp, ["LHY", "RHX", "RHY"], [0.0] * 3)))
    bag = write_bag(tmp_path / "bag", items)

    text = suggest(bag, biped, "biped.xml", with_timestep=True)
    assert 'left_hip_x = "none"  # CHECK: no encoder' in text
    assert 'left_hip_x = "?"  # CHANGE' in text  # a motor has a command


# ---------------------------------------------------------------- tables


def suggestion(path: Path, robot: Robot) -> str:
    return suggest(path, robot, "biped.xml", with_timestep=True)


@pytest.mark.parametrize(
    ("position", "velocity", "command"),
    [
        ("position.{}", "velocity.{}", "command.{}"),
        ("{}_pos", "{}_vel", "{}_target"),
        ("q_{}", "dq_{}", "q_des_{}"),
        ("{}.q", "{}.dq", "qdes_{}"),
        ("pos_{}", "vel_{}", "posref.{}"),
        ("{}/position", "{}/velocity", "lowcmd/{}"),
        ("joint_{}_angle", "{}.qd", "{}.cmd"),
    ],
)
def test_usual_names_are_mapped(
    position: str, velocity: str, command: str, biped: Robot, tmp_path: Path
):
    row = np.zeros(3)
    found = {"timestamp_ms": np.arange(3)}
    for form in (position, velocity, command):
        found |= {form.format(hinge): row for hinge in HINGES}

    mapping = parse_mapping(suggestion(write_csv(tmp_path / "t.csv", found), biped), "m").trial

    assert (mapping.time.column, mapping.time.unit) == ("timestamp_ms", "ms")
    for hinge in HINGES:
        assert mapping.joints.links[hinge].name == position.format(hinge)
        assert mapping.joints.velocities[hinge] == velocity.format(hinge)
        assert mapping.commands.links[hinge].name == command.format(hinge)


@pytest.mark.parametrize(
    ("form", "axes", "body"),
    [
        ("q{}", "wxyz", "base"),
        ("orientation_{}", "wxyz", "base"),
        ("/imu/orientation/{}", "wxyz", "imu"),
        ("imu_quat[{}]", "0123", "imu"),
    ],
)
def test_a_quaternion_is_known_by_its_name(
    form: str, axes: str, body: str, biped: Robot, tmp_path: Path
):
    joints = [f"q_{k}" for k in range(4)]  # beside which it is none of them
    quaternion = [form.format(axis) for axis in axes]
    found = {name: np.zeros(3) for name in ["time", *joints, "x", "y", "z", *quaternion[::-1]]}

    text = suggestion(write_npz(tmp_path / "t.npz", found), biped)

    assert [f'"{joint}"' in text for joint in joints] == [True] * 4
    listed = ", ".join(f'"{name}"' for name in quaternion)
    check = "  # CHECK: w, x, y, z" if axes == "0123" else ""
    assert f"orientation = [{listed}]{check}\n" in text.partition(f"[{body}]")[2]
    assert 'position = ["x", "y", "z"]' in text


def test_a_contact_is_none_without_a_word_for_it(biped: Robot, tmp_path: Path):
    row = np.zeros(3)
    names = ["time", "qdes_left", "u_left", "right_foot_target", "left_foot_force"]
    text = suggestion(write_csv(tmp_path / "t.csv", dict.fromkeys(names, row)), biped)
    assert '[touch.left_touch]\ncolumn = "left_foot_force"' in text
    assert "# No column is similar to right_touch" in text

    numbers = [f"/{name}" for name in ("cmd/left_foot", "left_controller", "right_contact")]
    items = [(name, T0, made("std_msgs/msg/Float64")) for name in numbers]
    text = suggestion(write_bag(tmp_path / "bag", items), biped)
    assert '[touch.right_touch]\ntopic = "/right_contact"' in text
    assert "# No topic is similar to left_touch" in text


@pytest.mark.parametrize("group", ["desired_position", "lf_foot_pos"])
def test_a_vector_of_a_command_or_a_foot_is_not_the_base(group: str):
    own = [f"{group}_{axis}" for axis in "xyz"]
    base = [f"base_pos_{axis}" for axis in "xyz"]
    assert classified(own + base).vectors["base"] == {"position": tuple(base)}


@pytest.mark.parametrize("form", ["imu.linear_acceleration.{}", "imu_acc_{}", "accelerometer_{}"])
def test_an_acceleration_is_of_the_imu_alone(form: str):
    own = [form.format(axis) for axis in "xyz"]
    others = [f"{body}_{axis}" for body in ("base_acceleration", "imu_vel") for axis in "xyz"]
    found = classified(own + others).vectors
    assert found == {"base": {}, "imu": {"linear_acceleration": tuple(own)}}


def test_numbered_columns_are_mapped_in_order_and_marked(biped: Robot, tmp_path: Path):
    names = [f"q{k}" for k in range(4)] + [f"action[{k}]" for k in range(4)]
    found = {"t": np.arange(3.0), **{name: np.zeros(3) for name in names}}

    text = suggestion(write_npz(tmp_path / "t.npz", found), biped)

    assert 'left_hip_y = "q1"  # CHECK: not sure' in text
    assert 'right_hip_y = "action[3]"  # CHECK: not sure' in text


@pytest.mark.parametrize(("period", "unit"), [(0.005, "s"), (5.0, "ms"), (5e3, "us"), (5e6, "ns")])
def test_the_unit_of_time_is_guessed_from_the_rows(
    period: float, unit: str, biped: Robot, tmp_path: Path
):
    path = write_npz(tmp_path / "t.npz", {"time": np.arange(5) * period, "q": np.zeros(5)})

    assert f'unit = "{unit}"  # CHECK' in suggestion(path, biped)


def test_missing_columns_are_to_be_filled_in(biped: Robot, tmp_path: Path):
    path = write_csv(tmp_path / "t.csv", {"left_force": np.zeros(3), "a": np.zeros(3)})

    text = suggestion(path, biped)

    assert 'column = "?"  # CHANGE: the table has left_force, a' in text
    assert text.count('"?"  # CHANGE') == 9  # the time, four hinges and four motors
    assert '[touch.left_touch]\ncolumn = "left_force"' in text
