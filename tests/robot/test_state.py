"""Tests of the state: signals of sliding and fixed bases, known bases, control delays."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.spatial.transform import Rotation

from selfmodel.faults.hypothesis import INTACT
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import (
    BASE_SIGNALS,
    SlidingBase,
    bind_data,
    current_value,
    read_base,
    signal_fields,
    state_writer,
    with_known_base,
)
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import ROBOTS
from selfmodel.trials.trajectory import Trajectory, collect
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.calibration import late
from tests.helpers.drivers import random_controllers, random_cpgs
from tests.helpers.hostile import lacking
from tests.helpers.robots.arms import arm, arm_mjcf, robot_of

SLIDING = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <geom type="plane" size="0 0 1"/>
    <body name="torso" pos="{pos}" quat="{quat}">
      {joints}
      <geom size=".1"/>
      <body name="leg" pos="0 0 .3">
        <joint name="hip" axis="0 1 0" range="-1 1"/>
        <geom size=".1"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="hip" joint="hip" ctrlrange="-1 1"/></actuator>
  <sensor><jointpos name="angle" joint="hip"/></sensor>
</mujoco>
"""


def text(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)


def made(seed: int, slides: int, *, turns: bool) -> Robot:
    """Returns a robot whose base has random slide axes and a hinge beside its origin."""
    rng = np.random.default_rng(seed)
    joints = "".join(
        f'<joint name="s{k}" type="slide" axis="{text(rng.normal(size=3))}" ref="{rng.normal()}"/>'
        for k in range(slides)
    )
    if turns:
        joints += (
            f'<joint name="turn" axis="{text(rng.normal(size=3))}" '
            f'pos="{text(rng.normal(size=3))}" ref="{rng.normal()}"/>'
        )
    mjcf = SLIDING.format(
        pos=text(rng.normal(size=3)), quat=text(rng.normal(size=4)), joints=joints
    )
    return Robot("slider", mjcf, 0.002)


def anywhere(robot: Robot, seed: int) -> mujoco.MjData:
    rng = np.random.default_rng(seed + 1)
    data = mujoco.MjData(robot.model)
    data.qpos[:] = robot.model.qpos0 + rng.normal(size=robot.model.nq)
    data.qvel[:] = rng.normal(size=robot.model.nv)
    mujoco.mj_forward(robot.model, data)
    return data


SLIDERS = {"seed": st.integers(0, 2**32), "slides": st.integers(1, 3), "turns": st.booleans()}


@given(**SLIDERS)
def test_a_sliding_base_has_the_signals_of_its_body(seed: int, slides: int, turns: bool):  # noqa: FBT001 - drawn by hypothesis
    robot = made(seed, slides, turns=turns)
    data = anywhere(robot, seed)
    told = {signal: current_value(signal_fields(robot)[signal], data) for signal in BASE_SIGNALS}
    body = data.body("torso")
    velocity = np.empty(6)
    of_body = mujoco.mjtObj.mjOBJ_XBODY
    mujoco.mj_objectVelocity(robot.model, data, of_body, int(body.id), velocity, 1)

    assert isinstance(read_base([robot.model], "torso"), SlidingBase)
    np.testing.assert_allclose(told["base_position"], body.xpos, atol=1e-9)
    turned = Rotation.from_quat(told["base_orientation"], scalar_first=True).as_matrix()
    np.testing.assert_allclose(turned, body.xmat.reshape(3, 3), atol=1e-9)
    np.testing.assert_allclose(told["base_angular_velocity"], velocity[:3], atol=1e-9)
    np.testing.assert_allclose(told["base_linear_velocity"], turned @ velocity[3:], atol=1e-9)


@given(**SLIDERS)
def test_the_signals_of_a_sliding_base_restore_its_state(seed: int, slides: int, turns: bool):  # noqa: FBT001 - drawn by hypothesis
    robot = made(seed, slides, turns=turns)
    data, again = anywhere(robot, seed), mujoco.MjData(robot.model)
    told = {
        signal: current_value(signal_fields(robot)[signal], data)[np.newaxis]
        for signal in BASE_SIGNALS
    }
    state_writer(robot, bind_data(again))(told)

    for signal in ("base_position", "base_linear_velocity", "base_angular_velocity"):
        np.testing.assert_allclose(
            current_value(signal_fields(robot)[signal], again),
            told[signal][0],
            atol=1e-9,
            err_msg=signal,
        )
    turns_of = [
        current_value(signal_fields(robot)["base_orientation"], one) for one in (data, again)
    ]
    assert abs(turns_of[0] @ turns_of[1]) == pytest.approx(1, abs=1e-12)
    assert again.qpos[-1] == again.qvel[-1] == 0  # the hip was not told of


def test_motion_outside_the_degrees_of_freedom_is_dropped():
    joints = '<joint name="x" type="slide" axis="1 0 0"/><joint name="turn" axis="0 1 0"/>'
    robot = Robot("rail", SLIDING.format(pos="0 0 1", quat="1 0 0 0", joints=joints), 0.002)
    data = mujoco.MjData(robot.model)
    tilted = Rotation.from_rotvec([0.2, 0, 0.1]) * Rotation.from_rotvec([0, 0.4, 0])
    told = {
        "base_position": np.array([[3.0, 4.0, 5.0]]),
        "base_orientation": tilted.as_quat(scalar_first=True)[np.newaxis],
    }
    state_writer(robot, bind_data(data))(told)

    np.testing.assert_allclose(
        current_value(signal_fields(robot)["base_position"], data), [3, 0, 1]
    )
    assert data.qpos[1] == pytest.approx(0.4, abs=0.01)


@pytest.mark.parametrize("rows", [2, 3, 5, 8, 17])
def test_a_row_has_the_same_bits_in_any_batch(rows: int):
    robot = made(7, 3, turns=True)
    rng = np.random.default_rng(3)
    state = {"qpos": rng.normal(size=(17, robot.model.nq))}
    state["qvel"] = rng.normal(size=(17, robot.model.nv))
    for signal in BASE_SIGNALS:
        place = signal_fields(robot)[signal]
        whole = place(state.__getitem__)()
        part = place({name: rows_[17 - rows :] for name, rows_ in state.items()}.__getitem__)
        np.testing.assert_array_equal(part(), whole[17 - rows :])


def nested() -> Robot:
    """An arm on two static bodies, both displaced and turned."""
    outer = '<body name="table" pos="1 2 .5" euler="0 0 1.5707963267948966">{}</body>'
    inner = '<body name="foot" pos=".1 0 .2" euler="0.3 0 0">{arm}</body>'
    return robot_of(arm_mjcf(outer.format(inner)))


def test_the_root_is_the_static_body_nearest_to_the_driven_joints():
    assert nested().root == "foot"
    assert nested().has_fixed_base


def test_the_pose_of_the_base_is_that_of_its_body_and_its_velocities_are_zero():
    robot = nested()
    data = mujoco.MjData(robot.model)
    data.qpos[:], data.qvel[:] = 0.5, 1.0
    mujoco.mj_forward(robot.model, data)
    found = {name: current_value(field, data) for name, field in signal_fields(robot).items()}
    np.testing.assert_allclose(found["base_position"], data.body("foot").xpos, atol=1e-12)
    np.testing.assert_allclose(found["base_orientation"], data.body("foot").xquat, atol=1e-12)
    assert not any(found[signal].any() for signal in BASE_SIGNALS[2:])
    assert robot.standing_height == pytest.approx(0.7)


def trial_of(robot: Robot, steps: int = 200) -> Trial:
    (driver,) = random_cpgs(robot, 1)
    trajectory = collect(robot.anatomy.names, SimulatedRobot(robot).run(driver, steps))
    plan = TrialPlan("one", "before", driver, steps, seed=0)
    return Trial(plan, robot.name, trajectory, "one.mcap")


def test_the_unobserved_base_of_an_arm_is_that_of_its_model():
    trial = trial_of(arm())
    found = with_known_base(arm(), lacking(trial, BASE_SIGNALS).trajectory)
    for signal in BASE_SIGNALS:
        assert np.array_equal(found[signal], trial.trajectory[signal]), signal


def test_an_observed_base_and_a_floating_base_are_unchanged():
    trajectory = trial_of(arm()).trajectory
    moved = {**trajectory.signals, "base_position": trajectory["base_position"] + 0.01}
    seen = Trajectory(trajectory.names, trajectory.time, moved)
    assert np.array_equal(with_known_base(arm(), seen)["base_position"], seen["base_position"])
    floating = lacking(trial_of(ROBOTS["quadruped"].robot(), 20), BASE_SIGNALS).trajectory
    assert with_known_base(ROBOTS["quadruped"].robot(), floating) is floating


def test_a_delay_of_half_a_step_is_between_its_neighbours(quadruped: Robot):
    (controller,) = random_controllers(quadruped, 1)

    def moved(delay: float) -> np.ndarray:
        run = Simulator(late(quadruped, delay), 1).run(
            [(INTACT, controller)], 8, ["joint_positions"]
        )
        return run.trajectory["joint_positions"][0, 2]

    assert not np.array_equal(moved(0.5), moved(0))
    assert not np.array_equal(moved(0.5), moved(1))
