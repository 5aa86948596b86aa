"""The score of a diagnosis: correct if it predicts what the truth predicts."""

import numpy as np

from selfmodel.controllers.controller import Controller
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.studies.experiment import is_correct
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.drivers import random_controllers
from tests.helpers.memory import in_memory


def logged(robot: Robot, truth: str, controller: Controller) -> Trial:
    """A trial of a damaged robot."""
    physical = SimulatedRobot(robot, parse(truth, robot.anatomy))
    return in_memory(robot)(physical, TrialPlan(truth, "after", controller, 300, 0))


def test_a_diagnosis_is_correct_if_it_cannot_be_told_from_the_truth(quadruped: Robot):
    simulator = Simulator(quadruped, 2)
    deaf = Controller(network_for(quadruped), np.zeros(network_for(quadruped).weights))
    (awake,) = random_controllers(quadruped, 1)
    truth = parse("neuron:0", quadruped.anatomy)

    asleep = [logged(quadruped, "neuron:0", deaf)]
    assert is_correct(INTACT, truth, asleep, simulator)  # its neurons do nothing anyway
    assert not is_correct(INTACT, truth, [*asleep, logged(quadruped, "neuron:0", awake)], simulator)
    assert is_correct(truth, truth, [logged(quadruped, "neuron:0", awake)], simulator)
