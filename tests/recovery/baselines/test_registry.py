"""What every baseline promises: its budget, its seed, and the best trial so far."""

from functools import partial

import numpy as np
import pytest

from selfmodel.api import simulated_robot
from selfmodel.evolution import Evolution
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.recovery.baselines.genome_search import genome_search
from selfmodel.recovery.baselines.measurement import Track, measure
from selfmodel.recovery.baselines.problem import (
    BaselineSettings,
    BaselineTrial,
    Fitness,
    Problem,
)
from selfmodel.recovery.baselines.registry import BASELINES
from selfmodel.recovery.repertoire.evaluation import simulated_evaluation
from selfmodel.recovery.repertoire.make import make_repertoire
from selfmodel.recovery.repertoire.repertoire import Repertoire
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from tests.recovery.baselines.problems import LEVEL

NOISY_EA = partial(Evolution, noisy=True)

STEPS = 25
SMALL = BaselineSettings(trials=3, evaluations=8, searches=2, population=4, period=1)


@pytest.fixture(scope="module")
def repertoire(quadruped: Robot) -> Repertoire:
    evaluate = simulated_evaluation(Simulator(quadruped, 1), INTACT, STEPS)
    return make_repertoire(
        quadruped, network_for(quadruped), evaluate, steps=STEPS, seed=0, evaluations=20, batch=20
    )


def fitness_on(track: Track) -> Fitness:
    """The upright displacement of one run of each controller on a track."""
    return lambda controllers: np.array([measure(track, one).upright for one in controllers])


def run(
    name: str, robot: Robot, repertoire: Repertoire, seed: int
) -> tuple[tuple[BaselineTrial, ...], list[BaselineTrial]]:
    """A method on a damaged physical robot with a reality gap, and what its callback received."""
    truth = parse("break:front_left_knee", robot.anatomy)

    def track() -> Track:  # a new one has the same noise
        physical = simulated_robot(robot, truth, gap=0.1, seed=5)
        return Track(physical, robot, LEVEL, STEPS)

    problem = Problem(
        track=track(),
        design=network_for(robot),
        evaluate=simulated_evaluation(Simulator(robot, 1), INTACT, STEPS),
        healthy=fitness_on(Track(simulated_robot(robot), robot, LEVEL, STEPS)),
        hidden=fitness_on(track()),
        search=genome_search(NOISY_EA, Settings().scaled(4)),
        repertoire=repertoire,
    )
    seen: list[BaselineTrial] = []
    trials = BASELINES[name](problem, SMALL, np.random.default_rng(seed), seen.append)
    return trials, seen


@pytest.mark.parametrize("name", BASELINES)
def test_a_baseline_keeps_its_promises(name: str, quadruped: Robot, repertoire: Repertoire):
    trials, seen = run(name, quadruped, repertoire, seed=1)
    upright = [trial.measured.upright for trial in trials]

    assert 1 <= len(trials) <= SMALL.trials
    assert list(trials) == seen
    assert [trial.best for trial in trials] == np.maximum.accumulate(upright).tolist()
    assert all(trial.controller.design == network_for(quadruped) for trial in trials)
    assert all(trial.measured.steps == STEPS for trial in trials)


@pytest.mark.parametrize("name", BASELINES)
def test_the_same_seed_leads_to_the_same_trials(
    name: str, quadruped: Robot, repertoire: Repertoire
):
    assert run(name, quadruped, repertoire, 1)[0] == run(name, quadruped, repertoire, 1)[0]


@pytest.mark.parametrize("name", [name for name in BASELINES if name != "trial-and-error"])
def test_another_seed_leads_to_other_trials(name: str, quadruped: Robot, repertoire: Repertoire):
    assert run(name, quadruped, repertoire, 1)[0] != run(name, quadruped, repertoire, 2)[0]
