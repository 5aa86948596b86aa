"""Promises of rollouts under conditions: noise, initial poses and models that trials leave open."""

import dataclasses

import numpy as np
import pytest

from selfmodel.controllers.playback import Playback
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.robot.robot import Robot
from selfmodel.simulation.domain import DomainDistribution, StartSpread, draw_samples
from selfmodel.simulation.model_factors import LogNormal, exact, nominal, with_parameters
from selfmodel.simulation.simulator import Simulator
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
                outcome.behaviour[signal][:, column], expected.behaviour[signal]
            )


def test_a_rollout_has_the_same_bits_in_any_batch_and_at_any_number_of_threads(robot: Robot):
    drivers, unknown = random_controllers(robot, 3), uncertain(robot)
    drawn = draw_samples((INTACT,), unknown, 4, np.random.default_rng(1))
    many = Simulator(robot, 2).run_under(drawn, unknown, drivers, STEPS, RECORD)
    alone = Simulator(robot, 1).run_under(drawn[2:3], unknown, drivers[1:2], STEPS, RECORD)

    for signal in RECORD:
        np.testing.assert_array_equal(many.behaviour[signal][1, 2], alone.behaviour[signal][0, 0])


def test_conditions_are_common_to_all_controllers_and_differ_from_each_other(quadruped: Robot):
    (driver,), unknown = random_controllers(quadruped, 1), uncertain(quadruped)
    drawn = draw_samples((INTACT,), unknown, 3, np.random.default_rng(2))
    outcome = Simulator(quadruped, 1).run_under(drawn, unknown, [driver] * 2, STEPS, RECORD)

    for signal in RECORD:
        first, second = outcome.behaviour[signal]
        np.testing.assert_array_equal(first, second)
    starts = outcome.behaviour["joint_positions"][0, :, 0]
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
    noisy = simulator.run_under(drawn, unknown, [still], 400, ("sensors",)).behaviour["sensors"][0]
    clean = simulator.run([(INTACT, still)], 400, ("sensors",)).behaviour["sensors"][0]
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

    assert not outcome.behaviour["sensors"][..., columns].any()


def test_the_noise_of_a_faulty_sensor_differs_between_conditions(quadruped: Robot):
    noisy = parse("sensor:front_left_angle=noise0.3", quadruped.anatomy)
    column = quadruped.anatomy.names.sensors.index("front_left_angle")
    unknown = dataclasses.replace(certain(quadruped), start=StartSpread(1e-9, 0.0))
    drawn = draw_samples((noisy,), unknown, 3, np.random.default_rng(7))
    still = Playback(quadruped.anatomy.names.motors, np.zeros((5, len(quadruped.anatomy.motors))))
    outcome = Simulator(quadruped, 1).run_under(drawn, unknown, [still], 5, ("sensors",))

    readings = outcome.behaviour["sensors"][0, :, 0, column]
    assert len(set(readings.round(4).tolist())) == 3


def test_a_robot_without_sensors_has_conditions(quadruped: Robot):
    spec = quadruped.specification()
    for sensor in list(spec.sensors):
        spec.delete(sensor)
    bare = Robot("bare", spec.to_xml(), quadruped.control_timestep)
    drawn = draw_samples((INTACT,), uncertain(bare), 2, np.random.default_rng(0))
    outcome = Simulator(bare, 1).run_under(
        drawn, uncertain(bare), random_controllers(bare, 1), STEPS, ("sensors",)
    )

    assert outcome.behaviour["sensors"].shape == (1, 2, STEPS, 0)


def test_hypotheses_that_cannot_be_told_apart_are_simulated_in_turn(quadruped: Robot):
    alike = [parse(text, quadruped.anatomy) for text in ("intact", "friction=0.5", "wind=3")]
    rng = np.random.default_rng(5)
    drawn = draw_samples(alike, uncertain(quadruped), 6, rng)

    assert [own.hypothesis for own in drawn[:3]] == [own.hypothesis for own in drawn[3:]]
    assert {own.hypothesis for own in drawn} == set(alike)
    firsts = {draw_samples(alike, certain(quadruped), 1, rng)[0].hypothesis for _ in range(40)}
    assert firsts == set(alike)


@pytest.mark.parametrize("delay", [0, 2])
def test_an_added_delay_makes_commands_arrive_later(quadruped: Robot, delay: int):
    late = dataclasses.replace(certain(quadruped), delays=(delay,))
    (condition,) = draw_samples((INTACT,), late, 1, np.random.default_rng(6))

    assert condition.embodiment(quadruped).added_delay.tolist() == [delay]
    slow = with_parameters(quadruped, dataclasses.replace(nominal(quadruped), delay=delay))
    (driver,) = random_controllers(quadruped, 1)
    outcome = Simulator(quadruped, 1).run_under([condition], late, [driver], STEPS, RECORD)
    expected = Simulator(slow, 1).run([(INTACT, driver)], STEPS, RECORD)
    np.testing.assert_allclose(
        outcome.behaviour["joint_positions"][0], expected.behaviour["joint_positions"], atol=1e-3
    )
