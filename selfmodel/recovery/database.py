"""What a recovery has learned so far, and the journal that keeps it in files."""

from dataclasses import dataclass
from typing import Protocol

from selfmodel.controllers.controller import Controller
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.trials.trial import Trial, TrialPlan


@dataclass(frozen=True, eq=False)
class Database:
    """Controllers, their logged trials and the best hypotheses: what seeds the next EA.

    Source: the paper, section III.

    Attributes:
        trials: In the order in which they were run; each has its controller.
        diagnoses: In the order in which they were made.
    """

    trials: tuple[Trial, ...] = ()
    diagnoses: tuple[Diagnosis, ...] = ()

    @property
    def controllers(self) -> tuple[Controller, ...]:
        """Every controller that a physical robot has run, the newest first, each once."""
        drivers = dict.fromkeys(trial.plan.controller for trial in reversed(self.trials))
        return tuple(driver for driver in drivers if isinstance(driver, Controller))

    @property
    def evidence(self) -> tuple[Trial, ...]:
        """The trials that a diagnosis has to explain: those since the robot failed."""
        return tuple(trial for trial in self.trials if trial.plan.stage != "before")

    @property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """The best hypotheses of the newest diagnosis, best first; none before the first one."""
        if not self.diagnoses:
            return ()
        return tuple(candidate.hypothesis for candidate in self.diagnoses[-1].ranked)


class Journal(Protocol):
    """Keeps a recovery in files; the algorithm knows of the past only what it reads back here."""

    def record(self, physical: PhysicalRobot, plan: TrialPlan) -> Trial:
        """Runs a trial, logs it while it runs, and returns it as its file says it."""
        ...

    def note(self, diagnosis: Diagnosis) -> None:
        """Keeps a diagnosis."""
        ...

    def read(self) -> Database:
        """Returns everything kept so far, read from the files."""
        ...
