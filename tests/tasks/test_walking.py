"""Tests of the walking task on a file of a user, and of its measurements across a gap."""

from pathlib import Path

import gymnasium
import numpy as np
import pytest

import selfmodel
from selfmodel import tasks
from selfmodel.errors import InputError
from selfmodel.robot.anatomy import CONTROL_DELAY
from selfmodel.robot.robot import Robot
from selfmodel.simulation.reality_gap import DEBRIS_PREFIX
from selfmodel.tasks import walking

ANT = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets" / "ant.xml"
ARM = """
<mujoco>
  <worldbody>
    <body name="arm"><joint name="elbow" range="-90 90"/>
      <geom type="capsule" size=".1" fromto="0 0 1 0 0 2"/>
    </body>
  </worldbody>
  <actuator><motor joint="elbow" ctrlrange="-1 1"/></actuator>
</mujoco>
"""


def test_a_file_walks_like_its_robot_in_the_simulator():
    robot = selfmodel.load_robot(ANT)
    environment = tasks.load(ANT, "walk", {"hypothesis": f"break:{robot.anatomy.joints[-1].name}"})
    step = environment.reset()

    assert environment.control_timestep() == pytest.approx(robot.control_timestep)
    assert step.observation["sensors"].shape == (len(robot.anatomy.sensors),)
    data, position = environment.physics.data, environment.physics.data.qpos[0].copy()
    step = environment.step(environment.action_spec().maximum)
    assert step.reward == pytest.approx((data.qpos[0] - position) / robot.control_timestep)


def test_a_file_has_the_settings_beside_it(tmp_path: Path):
    (tmp_path / "ant.xml").write_bytes(ANT.read_bytes())
    (tmp_path / "ant.toml").write_text("control_timestep = 0.05\n")

    environment = tasks.load(str(tmp_path / "ant.xml"), "walk")
    assert environment.control_timestep() == pytest.approx(0.05)


def test_a_file_that_cannot_walk_is_refused_with_the_reason(tmp_path: Path):
    (tmp_path / "arm.xml").write_text(ARM)

    with pytest.raises(InputError, match="the base of arm is fixed: give the model a <freejoint/>"):
        tasks.load(str(tmp_path / "arm.xml"), "walk")
    with pytest.raises(InputError, match=r"unknown task of arm\.xml 'wlk': did you mean walk"):
        tasks.load("arm.xml", "wlk")
    with pytest.raises(InputError, match=r"none\.xml"):
        tasks.load(str(tmp_path / "none.xml"), "walk")


def test_a_gap_has_measurement_noise_and_the_reward_is_true():
    kwargs = {"gap": 0.05, "start_noise": 0.0, "random": 1}
    environment = tasks.load("quadruped", "walk", kwargs)
    first = environment.reset().observation
    truth = environment.physics.data.qpos.copy()
    second = environment.task.get_observation(environment.physics)

    for name in ("joint_positions", "base_orientation", "base_height"):
        assert not np.array_equal(first[name], second[name]), name
    before = environment.physics.data.qpos[0]
    step = environment.step(np.full(environment.action_spec().shape, 0.2))
    assert step.reward == pytest.approx((environment.physics.data.qpos[0] - before) / 0.01)
    assert truth[0] == before


def test_a_gap_has_the_debris_of_a_detached_limb_where_the_limb_was():
    kwargs = {"gap": 0.05, "hypothesis": "break:front_left_knee", "random": 1}
    environment = tasks.load("quadruped", "walk", kwargs)
    for _ in range(2):
        environment.reset()
        model, data = environment.physics.model, environment.physics.data
        names = [model.id2name(body, "body") for body in range(model.nbody)]
        (debris,) = [name for name in names if name.startswith(DEBRIS_PREFIX)]
        limb = names.index(debris.removeprefix(DEBRIS_PREFIX))
        np.testing.assert_allclose(data.xpos[names.index(debris)], data.xpos[limb], atol=1e-9)


def test_the_control_delay_of_a_calibrated_robot_delays_the_commands(quadruped: Robot):
    def delayed(steps: float) -> Robot:
        numeric = f'<custom><numeric name="{CONTROL_DELAY}" data="{steps}"/></custom></mujoco>'
        mjcf = quadruped.mjcf.replace("</mujoco>", numeric)
        return Robot("delayed", mjcf, quadruped.control_timestep)

    environment = walking.environment(delayed(1))
    environment.reset()
    applied = []
    for _ in range(3):
        environment.step(np.full(environment.action_spec().shape, 0.2))
        applied.append(environment.physics.data.ctrl[0])

    assert applied == [0, 0.2, 0.2]
    with pytest.raises(InputError, match=r"the control delay of delayed is 0\.5 of them"):
        walking.environment(delayed(0.5))
