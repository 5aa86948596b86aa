"""Promises of the judgement: what it ranks, and how it names trials."""

import dataclasses

import pytest

from selfmodel.comparators import SEGMENT_PREDICTION
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.judgement import Question, judged
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.physical.simulated_robot import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial, TrialPlan
from selfmodel.trials.trial_names import trial_names
from tests.helpers.drivers import random_controllers
from tests.helpers.memory import in_memory

LAMED = "motor:front_left_knee=0.2"


def trial(robot: Robot, truth: str, path: str) -> Trial:
    """A trial of a damaged robot with the plan of an import, and a log of its own."""
    (gait,) = random_controllers(robot, 1)
    physical = SimulatedRobot(robot, parse(truth, robot.anatomy))
    run = in_memory(robot)(physical, TrialPlan("imported", "after", gait, 200, 0))
    return dataclasses.replace(run, path=path)


@pytest.fixture(scope="module")
def question(quadruped: Robot) -> Question:
    """Two trials of a robot, lame in the second, to explain with a trial of the healthy robot."""
    healthy = trial(quadruped, "intact", "healthy.mcap")
    trials = [trial(quadruped, "intact", "monday.mcap"), trial(quadruped, LAMED, "tuesday.mcap")]
    simulator = Simulator(quadruped, 1)
    search = DiagnosticSearch(simulator, SEGMENT_PREDICTION, Settings(), intact=[healthy])
    losses = search.evidence.losses
    return search._question(
        trials, trial_names(trials), lambda hypotheses: losses(hypotheses, trials)
    )


def test_the_worst_time_of_an_unexplained_diagnosis_names_the_file_of_its_trial(
    question: Question,
):
    found = judged(INTACT, [INTACT], question)

    assert found.verdict == "unexplained"
    assert found.residual is not None
    assert found.residual.trial == "tuesday"
