"""Scores and duty factors of gaits."""

import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.recovery.falls import falls_of
from selfmodel.recovery.repertoire import evaluation
from selfmodel.recovery.repertoire.evaluation import duty_factors, feet_of, simulated_evaluation
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import forward_displacement
from tests.helpers.drivers import random_controllers
from tests.helpers.robots.arms import arm

STEPS = 150


def test_a_duty_factor_is_the_part_of_the_steps_with_contact(quadruped: Robot):
    names = quadruped.anatomy.names.sensors
    readings = np.zeros((1, 4, len(names)))
    readings[0, :3, names.index("front_left_touch")] = 1
    readings[0, :1, names.index("back_right_touch")] = 1

    assert duty_factors(quadruped.anatomy, readings).tolist() == [[0.75, 0, 0, 0.25]]


def test_gaits_that_fall_or_go_backwards_have_no_score(quadruped: Robot):
    controllers = random_controllers(quadruped, 40, seed=1)
    simulator = Simulator(quadruped, 2)
    damaged = parse("break:front_left_shoulder+break:front_right_shoulder", quadruped.anatomy)
    scores, descriptors = simulated_evaluation(simulator, damaged, STEPS)(controllers)
    runs = [(damaged, one) for one in controllers]
    behaviour = simulator.run(runs, STEPS, evaluation.RECORD).behaviour
    walks = forward_displacement(behaviour)
    falls = falls_of(quadruped, damaged, behaviour) < STEPS

    assert falls.any()
    assert (~falls & (walks > 0)).any()
    assert np.array_equal(scores, np.where(falls | (walks <= 0), -np.inf, walks))
    assert np.array_equal(descriptors, duty_factors(quadruped.anatomy, behaviour["sensors"]))


def test_gaits_of_several_batches_keep_their_order(
    quadruped: Robot, monkeypatch: pytest.MonkeyPatch
):
    controllers = random_controllers(quadruped, 5)
    evaluate = simulated_evaluation(Simulator(quadruped, 2), INTACT, 30)
    whole = evaluate(controllers)
    monkeypatch.setattr(evaluation, "MAX_BATCH", 2)

    assert all(map(np.array_equal, whole, evaluate(controllers)))


def test_a_robot_without_feet_has_no_repertoire():
    with pytest.raises(InputError, match="needs the touch sensors of feet, and this robot has n"):
        feet_of(arm().anatomy)
