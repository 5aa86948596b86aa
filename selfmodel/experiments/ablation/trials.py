"""Physical trials of a run: run once, then read from their logs."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from selfmodel.controllers.controller import Controller
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.experiments.ablation.plan import HEALTHY_TRIALS, Spec
from selfmodel.experiments.reality import draw_reality
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.logs.atomic import partial_path
from selfmodel.logs.files import make_folder, replace_file
from selfmodel.logs.physical_trial import run_trial
from selfmodel.logs.reader import read_log
from selfmodel.logs.records import TrialHeader
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration import calibrate
from selfmodel.trials.trial import Stage, Trial, TrialPlan


@dataclass(frozen=True, eq=False)
class Setting:
    """Objects of a run's specification.

    Attributes:
        spec: Specification of the run.
        comparator: The comparator.
        name: Name of the comparator, or ``package.module:object``.
        robot: The nominal robot.
        truth: The failure of the physical robot.
        gaits: Gaits of the run, in the order of the trials.
        folder: Folder of the run.
    """

    spec: Spec
    comparator: Comparator
    name: str
    robot: Robot
    truth: Hypothesis
    gaits: tuple[Controller, ...]
    folder: Path


def before_failure(setting: Setting) -> list[Trial]:
    """Returns the logged trials of the healthy robot; runs the missing ones."""
    return [
        _trial(setting, number, "before", gait)
        for number, gait in enumerate(setting.gaits[:HEALTHY_TRIALS])
    ]


def after_failure(setting: Setting, number: int, controller: Controller) -> Trial:
    """Returns a logged trial of the damaged robot, numbered from 0; runs it if missing."""
    return _trial(setting, HEALTHY_TRIALS + number, "after", controller)


def calibrated_robot(setting: Setting, healthy: Sequence[Trial]) -> Robot:
    """Returns the calibrated self-model, the same for all comparators.

    The first call fits the model to the trials before the failure and writes it into the folder of
    the run.
    """
    path, robot = setting.folder / "calibrated.xml", setting.robot
    if not path.exists():
        replace_file(path, calibrate(robot, healthy, threads=1).robot.mjcf.encode())
    return dataclasses.replace(robot, mjcf=path.read_text(encoding="utf-8"))


def _trial(setting: Setting, number: int, stage: Stage, gait: Controller) -> Trial:
    """Returns a trial from its log; runs it if there is no log."""
    steps, seed = setting.spec.settings.steps, setting.spec.cell.seed
    plan = TrialPlan(f"{number:02d}-{stage}", stage, gait, steps, seed)
    path = setting.folder / "trials" / f"{plan.name}.mcap"
    if path.exists():
        return read_log(path).trial
    make_folder(path.parent)
    partial_path(path).unlink(missing_ok=True)  # of a killed run
    hidden = INTACT if stage == "before" else setting.truth
    cell, robot = setting.spec.cell, setting.robot
    reality = draw_reality(robot, cell.seed, cell.gap, structure=setting.spec.structure)
    # Noise differs between trials and is the same for every comparator.
    physical = reality.robot(robot, hidden, stream=number)
    header = TrialHeader(setting.spec.settings, hidden=str(hidden), gap=reality.text)
    return run_trial(physical, plan, path, robot, header)
