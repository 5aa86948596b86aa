"""The log and the hypothesis of a command that simulates one logged trial."""

from dataclasses import dataclass
from pathlib import Path

from selfmodel import arguments, plugins
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.logs import TrialLog
from selfmodel.robot.motion import POSE
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator, thread_count
from selfmodel.simulation.trial_replay import Replay, replay
from selfmodel.trials.trial import check_magnitudes


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

    def replayed(self, threads: int) -> Replay:
        """Returns the simulation of the trial under the hypothesis, compared with the log.

        Args:
            threads: Threads of the physics; 0 for one per processor.

        Raises:
            InputError: A pose in the log is too large to draw.
        """
        check_magnitudes(self.log.trial, POSE)
        return replay(self.log.trial, self.hypothesis, Simulator(self.robot, thread_count(threads)))


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
