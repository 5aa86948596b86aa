"""Promises of the expected cost of repairs: it is that of the simulator, and counts gaits once."""

from functools import partial
from pathlib import Path

import pytest

from selfmodel import plugins
from selfmodel.comparators import DEFAULT
from selfmodel.controllers.controller import Controller
from selfmodel.experiments.grid.cell import with_needs
from selfmodel.experiments.study.repair_cost import RepairCost, repair_cost
from selfmodel.experiments.suite.plan import Study, cells
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.recovery.random_streams import repair_stream
from selfmodel.recovery.scores import UPRIGHT
from selfmodel.recovery.uncertainty import assumed_uncertainty
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator

TINY = Settings(steps=20, generations=3).scaled(6)


@pytest.mark.parametrize(("repair", "least"), [("robust", 0.9), ("paper", 0.6)])
def test_the_steps_of_a_gait_and_of_a_repair_are_those_that_are_simulated(
    repair: str, least: float, quadruped: Robot, tmp_path: Path
):
    study = Study(["quadruped"], [2], [0], tmp_path, TINY, None, "network", DEFAULT.name)
    expected = repair_cost(cells(study), TINY, repair, 1)
    simulator = Simulator(quadruped, 1)
    made = plugins.repair(repair)(simulator, TINY, network_for(quadruped), UPRIGHT)

    def repaired(hypothesis: Hypothesis, *known: Controller) -> Controller:
        uncertainty, rng = partial(assumed_uncertainty, quadruped), repair_stream(0, len(known))
        return made((hypothesis,), uncertainty, known, rng, lambda _: None)[0].controller

    gait = repaired(INTACT)
    repaired(parse("break:front_left_knee", quadruped.anatomy), gait)
    assert (expected.gaits, expected.repairs) == (1, 1)
    # The robust repair ends with a whole generation; the paper's looks up equal children.
    assert least <= simulator.stats.steps / expected.steps <= 1.2


def test_a_gait_that_cases_share_is_counted_once(tmp_path: Path):
    study = Study(["quadruped"], [2, 4], [0, 1], tmp_path, TINY, None, "network", DEFAULT.name)
    found = repair_cost(cells(study), TINY, "paper", 3)

    assert (found.gaits, found.repairs) == (2, 12)
    assert found.steps == found.paper_steps == 14 * TINY.evaluations * TINY.steps


def test_finished_cells_cost_nothing(tmp_path: Path):
    study = Study(["quadruped"], [2, 4], [0, 1], tmp_path, TINY, None, "network", DEFAULT.name)
    wanted = cells(study)
    all_of_one_seed = {
        place for place, cell in with_needs(wanted).items() if cell.seed == wanted[0].seed
    }
    found = repair_cost(wanted, TINY, "paper", 3, all_of_one_seed)

    assert (found.gaits, found.repairs) == (1, 6)


def test_it_is_told_in_round_numbers():
    assert str(RepairCost(2, 6, 1_234_567, 1_000_000)) == (
        "gaits to evolve: 2, repairs: 6, of at most 1,200,000 control steps in simulation, 1.2 "
        "times as many as of the paper's repair"
    )
