"""Promises of an ensemble: each member is the robot of the hypothesis, a little different."""

import copy

import numpy as np
import pytest

from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import ALL_KINDS
from selfmodel.robot.robot import Robot
from selfmodel.robot.sensing import SensorNoise
from selfmodel.simulation.requests import Ensemble
from selfmodel.simulation.simulator import Simulator
from tests.helpers.drivers import random_controllers

RECORD = ("sensors", "joint_positions", "base_position")
STEPS = 40


@pytest.mark.parametrize("kind", ALL_KINDS, ids=lambda kind: kind.name)
def test_members_without_a_gap_do_what_the_hypothesis_does_to_the_bit(
    robot: Robot, kind: FaultKind
):
    hypotheses = [INTACT, Hypothesis(kind.candidates(robot.anatomy)[-1:])]
    (controller,) = random_controllers(robot, 1)
    simulator = Simulator(robot, 1)
    alone = simulator.run([(one, controller) for one in hypotheses], STEPS, RECORD).behaviour

    found = simulator.run_ensemble(hypotheses, controller, STEPS, Ensemble(RECORD, 2, 0.0))

    for signal in RECORD:
        for member in range(2):
            np.testing.assert_array_equal(found.behaviour[signal][:, member], alone[signal])


def test_rough_ground_is_rough_for_every_member(quadruped: Robot):
    """What is compiled into the model is there whatever else a member differs by."""
    (controller,) = random_controllers(quadruped, 1)
    rough = parse("roughness=0.04", quadruped.anatomy)
    ensemble = Ensemble(("base_position",), 3, 0.05)
    found = Simulator(quadruped, 1).run_ensemble([INTACT, rough], controller, 400, ensemble)
    level, bumpy = found.behaviour["base_position"]

    assert (np.abs(level[:, -1] - bumpy[:, -1]).max(axis=1) > 1e-3).all()


def test_a_hypothesis_has_diverged_if_any_of_its_members_has(quadruped: Robot):
    wild = copy.copy(quadruped.model)
    wild.opt.gravity[2] = -1e12
    simulator = Simulator(quadruped, 1)
    simulator._members = lambda shape, *_: (
        (quadruped.model, wild if shape == INTACT else quadruped.model)
    )
    (controller,) = random_controllers(quadruped, 1)
    rough = parse("roughness=0.04", quadruped.anatomy)
    ensemble = Ensemble(("base_position",), 2, 0.05)
    found = simulator.run_ensemble([INTACT, rough], controller, STEPS, ensemble)

    assert found.diverged.tolist() == [True, False]


def test_copies_of_a_robot_with_a_noisy_sensor_each_have_their_own_noise(quadruped: Robot):
    noisy = build(quadruped, parse("sensor:back_left_angle=noise0.3", quadruped.anatomy))
    readings = np.zeros((3, len(quadruped.anatomy.sensors)))
    SensorNoise([noisy], copies=3).add(readings)

    column = quadruped.anatomy.names.sensors.index("back_left_angle")
    assert len(set(readings[:, column])) == 3
    assert not np.delete(readings, column, axis=1).any()
