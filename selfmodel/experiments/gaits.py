"""Gaits of healthy robots for studies, evolved once and kept in files."""

import dataclasses
from pathlib import Path
from typing import Any

from selfmodel.controllers.controller import Controller, Design
from selfmodel.errors import InputError
from selfmodel.experiments.grid import PartResult, finished
from selfmodel.faults.hypothesis import INTACT
from selfmodel.logs.controllers import controller_bytes
from selfmodel.logs.files import replace_file
from selfmodel.recovery.random_streams import repair_stream
from selfmodel.recovery.repair.paper_repair import RepairSearch
from selfmodel.recovery.scores.fitness import DISPLACEMENT, Score
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator

DIAGNOSIS_SETTINGS = ("trials", "genes", "kept")
"""Names of the settings that do not affect a gait."""


def gait_settings(settings: Settings) -> dict[str, Any]:
    """Returns the settings that affect a gait, as JSON."""
    values = dataclasses.asdict(settings)
    return {name: values[name] for name in values if name not in DIAGNOSIS_SETTINGS}


def check_not_evolved(path: Path) -> None:
    """Checks that the grid of a missing gait has not finished it.

    Args:
        path: File of the gait, in the folder of its grid.

    Raises:
        InputError: The gait was evolved, and its file is missing.
    """
    if any(part.key == path.stem for part in finished(path.parent)):
        raise InputError(
            f"{path} is missing, a gait of the study: restore the file, or delete "
            f"{path.with_suffix('')} to evolve the gait again"
        )


def evolve_gait(
    path: Path,
    robot: Robot,
    settings: Settings,
    seed: int,
    *,
    design: Design | None = None,
    score: Score = DISPLACEMENT,
) -> PartResult:
    """Evolves the first gait of a recovery with the same seed, and writes it.

    Args:
        path: The ``.npz`` file to write.
        robot: The nominal robot.
        settings: Parameters of the repair EA.
        seed: Seed of all random numbers.
        design: Controller design; None for the robot's network.
        score: Fitness of the repair EA.

    Returns:
        Number of evaluations, as JSON, and the file.
    """
    repair = RepairSearch(Simulator(robot, threads=1), settings, design, score=score)
    gait = repair.best(INTACT, (), repair_stream(seed, 0), lambda _generation: None)
    return write_gait(path, gait, repair.evaluations)


def write_gait(path: Path, gait: Controller, evaluations: int) -> PartResult:
    """Writes a gait, and returns the number of evaluations, as JSON, and the file."""
    replace_file(path, controller_bytes(gait))
    return PartResult({"evaluations": evaluations}, [path])
