"""Promises of domain randomisation: noise, initial poses and models that trials leave open."""

import dataclasses

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from selfmodel.controllers.playback import Playback
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.robot.robot import Robot
from selfmodel.simulation.domain import (
    ANGLE_DEVIATION,
    TILT_DEVIATION,
    DomainDistribution,
    StartSpread,
    draw_samples,
    randomize_initial_pose,
    randomize_joint_angles,
    start_spread,
)
from selfmodel.simulation.model_factors import LogNormal, exact
from selfmodel.simulation.simulator import Simulator
from tests.helpers.calibration import late
from tests.helpers.drivers import random_controllers

STEPS = 60
RECORD = ("base_position", "sensors", "joint_positions")


def certain(robot: Robot) -> DomainDistribution:
    nothing = np.zeros(len(robot.anatomy.sensors))
    return DomainDistribution(exact(robot), nothing, nothing, StartSpread(0.0, 0.0))


def uncertain(robot: Robot) -> DomainDistribution:
    touch = np.array([sensor.kind == "touch" for sensor in robot.anatomy.sensors])
    return DomainDistribution(
        LogNormal(np.full(4 + robot.model.nu, 0.1), np.full(robot.model.nbody, 0.1)),
        np.where(touch, 0.0, 0.1),
        np.where(touch, 0.05, 0.0),
        StartSpread(0.02, 0.01),
        delays=(0, 2),
    )


def test_a_robot_without_uncertainty_is_the_self_model_to_the_bit(robot: Robot):
    simulator, drivers = Simulator(robot, 1), random_controllers(robot, 2)
    hypothesis = parse(f"jam:{robot.anatomy.joints[0].name}", robot.anatomy)
    drawn = draw_samples((hypothesis,), certain(robot), 2, np.random.default_rng(0))
    outcome = simulator.run_under(drawn, certain(robot), drivers, STEPS, RECORD)
    expected = simulator.run([(hypothesis, driver) for driver in drivers], STEPS, RECORD)

    assert outcome.diverged.shape == (2, 2)
    for signal in RECORD:
        for column in range(2):
            np.testing.assert_array_equal(
                outcome.trajectory[signal][:, column], expected.trajectory[signal]
            )


def test_a_rollout_has_the_same_bits_in_any_batch_and_at_any_number_of_threads(robot: Robot):
    drivers, unknown = random_controllers(robot, 3), uncertain(robot)
    drawn = draw_samples((INTACT,), unknown, 4, np.random.default_rng(1))
    many = Simulator(robot, 2).run_under(drawn, unknown, drivers, STEPS, RECORD)
    alone = Simulator(robot, 1).run_under(drawn[2:3], unknown, drivers[1:2], STEPS, RECORD)

    for signal in RECORD:
        np.testing.assert_array_equal(many.trajectory[signal][1, 2], alone.trajectory[signal][0, 0])


def test_conditions_are_common_to_all_controllers_and_differ_from_each_other(quadruped: Robot):
    (driver,), unknown = random_controllers(quadruped, 1), uncertain(quadruped)
    drawn = draw_samples((INTACT,), unknown, 3, np.random.default_rng(2))
    outcome = Simulator(quadruped, 1).run_under(drawn, unknown, [driver] * 2, STEPS, RECORD)

    for signal in RECORD:
        first, second = outcome.trajectory[signal]
        np.testing.assert_array_equal(first, second)
    starts = outcome.trajectory["joint_positions"][0, :, 0]
    assert len(np.unique(starts, axis=0)) == 3


def test_readings_have_the_noise_of_the_uncertainty(quadruped: Robot):
    touch = np.array([sensor.kind == "touch" for sensor in quadruped.anatomy.sensors])
    unknown = dataclasses.replace(
        certain(quadruped),
        reading_noise=np.where(touch, 0.0, 0.1),
        wrong_touches=np.where(touch, 0.05, 0.0),
    )
    still = Playback(quadruped.anatomy.names.motors, np.zeros((400, len(quadruped.anatomy.motors))))
    drawn = draw_samples((INTACT,), unknown, 8, np.random.default_rng(3))
    simulator = Simulator(quadruped, 1)
    noisy = simulator.run_under(drawn, unknown, [still], 400, ("sensors",)).trajectory["sensors"][0]
    clean = simulator.run([(INTACT, still)], 400, ("sensors",)).trajectory["sensors"][0]
    error = noisy - clean

    np.testing.assert_allclose(error[..., ~touch].std(axis=(0, 1)), 0.1, rtol=0.1)
    np.testing.assert_allclose((error[..., touch] != 0).mean(axis=(0, 1)), 0.05, rtol=0.4)
    assert set(np.unique(noisy[..., touch])) == {0.0, 1.0}


def test_a_dead_sensor_has_no_noise(quadruped: Robot):
    dead = parse("sensor:front_left_angle+sensor:back_left_touch", quadruped.anatomy)
    columns = [
        quadruped.anatomy.names.sensors.index(name)
        for name in ("front_left_angle", "back_left_touch")
    ]
    drawn = draw_samples((dead,), uncertain(quadruped), 2, np.random.default_rng(4))
    outcome = Simulator(quadruped, 1).run_under(
        drawn, uncertain(quadruped), random_controllers(quadruped, 1), STEPS, ("sensors",)
    )

    assert not outcome.trajectory["sensors"][..., columns].any()


def test_the_noise_of_a_faulty_sensor_differs_between_conditions(quadruped: Robot):
    noisy = parse("sensor:front_left_angle=noise0.3", quadruped.anatomy)
    column = quadruped.anatomy.names.sensors.index("front_left_angle")
    unknown = dataclasses.replace(certain(quadruped), start=StartSpread(1e-9, 0.0))
    drawn = draw_samples((noisy,), unknown, 3, np.random.default_rng(7))
    still = Playback(quadruped.anatomy.names.motors, np.zeros((5, len(quadruped.anatomy.motors))))
    outcome = Simulator(quadruped, 1).run_under(drawn, unknown, [still], 5, ("sensors",))

    readings = outcome.trajectory["sensors"][0, :, 0, column]
    assert len(set(readings.round(4).tolist())) == 3


def test_hypotheses_that_cannot_be_told_apart_are_simulated_in_turn(quadruped: Robot):
    alike = [parse(text, quadruped.anatomy) for text in ("intact", "friction=0.5", "wind=3")]
    rng = np.random.default_rng(5)
    drawn = draw_samples(alike, uncertain(quadruped), 6, rng)

    assert [own.hypothesis for own in drawn[:3]] == [own.hypothesis for own in drawn[3:]]
    assert {own.hypothesis for own in drawn} == set(alike)
    firsts = {draw_samples(alike, certain(quadruped), 1, rng)[0].hypothesis for _ in range(40)}
    assert firsts == set(alike)


def test_an_added_delay_makes_commands_arrive_later(quadruped: Robot):
    delay = 2
    delayed = dataclasses.replace(certain(quadruped), delays=(delay,))
    (condition,) = draw_samples((INTACT,), delayed, 1, np.random.default_rng(6))

    assert condition.variant(quadruped).added_delay.tolist() == [delay]
    (driver,) = random_controllers(quadruped, 1)
    outcome = Simulator(quadruped, 1).run_under([condition], delayed, [driver], STEPS, RECORD)
    expected = Simulator(late(quadruped, delay), 1).run([(INTACT, driver)], STEPS, RECORD)
    np.testing.assert_allclose(
        outcome.trajectory["joint_positions"][0], expected.trajectory["joint_positions"], atol=1e-3
    )


def started(
    robot: Robot, level: float, seed: int, text: str = "intact"
) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = build(robot, parse(text, robot.anatomy)).model
    data = mujoco.MjData(model)
    randomize_initial_pose(robot, data, start_spread(level), np.random.default_rng(seed))
    mujoco.mj_forward(model, data)
    return model, data


def test_starts_spread_around_the_reference_pose(quadruped: Robot):
    level, draws = 0.1, 100
    poses = np.array([started(quadruped, level, seed)[1].qpos for seed in range(draws)])
    angles = poses[:, 7:]  # beyond the free joint
    tilts = Rotation.from_quat(poses[:, 3:7], scalar_first=True).as_rotvec()

    spread = level * ANGLE_DEVIATION
    np.testing.assert_allclose(angles.std(axis=0), spread, rtol=0.25)
    np.testing.assert_allclose(angles.mean(axis=0), 0, atol=5 * spread / draws**0.5)
    np.testing.assert_allclose(tilts[:, :2].std(axis=0), level * TILT_DEVIATION, rtol=0.25)
    np.testing.assert_allclose(tilts[:, 2], 0, atol=1e-9)
    np.testing.assert_array_equal(poses[:, :2], 0)


def test_no_start_is_deeper_in_the_ground_or_bent_further_than_the_robot_can_be(robot: Robot):
    _, reference = started(robot, 0.0, 0)
    heights = []
    for seed, level in enumerate(np.linspace(0, 0.5, 20)):
        model, data = started(robot, level, seed)
        heights.append(data.qpos[2])

        assert data.contact.dist.min(initial=1) >= reference.contact.dist.min() - 1e-9
        for hinge in robot.anatomy.hinges:
            low, high = model.joint(hinge).range
            assert low <= data.joint(hinge).qpos[0] <= high
        assert not data.qvel.any()
        randomize_joint_angles(robot.anatomy, model, data, 2.0, np.random.default_rng(seed))
        angles = [float(data.joint(hinge).qpos[0]) for hinge in robot.anatomy.hinges]
        limits = np.array([model.joint(hinge).range for hinge in robot.anatomy.hinges]).T
        assert ((limits[0] <= angles) & (angles <= limits[1])).all()
    assert min(heights) >= reference.qpos[2]
    assert max(heights) > reference.qpos[2] + 0.005  # some had to be lifted


@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_a_held_joint_starts_where_it_is_held(robot: Robot, angle: float):
    joint = robot.anatomy.joints[0]
    _, data = started(robot, 0.5, 0, f"jam:{joint.name}={angle}")

    for hinge in joint.hinges:
        assert data.joint(hinge).qpos[0] == angle
