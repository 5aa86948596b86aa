"""Tests of servo commands that are limited to the neighbourhood of the initial pose."""

import math
from pathlib import Path

import pytest

from selfmodel.errors import InputError
from tests.robot.mjcf.awkward import KEY, mjcf
from tests.robot.mjcf.test_motors_servos import CLASS, TORQUE_MOTORS, loaded

SERVOS = """<position name="left" joint="left_hip" kp="5" inheritrange="1"/>
<position name="right" joint="right_hip" kp="5" ctrlrange="-.2 .6"/>"""
END = math.radians(40)


def test_commands_are_within_reach_of_the_initial_pose_and_in_their_range(tmp_path: Path):
    key = KEY.format("0 0 .35 1 0 0 0 .4 -.1")
    model = loaded(tmp_path, mjcf(motors=SERVOS, more=key), "reach=0.5")

    assert model.actuator_ctrlrange.ravel() == pytest.approx([-0.1, END, -0.2, 0.4])


def test_a_range_that_a_class_inherits_from_the_joint_is_limited(tmp_path: Path):
    text = mjcf(motors=SERVOS.replace('inheritrange="1"', "").replace('ctrlrange="-.2 .6"', ""))
    text = text.replace("<mujoco>", f"<mujoco>{CLASS}")
    model = loaded(tmp_path, text, "reach=0.5")

    assert model.actuator_ctrlrange.ravel() == pytest.approx([-0.5, 0.5, -0.5, 0.5])


def test_only_joints_that_the_patterns_fit_are_limited(tmp_path: Path):
    model = loaded(tmp_path, mjcf(motors=SERVOS), "reach={left_hip=0.1}")

    assert model.actuator_ctrlrange.ravel() == pytest.approx([-0.1, 0.1, -0.2, 0.6])


def test_an_initial_pose_outside_the_range_counts_as_the_nearest_end(tmp_path: Path):
    motors = SERVOS.replace("-.2 .6", ".3 .6")
    model = loaded(tmp_path, mjcf(motors=motors), "reach=0.1")

    assert model.actuator_ctrlrange.ravel() == pytest.approx([-0.1, 0.1, 0.3, 0.4])


def test_torques_have_no_reach(tmp_path: Path):
    with pytest.raises(InputError, match="expected a position servo of a hinge for reach"):
        loaded(tmp_path, mjcf(motors=TORQUE_MOTORS), "reach=0.5")


def test_a_servo_with_a_gear_has_no_reach_because_its_command_is_no_angle(tmp_path: Path):
    motors = SERVOS.replace('name="right"', 'name="right" gear="2"')
    model = loaded(tmp_path, mjcf(motors=motors), "reach=0.1")

    assert model.actuator_ctrlrange.ravel() == pytest.approx([-0.1, 0.1, -0.2, 0.6])


@pytest.mark.parametrize("setting", ["reach=0", "reach=far", "reach={left_hip=-1}"])
def test_an_invalid_reach_is_refused(setting: str, tmp_path: Path):
    with pytest.raises(InputError, match="reach needs"):
        loaded(tmp_path, mjcf(motors=TORQUE_MOTORS), setting)
