"""Bank of gaits: controllers of the healthy robots, shared by the trials of all runs."""

import hashlib
from collections.abc import Callable, Sequence
from pathlib import Path

from selfmodel.controllers.controller import Controller
from selfmodel.experiments import robots, trial_logs
from selfmodel.experiments.ablation.plan import Ablation, Cell, model_digest
from selfmodel.experiments.chosen_score import choose_score
from selfmodel.experiments.gaits import check_not_evolved, evolve_gait, gait_settings, write_gait
from selfmodel.experiments.grid import GridBegins, Job, PartEnds, PartResult, run_grid
from selfmodel.experiments.study_files import key_of
from selfmodel.recovery.scores.fitness import DISPLACEMENT
from selfmodel.robot.designs import network_for
from selfmodel.settings import Settings
from selfmodel.version import __version__


def fill(
    ablation: Ablation,
    cells: Sequence[Cell],
    workers: int,
    on_progress: Callable[[GridBegins | PartEnds], None],
) -> tuple[PartEnds, ...]:
    """Evolves the missing gaits of the runs and returns the failed parts.

    Args:
        ablation: The ablation.
        cells: Its runs.
        workers: Number of worker processes.
        on_progress: Callback of the grid of gaits.

    Raises:
        InputError: A given bank lacks a gait, or the bank was made with other settings.
    """
    needed = sorted({(cell.robot, k) for cell in cells for k in cell.gaits(ablation.settings)})
    if ablation.bank is not None:
        for robot, number in needed:
            gait(ablation.bank, robot, number)
        return ()
    jobs = [
        Job(
            key=f"{key_of(robot)}-{number}",
            parameters={
                "robot": robot,
                "model": model_digest(robot),
                "selfmodel": __version__,
                "settings": gait_settings(ablation.settings),
                **({} if ablation.score == DISPLACEMENT.name else {"score": ablation.score}),
            },
            seed=number,
            parts=("gait",),
        )
        for robot, number in needed
    ]
    return run_grid(folder(ablation), jobs, _evolve, workers=workers, on_progress=on_progress)


def folder(ablation: Ablation) -> Path:
    """Returns the folder of the bank of an ablation."""
    return ablation.folder / "bank" if ablation.bank is None else ablation.bank


def gait(bank: Path, robot: str, number: int) -> Controller:
    """Returns a gait of the bank.

    Raises:
        InputError: The bank has no such gait, or the gait is for another robot.
    """
    return trial_logs.controller(_path(bank, robot, number), robots.robot_entry(robot).robot())


def digests(bank: Path, cell: Cell, settings: Settings) -> list[str] | None:
    """Returns the SHA-256 of each gait of a run; None if the evolution of a gait failed.

    Raises:
        InputError: The file of an evolved gait is missing.
    """
    paths = [_path(bank, cell.robot, number) for number in cell.gaits(settings)]
    for path in paths:
        if not path.exists():
            check_not_evolved(path)
            return None
    return [hashlib.sha256(path.read_bytes()).hexdigest() for path in paths]


def _evolve(job: Job, _part: str, run: Path) -> PartResult:
    name, settings = job.parameters["robot"], Settings(**job.parameters["settings"])
    entry, path = robots.robot_entry(name), _path(run.parent, name, job.seed)
    robot = entry.robot()
    chosen = choose_score(
        job.parameters.get("score", DISPLACEMENT.name),
        entry,
        network_for(robot),
        steps=settings.steps,
        seed=job.seed,
    )
    if chosen.gait is not None:
        return write_gait(path, chosen.gait, evaluations=0)
    return evolve_gait(path, robot, settings, job.seed, score=chosen.score)


def _path(bank: Path, robot: str, number: int) -> Path:
    return bank / f"{key_of(robot)}-{number}.npz"
