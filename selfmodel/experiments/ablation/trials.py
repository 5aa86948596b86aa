"""Physical trials of a run, which all its diagnoses share: run once, then read from their logs."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from selfmodel import plugins
from selfmodel.experiments.ablation import bank
from selfmodel.experiments.ablation.plan import BANK, HEALTHY_TRIALS, TRIALS
from selfmodel.experiments.grid import Cell
from selfmodel.experiments.study.gaits import read_gait
from selfmodel.experiments.study.planned_robots import planned_entry
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.logs.files import replace_file
from selfmodel.logs.physical_trial import run_trial
from selfmodel.logs.reader import read_log
from selfmodel.logs.records import TrialHeader
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.calibration import calibrate
from selfmodel.studies.experiment import draw_reality
from selfmodel.tasks import Entry
from selfmodel.trials.trial import Stage, Trial, TrialPlan

CALIBRATED = "calibrated.xml"


@dataclass(frozen=True, eq=False)
class Setting:
    """Objects of a run.

    Attributes:
        name: Name of the robot.
        entry: The robot with its cases and tasks.
        robot: The nominal robot.
        case: Number of the failure in Table I; None for a failure that is not in it.
        truth: The failure of the physical robot.
        gap: Level of the reality gap.
        seed: Seed of all random numbers.
        settings: Parameters of the search.
        shared: Parameters that all runs of the ablation share.
        evolves: Whether anything of the run is evolved by the repair: its gaits or its recovery.
    """

    name: str
    entry: Entry
    robot: Robot
    case: int | None
    truth: Hypothesis
    gap: float
    seed: int
    settings: Settings
    shared: Mapping[str, Any]
    evolves: bool


def setting_of(cell: Cell) -> Setting:
    """Returns the objects of a run, from a cell of it."""
    parameters, shared = cell.parameters, cell.parameters["shared"]
    gaits = cell.needs[TRIALS].needs.values() if TRIALS in cell.needs else cell.needs.values()
    entry = planned_entry(parameters)
    robot = entry.robot()
    space = HypothesisSpace(robot.anatomy, plugins.kinds(shared["kinds"]))
    return Setting(
        name=parameters["robot"],
        entry=entry,
        robot=robot,
        case=parameters["case"],
        truth=space.parse(parameters["truth"]),
        gap=parameters["gap"],
        seed=cell.seed,
        settings=Settings(**shared["settings"]),
        shared=shared,
        evolves=any(gait.function != bank.WRITE for gait in gaits) or shared["next_trial"] != BANK,
    )


def run_trials(cell: Cell, needs: Mapping[str, Path], folder: Path) -> list[str]:
    """Runs the trials before and after the failure, and fits the self-model to the former.

    Returns:
        The names of the trials.
    """
    setting = setting_of(cell)
    gaits = [read_gait(needs[f"gait-{number}"], setting.robot) for number in range(len(needs))]
    stages: list[tuple[Stage, int]] = [("before", number) for number in range(HEALTHY_TRIALS)]
    stages += [("after", number) for number in range(setting.settings.trials)]
    trials = []
    for number, (stage, gait) in enumerate(stages):
        plan = TrialPlan(
            f"{number:02d}-{stage}", stage, gaits[gait], setting.settings.steps, setting.seed
        )
        trials.append(_run(setting, plan, number, folder))
    healthy = trials[:HEALTHY_TRIALS]
    fitted = calibrate(setting.robot, healthy, threads=1).robot
    replace_file(folder / CALIBRATED, fitted.mjcf.encode())
    return [trial.plan.name for trial in trials]


def read_trials(folder: Path) -> tuple[list[Trial], list[Trial]]:
    """Returns the trials before and those after the failure, from the folder of their cell."""
    trials = [read_log(path).trial for path in sorted(folder.glob("*.mcap"))]
    return trials[:HEALTHY_TRIALS], trials[HEALTHY_TRIALS:]


def calibrated_robot(robot: Robot, folder: Path) -> Robot:
    """Returns the calibrated self-model, the same for all comparators."""
    return dataclasses.replace(robot, mjcf=(folder / CALIBRATED).read_text(encoding="utf-8"))


def _run(setting: Setting, plan: TrialPlan, number: int, folder: Path) -> Trial:
    hidden = INTACT if plan.stage == "before" else setting.truth
    reality = draw_reality(setting.robot, setting.seed, setting.gap)
    # Noise differs between trials and is the same for every comparator.
    physical = reality.robot(setting.robot, hidden, stream=number)
    header = TrialHeader(setting.settings, hidden=str(hidden), gap=reality.text)
    return run_trial(physical, plan, folder / f"{plan.name}.mcap", setting.robot, header)
