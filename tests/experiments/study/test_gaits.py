"""Promises of the gaits of studies: each repair evolves its own, as a recovery does."""

from functools import partial
from pathlib import Path

import pytest

from selfmodel.controllers.controller import Controller
from selfmodel.evolution import Evolution
from selfmodel.experiments.study.gaits import evolve, gait_cell, read_gait
from selfmodel.experiments.study.planned_robots import planned
from selfmodel.faults.hypothesis import INTACT
from selfmodel.recovery.random_streams import repair_stream
from selfmodel.recovery.repair import RepairSearch
from selfmodel.recovery.robust_repair import RobustRepair
from selfmodel.recovery.scores import DISPLACEMENT
from selfmodel.recovery.uncertainty import assumed_uncertainty
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator

NOISY_EA = partial(Evolution, noisy=True)

TINY = Settings(steps=40, generations=3).scaled(8)


def evolved(folder: Path, robot: Robot, **options: str) -> Controller:
    evolve(gait_cell(planned("quadruped"), TINY, 3, **options), {}, folder)
    return read_gait(folder, robot)


def test_the_default_is_the_gait_of_the_papers_repair_to_the_bit(quadruped: Robot, tmp_path: Path):
    given = None, (), repair_stream(3, 0), lambda _generation: None
    expected = RepairSearch(Simulator(quadruped, 1), TINY)((INTACT,), *given)[0].controller

    assert evolved(tmp_path, quadruped) == expected


@pytest.mark.parametrize(
    ("search", "options"), [(None, {}), ("cma-es", {}), ("ea", {"make_search": NOISY_EA})]
)
def test_the_robust_repair_evolves_the_first_gait_of_a_robust_recovery(
    search: str | None, options: dict[str, type], quadruped: Robot, tmp_path: Path
):
    repair = RobustRepair(
        Simulator(quadruped, 1), TINY, network_for(quadruped), DISPLACEMENT, **options
    )
    candidates = repair(
        (INTACT,),
        partial(assumed_uncertainty, quadruped),
        (),
        repair_stream(3, 0),
        lambda _generation: None,
    )

    found = evolved(tmp_path, quadruped, repair="robust", search=search)
    assert found == candidates[0].controller
    assert found != evolved(tmp_path, quadruped)


def test_gaits_of_other_repairs_are_other_cells():
    robot = planned("quadruped")
    paper, robust, named, ea = (
        gait_cell(robot, TINY, 3, repair=repair, search=search).place
        for repair, search in (
            *(("paper", None), ("robust", None), ("robust", "cma-es"), ("robust", "ea")),
        )
    )

    assert gait_cell(robot, TINY, 3).place == paper
    assert robust == named
    assert len({paper, robust, ea}) == 3
