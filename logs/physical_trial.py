"""Physical trials with a log: run, written while they run, then read back and verified once."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from selfmodel.controllers.controller import Controller
from selfmodel.errors import TrialError
from selfmodel.logs.files import replace_file
from selfmodel.logs.reader import read_log
from selfmodel.logs.records import TrialHeader, checked_name
from selfmodel.logs.writer import write_trial
from selfmodel.physical.interface import PhysicalRobot, TimedRobot
from selfmodel.physical.safety import HangError
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.trial import Stage, Trial, TrialPlan

MIN_STEPS = 50
"""Steps below which a trial that ended early is an error: it contains too few predictions."""


def run_trial(
    physical: PhysicalRobot, plan: TrialPlan, path: Path, robot: Robot, header: TrialHeader
) -> Trial:
    """Runs a physical trial, logs it while it runs, and returns the trial read from the log.

    The log must not exist. The robot is that which its model describes, and the header is other
    content of the log's preamble; ``timed`` is taken from the physical robot.
    """
    timed = isinstance(physical, TimedRobot)
    samples = physical.run(plan.controller, plan.steps)
    write_trial(path, robot, plan, samples, replace(header, timed=timed))
    return _logged(path, plan)


def _logged(path: Path, plan: TrialPlan) -> Trial:
    """Returns the trial in a log; a function, which no log holds, is that of the plan."""
    trial = read_log(path).trial
    if isinstance(plan.controller, Controller) and plan.controller.design.function:
        trial = replace(trial, plan=plan)
    return trial


@dataclass(frozen=True, eq=False)
class TrialRunner:
    """Runs the physical trials of a recovery, each with a log of the plan's name in one folder.

    Attributes:
        folder: Existing folder for the logs.
        hidden: Faults of a simulated physical robot per stage, in notation, for scoring: the logs
            contain them, and nothing else does. A stage may be missing.
        gap: Reality gap of a simulated physical robot at every stage, as JSON, for scoring.
    """

    folder: Path
    robot: Robot
    settings: Settings
    hidden: Mapping[Stage, str] = field(default_factory=dict, repr=False)
    gap: str | None = field(default=None, repr=False)

    def __call__(self, physical: PhysicalRobot, plan: TrialPlan) -> Trial:
        """Runs a physical trial; see ``run_trial``.

        The numbers of a compensating layer are in a file beside the log, ``NAME.toml``.

        A trial that the robot could not finish, such as after an emergency stop, is returned as far
        as it went.
        """
        path, driver = self.folder / f"{checked_name(plan.name)}.mcap", plan.controller
        numbers = ""
        if isinstance(driver, Controller) and driver.genome.any():
            numbers = driver.design.layer_file(driver.genome)
        if numbers:
            replace_file(path.with_suffix(".toml"), numbers.encode())
        header = TrialHeader(self.settings, hidden=self.hidden.get(plan.stage), gap=self.gap)
        try:
            return run_trial(physical, plan, path, self.robot, header)
        except TrialError as error:
            # A note reports a robot that could not be stopped. Calibration, comparators and ratios
            # rest on the trial before the failure.
            unsafe = isinstance(error, HangError) or bool(getattr(error, "__notes__", ()))
            if unsafe or plan.stage == "before" or not path.exists():
                raise
            trial = _logged(path, plan)
            if trial.trajectory.steps < MIN_STEPS:
                raise
            return trial
