"""Gaits of healthy robots for studies: a cell each, which all runs of its robot share."""

import dataclasses
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from selfmodel import arguments, plugins
from selfmodel.controllers.controller import Controller
from selfmodel.experiments.grid import Cell
from selfmodel.experiments.study.files import key_of
from selfmodel.experiments.study.planned_robots import planned_entry
from selfmodel.experiments.study.repairs import repair_parameters
from selfmodel.faults.hypothesis import INTACT
from selfmodel.logs.controllers import controller_bytes
from selfmodel.logs.files import replace_file
from selfmodel.recovery.random_streams import repair_stream
from selfmodel.recovery.scores import DISPLACEMENT
from selfmodel.recovery.uncertainty import assumed_uncertainty
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.studies.scores import choose_score

GAITS, GAIT, FILE = "gaits", "gait", "gait.npz"
"""Kind and part of a gait's cell, and its file."""

EVOLVE = "selfmodel.experiments.study.gaits:evolve"

DIAGNOSIS_SETTINGS = ("trials", "genes", "kept")
"""Names of the settings that do not affect a gait."""


def gait_settings(settings: Settings) -> dict[str, Any]:
    """Returns the settings that affect a gait, as JSON."""
    values = dataclasses.asdict(settings)
    return {name: values[name] for name in values if name not in DIAGNOSIS_SETTINGS}


def gait_cell(
    robot: Mapping[str, str],
    settings: Settings,
    seed: int,
    *,
    score: str = DISPLACEMENT.name,
    controller: str = "network",
    neurons: int | None = None,
    repair: str = plugins.PAPER,
    search: str | None = None,
) -> Cell:
    """Returns the cell of the first gait of a recovery with the same seed.

    Args:
        robot: The robot, as planned.
        settings: Parameters of the repair.
        seed: Seed of all random numbers.
        score: Name of the fitness.
        controller: Name of the controller design.
        neurons: Number of hidden neurons; None for the design's default.
        repair: Name of the repair that evolves the gait.
        search: Name of its search; None for that of the repair.
    """
    parameters = {
        **robot,
        "settings": gait_settings(settings),
        "score": score,
        "controller": controller,
        "neurons": neurons,
        **repair_parameters(repair, search),
    }
    return Cell(EVOLVE, f"{key_of(robot['robot'])}-seed{seed:03d}", parameters, seed, GAIT, GAITS)


def evolve(cell: Cell, _needs: Mapping[str, Path], folder: Path) -> dict[str, Any]:
    """Evolves a gait by the repair of its cell, writes it, and returns the evaluations."""
    parameters = cell.parameters
    entry, settings = planned_entry(parameters), Settings(**parameters["settings"])
    robot = entry.robot()
    design = plugins.design(parameters["controller"], robot, parameters["neurons"])
    chosen = choose_score(parameters["score"], entry, design, steps=settings.steps, seed=cell.seed)
    if chosen.gait is not None:
        write_gait(folder, chosen.gait)
        return {"evaluations": 0}
    make_repair = plugins.repair(parameters["repair"], parameters["search"])
    repair = make_repair(Simulator(robot, threads=1), settings, design, chosen.score)
    found = repair(
        (INTACT,),
        partial(assumed_uncertainty, robot),
        (),
        repair_stream(cell.seed, 0),
        lambda _generation: None,
    )
    write_gait(folder, found[0].controller)
    return {"evaluations": repair.evaluations}


def write_gait(folder: Path, gait: Controller) -> None:
    """Writes a gait into the folder of its cell."""
    replace_file(folder / FILE, controller_bytes(gait))


def read_gait(folder: Path, robot: Robot) -> Controller:
    """Returns the gait in the folder of its cell.

    Raises:
        InputError: The gait is for another robot.
    """
    return arguments.read_controller(folder / FILE, robot)
