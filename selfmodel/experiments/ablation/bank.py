"""The bank: gaits of the intact robots, evolved once, that the trials of all runs take."""

import dataclasses
import hashlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from selfmodel.controllers.controller import Controller
from selfmodel.experiments import robots, trial_logs
from selfmodel.experiments.ablation.plan import Ablation, Cell, model_digest
from selfmodel.experiments.grid import GridBegins, Job, PartEnds, run_grid
from selfmodel.experiments.keys import key_of
from selfmodel.faults.hypothesis import INTACT
from selfmodel.logs.atomic import write_atomic
from selfmodel.logs.controllers import controller_bytes
from selfmodel.recovery.random_streams import repair_stream
from selfmodel.recovery.repair import RepairSearch
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.version import __version__

OF_DIAGNOSIS = ("trials", "genes", "kept")
"""Settings that no gait depends on."""


def fill(
    ablation: Ablation,
    cells: Sequence[Cell],
    workers: int,
    on_event: Callable[[GridBegins | PartEnds], None],
) -> tuple[PartEnds, ...]:
    """Evolves the gaits that the runs need and the bank lacks; returns what failed.

    Raises:
        InputError: The bank was given and lacks a gait, or was made with other settings.
    """
    needed = sorted({(cell.robot, k) for cell in cells for k in cell.gaits(ablation.settings)})
    if ablation.bank is not None:
        for robot, number in needed:
            gait(ablation.bank, robot, number)
        return ()
    settings = dataclasses.asdict(ablation.settings)
    made_of = {name: settings[name] for name in settings if name not in OF_DIAGNOSIS}
    jobs = [
        Job(
            key=f"{key_of(robot)}-{number}",
            parameters={
                "robot": robot,
                "model": model_digest(robot),
                "selfmodel": __version__,
                "settings": made_of,
            },
            seed=number,
            parts=("gait",),
        )
        for robot, number in needed
    ]
    return run_grid(folder(ablation), jobs, evolve_gait, workers=workers, on_event=on_event)


def folder(ablation: Ablation) -> Path:
    """Returns where the gaits of an ablation are."""
    return ablation.folder / "bank" if ablation.bank is None else ablation.bank


def gait(bank: Path, robot: str, number: int) -> Controller:
    """Returns a gait of the bank.

    Raises:
        InputError: There is none, or it is for another robot.
    """
    return trial_logs.controller(_path(bank, robot, number), robots.robot_entry(robot).robot())


def digests(bank: Path, cell: Cell, settings: Settings) -> list[str] | None:
    """Returns a digest of each gait that a run takes; None where one is missing."""
    paths = [_path(bank, cell.robot, number) for number in cell.gaits(settings)]
    if not all(path.exists() for path in paths):
        return None
    return [hashlib.sha256(path.read_bytes()).hexdigest() for path in paths]


def evolve_gait(job: Job, _part: str, run: Path) -> Any:  # noqa: ANN401  # JSON
    """Evolves a gait as a recovery with that seed begins, and puts it into the bank."""
    robot = robots.robot_entry(job.parameters["robot"]).robot()
    repair = RepairSearch(Simulator(robot, threads=1), Settings(**job.parameters["settings"]))
    found = repair(INTACT, (), repair_stream(job.seed, 0), lambda _generation: None)
    write_atomic(_path(run.parent, job.parameters["robot"], job.seed), controller_bytes(found))
    return {"evaluations": repair.evaluations}


def _path(bank: Path, robot: str, number: int) -> Path:
    return bank / f"{key_of(robot)}-{number}.npz"
