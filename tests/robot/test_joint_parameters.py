"""Promises of the parameters of joints: nominal ones change nothing, the MJCF has all of them."""

import numpy as np

from selfmodel.robot.joint_parameters import (
    QUANTITIES,
    changed,
    joint_of_motor,
    joint_parameters,
    kinds_of_joints,
    model_with_joint_parameters,
    names_of,
)
from selfmodel.robot.parameters import with_model
from selfmodel.robot.robot import Robot
from tests.helpers.robots.arms import arm

FIELDS = ("dof_damping", "dof_frictionloss", "dof_armature", "actuator_gainprm", "actuator_biasprm")


def logarithms(robot: Robot, value: float) -> dict[str, np.ndarray]:
    return {q: np.full(len(names_of(robot, q)), value) for q in QUANTITIES}


def test_logarithms_of_zero_change_nothing():
    robot = arm()
    same = model_with_joint_parameters(robot, changed(robot, logarithms(robot, 0.0)))

    assert all(getattr(same, f).tobytes() == getattr(robot.model, f).tobytes() for f in FIELDS)


def test_a_parameter_is_scaled_and_one_that_is_zero_is_increased():
    robot = arm()
    before = joint_parameters(robot).values
    values = changed(robot, logarithms(robot, np.log(2))).values

    np.testing.assert_allclose(values["damping"], 2 * before["damping"])
    np.testing.assert_allclose(values["gain"], 2)
    assert not before["dry friction"].any()
    assert (values["dry friction"] > 0).all()
    assert not changed(robot, logarithms(robot, -1.0)).values["dry friction"].any()


def test_the_mjcf_contains_the_parameters_and_a_delay_of_a_part_of_a_step():
    robot = arm()
    model = model_with_joint_parameters(robot, changed(robot, logarithms(robot, 0.3)))
    said = with_model(robot, model, 1.5 if robot.substeps % 2 == 0 else 1)

    assert said.control_delay in (1, 1.5)
    for field in FIELDS:
        np.testing.assert_allclose(getattr(said.model, field), getattr(model, field), rtol=1e-5)


def test_legs_of_one_shape_have_the_same_kinds_of_joints(quadruped: Robot):
    kinds = kinds_of_joints(quadruped)

    assert len(set(kinds.tolist())) < len(kinds)
    assert sorted(joint_of_motor(quadruped).tolist()) == list(range(8))
    assert len(set(kinds_of_joints(arm()).tolist())) == 6
