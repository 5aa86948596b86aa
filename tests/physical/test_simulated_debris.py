"""Promises of debris: a limb that fell off lies about, and changes nothing else of the robot."""

import mujoco
import numpy as np
import pytest

from selfmodel.faults.notation import parse
from selfmodel.physical.gap import draw_gap
from selfmodel.physical.simulated import SimulatedRobot, place_debris
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import signal_fields
from selfmodel.simulation.reality_gap import DEBRIS_PREFIX
from selfmodel.tasks import ROBOTS
from tests.helpers.drivers import random_controllers

JOINTS = [
    (name, joint.name)
    for name, entry in ROBOTS.items()
    for joint in entry.robot().anatomy.joints
    if joint.name.startswith(("front_left", "back_right"))
]
LEVEL = 0.05


def broken(robot: Robot, text: str, level: float = LEVEL) -> SimulatedRobot:
    gap = draw_gap(robot, level, np.random.default_rng(1))
    return SimulatedRobot(robot, parse(text, robot.anatomy), gap)


def left_alone(
    physical: SimulatedRobot, seconds: float
) -> tuple[mujoco.MjModel, mujoco.MjData, list[np.ndarray]]:
    """Lets a physical robot stand with its motors at 0, and returns where its debris went."""
    model = physical._embodiment.model
    data = mujoco.MjData(model)
    seen: list[np.ndarray] = []
    pieces = [b for b in range(model.nbody) if model.body(b).name.startswith(DEBRIS_PREFIX)]
    place_debris(model, data, physical._limbs)
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        seen.append(data.xipos[pieces].copy())
    return model, data, seen


@pytest.mark.parametrize(("name", "joint"), JOINTS)
def test_a_lost_limb_falls_where_it_was_and_comes_to_rest_on_the_ground(name: str, joint: str):
    robot = ROBOTS[name].robot()
    lost = robot.anatomy.joint(joint).bodies
    model, data, seen = left_alone(broken(robot, f"break:{joint}"), 4.0)
    nominal = mujoco.MjData(robot.model)
    mujoco.mj_forward(robot.model, nominal)
    order = [
        model.body(b).name.removeprefix(DEBRIS_PREFIX)
        for b in range(model.nbody)
        if model.body(b).name.startswith(DEBRIS_PREFIX)
    ]

    assert set(order) == lost
    began = np.array([nominal.body(body).xipos for body in order])
    # After the first physics step of the fall.
    np.testing.assert_allclose(seen[0], began, atol=2e-3)
    assert np.linalg.norm(seen[-1][:, :2] - began[:, :2], axis=1).max() < 0.5
    assert seen[-1][:, 2].max() < 0.25
    assert seen[-1][:, 2].min() > 0
    speed = np.linalg.norm(seen[-1] - seen[-11], axis=1).max() / (10 * model.opt.timestep)
    assert speed < 0.1
    touching = {
        frozenset(model.body(model.geom_bodyid[g]).name for g in pair) for pair in data.contact.geom
    }
    assert any("world" in pair and (pair & {DEBRIS_PREFIX + b for b in lost}) for pair in touching)


@pytest.mark.parametrize(("name", "joint"), JOINTS)
def test_nothing_is_thrown_as_a_limb_falls_off(name: str, joint: str):
    """In the first fifth of a second, nothing is faster than by free fall and a little."""
    robot = ROBOTS[name].robot()
    _, _, seen = left_alone(broken(robot, f"break:{joint}"), 0.2)
    path = np.array(seen)
    speeds = np.linalg.norm(np.diff(path, axis=0), axis=2) / robot.model.opt.timestep

    assert speeds.max() < 9.81 * 0.2 + 0.5


@pytest.mark.parametrize("name", sorted(ROBOTS))
def test_debris_stands_behind_all_that_is_the_robots(name: str):
    robot = ROBOTS[name].robot()
    joints = [joint.name for joint in robot.anatomy.joints if len(joint.bodies) > 1][:2]
    text = "+".join(f"break:{joint}" for joint in joints)
    model = broken(robot, text)._embodiment.model

    assert signal_fields(robot, model) == signal_fields(robot)
    assert (model.nu, model.nsensor) == (robot.model.nu, robot.model.nsensor)
    for b in range(robot.model.nbody):
        assert model.body(b).name == robot.model.body(b).name
    added = [model.body(b).name for b in range(robot.model.nbody, model.nbody)]
    assert len(added) == 4
    assert all(body.startswith(DEBRIS_PREFIX) for body in added)


def test_debris_is_as_heavy_as_the_limb_was_and_collides_with_the_ground_and_the_robot(
    quadruped: Robot,
):
    gap = draw_gap(quadruped, LEVEL, np.random.default_rng(1))
    model = broken(quadruped, "break:front_left_shoulder")._embodiment.model
    for body in ("front_left_upper", "front_left_lower"):
        np.testing.assert_allclose(
            model.body(DEBRIS_PREFIX + body).mass, quadruped.model.body(body).mass * gap.mass[body]
        )
        assert model.body(body).mass == 0
    debris = model.geom(DEBRIS_PREFIX + "front_left_lower")
    for other in ("ground", "torso", "back_left_lower"):
        geom = model.geom(other)
        assert debris.contype & geom.conaffinity or geom.contype & debris.conaffinity
    ghost = model.geom("front_left_lower")
    assert not ghost.contype
    assert not ghost.conaffinity


def test_there_is_debris_only_where_a_limb_fell_off_across_a_gap(quadruped: Robot):
    for text, level in [
        ("break:front_left_knee", 0.0),
        ("jam:front_left_knee", LEVEL),
        ("sensor:front_left_touch", LEVEL),
        ("intact", LEVEL),
    ]:
        model = broken(quadruped, text, level)._embodiment.model
        assert model.nbody == quadruped.model.nbody


def test_debris_does_not_pass_through_the_robot(quadruped: Robot):
    model = broken(quadruped, "break:front_left_knee")._embodiment.model
    data = mujoco.MjData(model)
    data.joint(DEBRIS_PREFIX + "front_left_lower").qpos[:3] = [0, 0, 0.5]
    mujoco.mj_step(model, data, 80)

    # By then it would have fallen 0.78 m.
    assert data.body(DEBRIS_PREFIX + "front_left_lower").xpos[2] > data.body("torso").xpos[2]


def test_in_a_trial_debris_starts_where_the_limb_is_however_the_robot_stands(
    quadruped: Robot, monkeypatch: pytest.MonkeyPatch
):
    starts = []

    def watched(model: mujoco.MjModel, data: mujoco.MjData, limbs: tuple[str, ...]) -> None:
        place_debris(model, data, limbs)
        starts.append(data)

    monkeypatch.setattr("selfmodel.physical.simulated.place_debris", watched)
    physical = broken(quadruped, "break:front_left_shoulder", 0.3)
    (controller,) = random_controllers(quadruped, 1)
    next(iter(physical.run(controller, 3)))
    mujoco.mj_forward(physical._embodiment.model, starts[-1])
    for body in ("front_left_upper", "front_left_lower"):
        lost, left = starts[-1].body(DEBRIS_PREFIX + body), starts[-1].body(body)
        np.testing.assert_allclose(lost.xpos, left.xpos, atol=1e-9)
        np.testing.assert_allclose(lost.xmat, left.xmat, atol=1e-9)
    assert starts[-1].joint("front_left_knee").qpos[0] != 0
