"""Promises of the calibration of joints: it finds what is wrong, and leaves alone what is right."""

import dataclasses
from functools import cache

import numpy as np
import pytest

from selfmodel.controllers.playback import played_back
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.joint_parameters import (
    JointParameters,
    joint_parameters,
    model_with_joint_parameters,
)
from selfmodel.robot.parameters import with_model
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration import Calibration, calibrate
from selfmodel.trials.behaviour import collect
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.robots.arms import robot_of

ARM = """
<mujoco model="arm">
  <compiler angle="radian"/>
  <option timestep="0.005" integrator="implicitfast"/>
  <default>
    <geom contype="0" conaffinity="0" type="capsule" size="0.03"/>
    <joint axis="0 1 0" range="-2 2" damping="0.3" armature="0.01" frictionloss="0.1"/>
    <position kp="20" kv="1" ctrlrange="-1.5 1.5" forcerange="-20 20"/>
  </default>
  <worldbody>
    <body name="base" pos="0 0 1">
      <geom type="box" size="0.05 0.05 0.05"/>
      <body name="upper"><joint name="shoulder"/><geom fromto="0 0 0 0.25 0 0"/>
        <body name="lower" pos="0.25 0 0"><joint name="elbow"/><geom fromto="0 0 0 0.2 0 0"/></body>
      </body>
    </body>
  </worldbody>
  <actuator><position name="a" joint="shoulder"/><position name="b" joint="elbow"/></actuator>
</mujoco>"""
TRUE = {
    "gain": np.array([0.85, 1.15]),
    "damping": np.array([0.5, 0.2]),
    "dry friction": np.array([0.3, 0.6]),
    "armature": np.array([0.03, 0.02]),
}
DELAY = 1.5
STEPS = 300
NOISE = 1e-3


@cache
def arm() -> Robot:
    return robot_of(ARM, control_timestep=0.01)


def truth() -> Robot:
    return with_model(arm(), model_with_joint_parameters(arm(), JointParameters(TRUE)), DELAY)


def trial(physical: Robot, noise: float) -> Trial:
    """A trial with joint positions and commands only."""
    rng, time = np.random.default_rng(1), np.arange(STEPS) * 0.01
    phase = 2 * np.pi * np.stack([time * (0.4 + 0.1 * time), time * (0.9 - 0.1 * time)], axis=1)
    commands = 0.7 * np.sin(phase) + 0.3 * np.sign(np.sin(2.7 * phase))
    driver = played_back(physical.anatomy.motors, commands)
    whole = collect(physical.anatomy.names, SimulatedRobot(physical).run(driver, STEPS))
    signals = {name: np.full_like(values, np.nan) for name, values in whole.signals.items()}
    signals["commands"] = whole["commands"]
    signals["joint_positions"] = whole["joint_positions"] + rng.normal(0, noise, (STEPS, 2))
    behaviour = dataclasses.replace(whole, signals=signals)
    return Trial(TrialPlan("arm", "before", driver, STEPS, 0), "arm", behaviour, "arm.mcap")


@cache
def fitted(threads: int = 1) -> Calibration:
    return calibrate(arm(), [trial(truth(), NOISE)], threads)


pytestmark = pytest.mark.search  # seconds of least squares


def test_the_delay_is_found_to_a_part_of_a_control_step():
    assert fitted().parameters.delay == DELAY
    assert fitted().robot.control_delay == DELAY


def test_every_joint_is_found_within_its_interval():
    joints = fitted().joints
    assert joints is not None
    assert joints.best.name == "kinds"  # as many as joints: the two differ
    for row in joints.rows():
        true = TRUE[row["quantity"]][("shoulder", "elbow", "a", "b").index(row["name"]) % 2]
        off = abs(np.log(row["value"] / true))
        assert off < 3 * row["deviation"] + 0.02, row


def test_the_error_falls_to_the_noise():
    joints = fitted().joints
    assert joints is not None
    assert joints.best.joint_errors.max() < 3 * NOISE  # the prior is felt
    assert joints.best.held_out_error < 0.2 * joints.nominal.held_out_error


def test_the_bits_do_not_depend_on_the_number_of_threads():
    assert fitted(1).robot.mjcf == fitted(2).robot.mjcf
    assert fitted(1).to_dict() == fitted(2).to_dict()


@pytest.mark.parametrize("noise", [0.0, NOISE])
def test_a_robot_whose_truth_is_nominal_stays_nominal_to_the_bit(noise: float):
    found = calibrate(arm(), [trial(arm(), noise)], 1)

    assert found.robot is arm()
    assert found.joints is not None
    assert found.joints.best.name == "nominal"
    before = joint_parameters(arm()).values
    assert all(
        np.array_equal(found.joints.parameters.values[quantity], values)
        for quantity, values in before.items()
    )
