"""The log and the hypothesis of a command that simulates one logged trial."""

from dataclasses import dataclass
from pathlib import Path

from selfmodel.cli.arguments.confirmation import confirm_time
from selfmodel.experiments import plugins, trial_logs
from selfmodel.experiments.expected_time import replay_seconds
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.logs import TrialLog
from selfmodel.robot.robot import Robot
from selfmodel.sandbox.budget import Budget


@dataclass(frozen=True, eq=False)
class ReplayedLog:
    """A log, and what its trial is simulated with.

    Attributes:
        log: The log.
        robot: The self-model.
        hypothesis: The hypothesis to simulate.
    """

    log: TrialLog
    robot: Robot
    hypothesis: Hypothesis


def replayed_log(
    file: Path, hypothesis: str, *, kinds: str, model: str | None, budget: Budget, yes: bool
) -> ReplayedLog:
    """Returns a log whose trial can be simulated in the time that the budget allows.

    Args:
        file: Log of the trial.
        hypothesis: Notation of the hypothesis.
        kinds: Fault kinds that the notation may name, as in ``--kinds``.
        model: Self-model instead of the log's, as in ``--robot``.
        budget: Memory and time that the log may take.
        yes: Whether a longer time is allowed.

    Raises:
        InputError: The log, the hypothesis or the model cannot be used.
        BudgetError: The simulation takes longer than the budget, and this is not allowed.
    """
    (log,) = trial_logs.logs([file], budget)
    robot = trial_logs.robot_of_logs([log], model, budget)
    assumed = HypothesisSpace(robot.anatomy, plugins.kinds(kinds)).parse(hypothesis)
    confirm_time(replay_seconds(robot, log.trial, budget), budget, yes=yes)
    return ReplayedLog(log, robot, assumed)
