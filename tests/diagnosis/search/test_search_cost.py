"""The estimated steps of a diagnosis are within a factor of two of the simulated ones."""

import dataclasses
from itertools import product

import numpy as np
import pytest

from selfmodel.comparators import COMPARATORS
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.faults.notation import parse
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.calibration import simulated_steps
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.drivers import random_controllers
from tests.helpers.memory import in_memory


def logged(robot: Robot, truth: str, stage: str, steps: int = 110) -> Trial:
    physical = SimulatedRobot(robot, parse(truth, robot.anatomy))
    (controller,) = random_controllers(robot, 1, seed=5)
    return in_memory(robot)(physical, TrialPlan(stage, stage, controller, steps, 0))


@pytest.mark.parametrize(
    ("comparator", "truth", "healthy"),
    [
        ("forward-displacement", "break:front_left_knee", True),
        pytest.param("segment-prediction", "intact", False, marks=pytest.mark.search),
        *[
            pytest.param(name, "break:front_left_knee", healthy, marks=pytest.mark.search)
            for name, healthy in product(
                sorted(set(COMPARATORS) - {"forward-displacement"}), (False, True)
            )
            if healthy == name.startswith("segment")
        ],
    ],
)
def test_the_estimate_is_within_a_factor_of_two(
    quadruped: Robot, comparator: str, truth: str, *, healthy: bool
):
    trial = logged(quadruped, truth, "after")
    few = dataclasses.replace(Settings().scaled(10), generations=3)
    simulator = Simulator(quadruped, 1)
    intact = [logged(quadruped, "intact", "before")] if healthy else []
    diagnose = DiagnosticSearch(simulator, COMPARATORS[comparator], few, intact=intact)
    estimate = simulated_steps([trial], diagnose)
    assert simulator.stats.steps == 0
    diagnose([trial], [], np.random.default_rng(0), lambda _: None)

    assert 0.5 < estimate / simulator.stats.steps < 2


def test_the_estimate_grows_with_the_search(quadruped: Robot):
    trial = logged(quadruped, "intact", "after")

    def steps(population: int, generations: int) -> int:
        settings = Settings(generations=generations).scaled(population)
        comparator = COMPARATORS["forward-displacement"]
        return DiagnosticSearch(Simulator(quadruped, 1), comparator, settings).simulated_steps(
            [trial]
        )

    assert steps(10_000, 10_000) > 100 * steps(10, 10)
    assert steps(100, 2) > steps(100, 1) > steps(50, 1)
