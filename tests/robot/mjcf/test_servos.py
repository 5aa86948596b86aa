"""Tests of the settings with a value for each joint: servos of torque motors, and their reach."""

import math
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, strategies as st

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.mjcf.settings import checked_settings, parse_setting, read_settings, value_of
from selfmodel.robot.robot import Robot
from tests.robot.mjcf.awkward import KEY, LEGS, mjcf
from tests.robot.mjcf.test_adaptation import written

TORQUE_MOTORS = """<motor name="left" joint="left_hip" gear="-4" ctrlrange="-2 1"/>
<motor name="right" joint="right_hip" ctrlrange="-9 9" forcerange="-7 7"/>"""
GAINS = ("kp=30", "kd=2")
STANDING = KEY.format("0 0 .35 1 0 0 0 .4 -.1")
CLASS = '<default><position kp="7" inheritrange="1"/></default>'


def loaded(folder: Path, text: str, *given: str) -> Robot:
    """Returns the robot of a text with settings."""
    path = written(folder, text)
    extra = {key: value for one in given for key, value in parse_setting(one).items()}
    return load_mjcf(path, read_settings(path, extra))


@pytest.mark.parametrize(
    ("left", "limits"),
    [
        (TORQUE_MOTORS.splitlines()[0], [-4, 8]),
        ('<general name="left" joint="left_hip" gainprm="3" gear="2" ctrlrange="-1 2"/>', [-6, 12]),
    ],
)
def test_a_torque_motor_becomes_a_servo_with_its_torque_limits(
    left: str, limits: list[float], tmp_path: Path
):
    model = loaded(tmp_path, mjcf(motors=left + TORQUE_MOTORS.splitlines()[1]), *GAINS).model

    assert [model.actuator(motor).name for motor in range(model.nu)] == ["left", "right"]
    assert model.actuator_gear[:, 0].tolist() == [1, 1]
    assert model.actuator_forcerange.tolist() == [limits, [-7, 7]]
    assert np.array_equal(model.actuator_ctrlrange, model.jnt_range[model.actuator_trnid[:, 0]])


def test_the_physics_of_joints_and_contacts_is_that_of_the_settings(tmp_path: Path):
    settings = ("armature=0.01", 'damping={left_hip=0.2, "right*"=0.3}', "friction=0.04")
    model = loaded(tmp_path, mjcf(), *settings, "timestep=0.001", "solref=[0.03, 0.9]").model
    left, right = (model.joint(f"{side}_hip").dofadr[0] for side in ("left", "right"))

    assert model.opt.timestep == 0.001
    assert (model.geom_solref == (0.03, 0.9)).all()
    assert (model.dof_armature[left], model.dof_armature[right]) == (0.01, 0.01)
    assert (model.dof_damping[left], model.dof_damping[right]) == (0.2, 0.3)
    assert (model.dof_frictionloss[left], model.dof_frictionloss[right]) == (0.04, 0.04)
    assert not model.dof_damping[:6].any()


@pytest.mark.parametrize("digits", [6, 16])
def test_a_time_step_of_many_digits_may_be_written_with_few(digits: int, tmp_path: Path):
    steps = f"timestep={1 / 240:.{digits}g}", f"control_timestep={4 / 240:.{digits}g}"
    copied = f'{LEGS}<replicate count="1"><geom size="0.1" pos="9 0 0"/></replicate>'
    for text in (mjcf(), mjcf(legs=copied)):
        robot = loaded(tmp_path, text, *steps)
        assert robot.substeps == 4
        assert robot.control_timestep == pytest.approx(1 / 60, rel=1e-5)


@pytest.mark.parametrize("remedy", ["timestep", "armature"])
def test_stiff_servos_have_a_note_whose_remedies_end_it(remedy: str, tmp_path: Path):
    def notes(*given: str) -> list[str]:
        found = loaded(tmp_path, mjcf(motors=TORQUE_MOTORS), *given).notes
        return [one for one in found if "stiff" in one]

    stiff = ("kp=9e4", "kd=2")
    (note,) = notes(*stiff)
    before, after = note.split(f"{remedy}", maxsplit=1)
    number = float(re.findall(r"to ([\d.e-]+)", after)[0].rstrip("."))

    assert "left_hip, right_hip" in before.replace(" and ", ", ")
    assert notes(*GAINS) == []
    assert notes(*stiff, f"{remedy}={number}") == []


def test_a_motor_with_dynamics_stays(tmp_path: Path):
    left = '<general name="left" joint="left_hip" dyntype="filter" dynprm="1" ctrlrange="-1 2"/>'
    motors = left + TORQUE_MOTORS.splitlines()[1]
    model = loaded(tmp_path, mjcf(motors=motors), *GAINS).model

    assert model.actuator_gainprm[:, 0].tolist() == [1, 30]


@pytest.fixture(scope="module")
def servos(tmp_path_factory: pytest.TempPathFactory) -> mujoco.MjModel:
    folder = tmp_path_factory.mktemp("servos")
    return loaded(folder, mjcf(motors=TORQUE_MOTORS), *GAINS).model


@given(angle=st.floats(-0.5, 0.5), speed=st.floats(-3, 3), command=st.floats(-0.5, 0.5))
def test_the_torque_of_a_servo_is_that_of_its_gains(
    servos: mujoco.MjModel, angle: float, speed: float, command: float
):
    data = mujoco.MjData(servos)
    joint = servos.joint("right_hip")
    data.qpos[joint.qposadr[0]], data.qvel[joint.dofadr[0]] = angle, speed
    data.ctrl[1] = command
    mujoco.mj_forward(servos, data)

    expected = np.clip(30 * (command - angle) - 2 * speed, -7, 7)
    assert data.qfrc_actuator[joint.dofadr[0]] == pytest.approx(expected, abs=1e-9)


def test_attributes_of_a_class_do_not_change_a_servo(tmp_path: Path):
    text = mjcf(motors=TORQUE_MOTORS)
    plain = loaded(tmp_path, text, *GAINS).model
    of_class = loaded(tmp_path, text.replace("<mujoco>", f"<mujoco>{CLASS}"), *GAINS).model

    for field in ("gainprm", "biasprm", "gear", "ctrlrange", "forcerange", "dyntype"):
        name = f"actuator_{field}"
        assert np.array_equal(getattr(plain, name), getattr(of_class, name)), field


def test_a_joint_without_a_range_needs_the_reach(tmp_path: Path):
    text = mjcf(motors=TORQUE_MOTORS, legs=LEGS.replace('range="-40 40"', ""))

    with pytest.raises(InputError, match=r"range of the joint left_hip.*reach=0\.5"):
        loaded(tmp_path, text, *GAINS)
    model = loaded(tmp_path, text, *GAINS, "reach=0.5").model
    assert model.actuator_ctrlrange.tolist() == [[-0.5, 0.5], [-0.5, 0.5]]
    posed = text.replace("<mujoco>", f"<mujoco>{STANDING}")
    model = loaded(tmp_path, posed, *GAINS, "reach=0.5").model
    assert model.actuator_ctrlrange.ravel() == pytest.approx([-0.1, 0.9, -0.6, 0.4])


def test_one_gain_alone_is_refused(tmp_path: Path):
    with pytest.raises(InputError, match="expected kp and kd for the joint left_hip"):
        loaded(tmp_path, mjcf(motors=TORQUE_MOTORS), "kp=30")


SERVOS = """<position name="left" joint="left_hip" kp="5" inheritrange="1"/>
<position name="right" joint="right_hip" kp="5" ctrlrange="-.2 .6"/>"""
END = math.radians(40)


@pytest.mark.parametrize(
    ("motors", "more", "reach", "ranges"),
    [
        (SERVOS, STANDING, "0.5", [-0.1, END, -0.2, 0.4]),
        (re.sub("inheritrange.*/|ctrlrange.*/", "/", SERVOS), CLASS, "0.5", [-0.5, 0.5] * 2),
        (SERVOS, "", "{left_hip=0.1}", [-0.1, 0.1, -0.2, 0.6]),
        (SERVOS.replace("right_hip", 'right_hip" gear="2'), "", "0.1", [-0.1, 0.1, -0.2, 0.6]),
    ],
    ids=[
        "of a pose",
        "inherited by a class",
        "of one joint",
        "of no angle by a gear",
    ],
)
def test_commands_are_within_reach_of_the_initial_pose_and_in_their_range(
    motors: str, more: str, reach: str, ranges: list[float], tmp_path: Path
):
    text = mjcf(motors=motors).replace("<mujoco>", f"<mujoco>{more}")
    found = loaded(tmp_path, text, f"reach={reach}").model.actuator_ctrlrange

    assert found.ravel() == pytest.approx(ranges)


def test_one_number_is_for_all_joints_and_a_table_for_those_that_its_patterns_fit():
    settings = checked_settings({"kp": 40, "kd": {"*_knee": 2, "left_knee": 3}})

    assert value_of(settings.kp, "any") == 40.0
    assert [value_of(settings.kd, joint) for joint in ("left_knee", "right_knee", "hip")] == [
        3,
        2,
        None,
    ]


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"kp": -1}, "kp needs a number from above 0"),
        ({"kp": "stiff"}, "such as kp = 40"),
        ({"kp": 0}, "kp needs a number from above 0"),
        ({"reach": {"knee": 0}}, "reach needs a number from above 0"),
        ({"kd": {"knee": True}}, "got {'knee': True}"),
        ({"effort": float("inf")}, "effort needs a number"),
        ({"pose": 0.5}, "pose needs an angle"),
        ({"pose": {"knee": float("nan")}}, "pose needs an angle"),
        ({"pose": {"k" * 1000: 1}}, "pose needs an angle"),
        ({"kp": 10**400}, "kp needs a number"),
    ],
)
def test_other_values_are_refused_with_an_example(given: dict, sentence: str):
    with pytest.raises(InputError) as refusal:
        checked_settings(given)

    assert sentence in str(refusal.value)
    assert len(str(refusal.value)) < 1000


def test_the_effort_and_the_pose_are_refused_for_an_mjcf(tmp_path: Path):
    path = tmp_path / "robot.xml"
    path.write_text(mjcf())

    with pytest.raises(InputError, match="settings for a URDF"):
        load_mjcf(path, checked_settings({"effort": 10}))
