"""What a report is about: trials of one robot, their diagnoses, and the self-model behind them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from selfmodel.diagnosis.comparator import Comparator
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.diagnosis.evidence import Evidence
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.report.run_result import RunResult
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration import Calibration
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial, trial_names

TITLE = "{robot}: {name}"
"""Title of a report, of the name of the robot and that of the run or of the logs."""


@dataclass(frozen=True)
class Search:
    """Progress of one search of a recovery.

    Attributes:
        kind: Name of the EA: ``repair`` or ``diagnostic``.
        hypothesis: Notation of the hypothesis that a repair compensates; "" for a diagnosis.
        best: Best fitness after each generation.
        evaluations: Number of evaluations after each generation.
    """

    kind: str
    hypothesis: str
    best: tuple[float, ...]
    evaluations: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Subject:
    """Trials of one robot, and what is known about them.

    Attributes:
        title: Name of the run or of the logs.
        robot: The nominal robot.
        healthy: Trials of the healthy robot.
        damaged: Trials to explain, in order.
        diagnoses: Diagnoses, at least one; the last is of all trials to explain.
        comparator: Comparator of the diagnoses.
        calibration: Fit of the self-model to the healthy trials; None without one.
        result: Result of a run; None for logs, and for a run that goes on.
        searches: Progress of the searches; empty if it was not recorded.
        made_with: Versions by the name of the software.
        notes: What could not be checked, as sentences.
        threads: Threads of the physics.
    """

    title: str
    robot: Robot
    healthy: tuple[Trial, ...]
    damaged: tuple[Trial, ...]
    diagnoses: tuple[Diagnosis, ...]
    comparator: Comparator
    calibration: Calibration | None
    result: RunResult | None = None
    searches: tuple[Search, ...] = ()
    made_with: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    threads: int = 0

    @property
    def diagnosis(self) -> Diagnosis:
        """The last diagnosis."""
        return self.diagnoses[-1]

    @property
    def trials(self) -> tuple[Trial, ...]:
        """All trials, those of the healthy robot first."""
        return (*self.healthy, *self.damaged)

    @cached_property
    def names(self) -> Mapping[str, str]:
        """Name of each trial, by its path."""
        return trial_names(self.trials)

    @cached_property
    def simulator(self) -> Simulator:
        """Simulator of the self-model."""
        model = self.robot if self.calibration is None else self.calibration.robot
        return Simulator(model, self.threads)

    @cached_property
    def evidence(self) -> Evidence:
        """Losses of hypotheses on the trials."""
        return Evidence(self.simulator, self.comparator)

    @property
    def runner_up(self) -> Hypothesis | None:
        """The hypothesis to compare with the best: an indistinguishable one, or the next."""
        others = [*self.diagnosis.indistinguishable]
        others += [candidate.hypothesis for candidate in self.diagnosis.ranked]
        return next((one for one in others if one != self.diagnosis.best), None)

    @property
    def shown_hypotheses(self) -> tuple[tuple[str, Hypothesis], ...]:
        """The hypotheses of charts over time: best, runner-up and the healthy robot."""
        named = [("best", self.diagnosis.best)]
        named += [("runner-up", self.runner_up)] if self.runner_up is not None else []
        if all(one != INTACT for _, one in named):
            named.append(("healthy", INTACT))
        return tuple((f"{name}: {one}", one) for name, one in named)

    def change_of(self, trial: Trial) -> tuple[float, float, float] | None:
        """Returns time, lower and upper bound of a change of the robot in a trial, s."""
        change = self.diagnosis.change
        if change is None or self.damaged[change.index].path != trial.path:
            return None
        return change.time, change.earliest, change.latest
