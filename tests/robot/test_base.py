"""Tests of a sliding base: its signals are those of a free base, and can be written back."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.spatial.transform import Rotation

from selfmodel.robot.base import SlidingBase, read_base
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import bind_data, current_value, signal_fields, state_writer

MJCF = """
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
BASE = ("base_position", "base_orientation", "base_linear_velocity", "base_angular_velocity")


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
    mjcf = MJCF.format(pos=text(rng.normal(size=3)), quat=text(rng.normal(size=4)), joints=joints)
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
    told = {signal: current_value(signal_fields(robot)[signal], data) for signal in BASE}
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
        signal: current_value(signal_fields(robot)[signal], data)[np.newaxis] for signal in BASE
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


@given(seed=st.integers(0, 2**32))
def test_position_and_velocity_stay_if_only_the_rotation_is_written(seed: int):
    robot = made(seed, 3, turns=True)
    data, other = anywhere(robot, seed), anywhere(robot, seed + 5)
    where = [signal_fields(robot)[signal] for signal in ("base_position", "base_linear_velocity")]
    before = [current_value(place, data) for place in where]
    imu = {s: current_value(signal_fields(robot)[s], other)[np.newaxis] for s in (BASE[1], BASE[3])}
    state_writer(robot, bind_data(data))(imu)

    for place, was in zip(where, before, strict=True):
        np.testing.assert_allclose(current_value(place, data), was, atol=1e-9)
    np.testing.assert_allclose(
        current_value(signal_fields(robot)[BASE[3]], data), imu[BASE[3]][0], atol=1e-9
    )


def test_motion_outside_the_degrees_of_freedom_is_dropped():
    joints = '<joint name="x" type="slide" axis="1 0 0"/><joint name="turn" axis="0 1 0"/>'
    robot = Robot("rail", MJCF.format(pos="0 0 1", quat="1 0 0 0", joints=joints), 0.002)
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
    for signal in BASE:
        place = signal_fields(robot)[signal]
        whole = place.reader(state.__getitem__)()
        part = place.reader({name: rows_[17 - rows :] for name, rows_ in state.items()}.__getitem__)
        np.testing.assert_array_equal(part(), whole[17 - rows :])


def test_the_signals_of_a_free_base_are_views_of_the_state(quadruped: Robot):
    data = mujoco.MjData(quadruped.model)
    for signal in BASE:
        assert np.shares_memory(
            signal_fields(quadruped)[signal].reader(bind_data(data))(),
            data.qvel if "velocity" in signal else data.qpos,
        )
