"""Promises of the judgement: what it ranks, and how it names trials."""

import dataclasses
from collections.abc import Callable, Iterable
from functools import partial

import numpy as np
import pytest

from selfmodel.comparators import SEGMENT_PREDICTION
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.diagnosis.losses import LossTable
from selfmodel.diagnosis.problem import Problem
from selfmodel.diagnosis.verdict import WINDOW, judged, ranked_by_distance
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial, TrialPlan, trial_names
from tests.helpers.drivers import random_controllers
from tests.helpers.memory import in_memory

KNEE, SHOULDER = "front_left_knee", "back_right_shoulder"
LAME = f"motor:{KNEE}=0.2"
OF_ONE_SET = (
    (LAME, f"motor:{KNEE}=0.21", f"motor:{KNEE}=0.9"),
    (f"motor:{SHOULDER}=0.5", f"motor:{SHOULDER}=0.6", f"motor:{SHOULDER}=0.0"),
    (f"jam:{SHOULDER}", f"jam:{SHOULDER}=0.4"),
    (f"break:{SHOULDER}+{LAME}", f"break:{SHOULDER}+motor:{KNEE}=0.3"),
    ("intact",),
)
"""Hypotheses that differ in severities alone, or not at all; the first set is the truth's."""


def trial(robot: Robot, truth: str, path: str) -> Trial:
    """A trial of a damaged robot with the plan of an import, and a log of its own."""
    (gait,) = random_controllers(robot, 1)
    physical = SimulatedRobot(robot, parse(truth, robot.anatomy))
    run = in_memory(robot)(physical, TrialPlan("imported", "after", gait, 200, 0))
    return dataclasses.replace(run, path=path)


def problem_of(robot: Robot, *trials: Trial) -> Problem:
    """The problem of some trials, with a trial of the healthy robot."""
    healthy = trial(robot, "intact", "healthy.mcap")
    table = LossTable(Simulator(robot, 1), SEGMENT_PREDICTION)
    return Problem(
        table,
        HypothesisSpace.of(PAPER_KINDS, robot.anatomy),
        trials,
        surrogate=table.surrogate(trials),
        healthy_trials=[healthy],
        names=trial_names(trials),
        settings=Settings(),
    )


def parsed(robot: Robot) -> list[list[Hypothesis]]:
    return [[parse(one, robot.anatomy) for one in some] for some in OF_ONE_SET]


def nearest(sets: Iterable[list[Hypothesis]], problem: Problem) -> set[Hypothesis]:
    """The hypothesis of each set with the smallest distance."""
    distances = partial(problem.table.distances, trials=problem.trials)
    return {some[int(np.argmin(distances(some)))] for some in sets}


def judged_truth(found: Iterable[Hypothesis], problem: Problem) -> Diagnosis:
    """The judgement of a search that ended at the truth."""
    return judged(parse(LAME, problem.space.anatomy), found, problem)


@pytest.mark.parametrize("judge", [judged_truth, ranked_by_distance])
def test_the_ranking_has_each_set_of_faults_once_with_its_best_severities(
    quadruped: Robot, judge: Callable[[Iterable[Hypothesis], Problem], Diagnosis]
):
    problem = problem_of(quadruped, trial(quadruped, LAME, "lame.mcap"))
    sets = parsed(quadruped)
    found = judge([one for some in sets for one in some], problem)
    ranked = [candidate.hypothesis for candidate in found.ranked]

    assert str(found.best) == LAME
    assert len(ranked) == len(sets)
    assert set(ranked) == nearest(sets, problem)
    distances = [candidate.distance for candidate in found.ranked]
    assert distances == sorted(distances)


def test_the_verdict_does_not_depend_on_what_the_search_compared(quadruped: Robot):
    problem = problem_of(quadruped, trial(quadruped, LAME, "lame.mcap"))
    best = parse(LAME, quadruped.anatomy)
    compared = ([best, INTACT], [INTACT, *(one for some in parsed(quadruped) for one in some)])

    first, second = (judged(best, some, problem) for some in compared)

    assert first.ranked != second.ranked
    alike = dataclasses.replace(second, ranked=first.ranked)
    assert alike == first


def test_the_worst_time_of_an_unexplained_diagnosis_names_the_file_of_its_trial(
    quadruped: Robot,
):
    names = {"monday.mcap": "intact", "tuesday.mcap": LAME}
    trials = [trial(quadruped, truth, path) for path, truth in names.items()]
    found = judged(INTACT, [INTACT], problem_of(quadruped, *trials))

    assert found.verdict == "unexplained"
    assert found.residual is not None
    assert found.residual.trial == "tuesday"
    signals = found.residual.signals
    assert 1 <= len(signals) <= 3
    assert list(signals.values()) == sorted(signals.values(), reverse=True)
    assert 0 < found.residual.end - found.residual.begin <= WINDOW * 0.13
