"""The log and the hypothesis of a command that simulates one logged trial."""

from dataclasses import dataclass
from pathlib import Path

from selfmodel import arguments, plugins
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.logs import TrialLog
from selfmodel.robot.robot import Robot


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


def replayed_log(file: Path, hypothesis: str, *, kinds: str, model: str | None) -> ReplayedLog:
    """Returns a log, and what its trial is simulated with.

    Args:
        file: Log of the trial.
        hypothesis: Notation of the hypothesis.
        kinds: Fault kinds that the notation may name, as in ``--kinds``.
        model: Self-model instead of the log's, as in ``--robot``.

    Raises:
        InputError: The log, the hypothesis or the model cannot be used.
    """
    (log,) = arguments.read_logs([file])
    robot = arguments.robot_of_logs([log], model)
    assumed = HypothesisSpace(robot.anatomy, plugins.kinds(kinds)).parse(hypothesis)
    return ReplayedLog(log, robot, assumed)
