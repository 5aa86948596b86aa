"""Database of a recovery, and the interfaces that run its trials and store its diagnoses."""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from selfmodel.controllers.controller import Controller
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.trials.trial import Trial, TrialPlan

RunTrial = Callable[[PhysicalRobot, TrialPlan], Trial]
"""Runs a physical trial and returns it; with a log, as read back from the log."""


@dataclass(frozen=True, eq=False)
class Database:
    """Controllers, their logged trials and the best hypotheses: the seeds of the next EA.

    Source: the paper, section III.

    Attributes:
        trials: Physical trials with their controllers, in the order in which they were run.
        diagnoses: Diagnoses, in the order in which they were made.
    """

    trials: tuple[Trial, ...] = ()
    diagnoses: tuple[Diagnosis, ...] = ()

    @property
    def controllers(self) -> tuple[Controller, ...]:
        """Distinct controllers that a physical robot has run, newest first."""
        drivers = dict.fromkeys(trial.plan.controller for trial in reversed(self.trials))
        return tuple(driver for driver in drivers if isinstance(driver, Controller))

    @property
    def evidence(self) -> tuple[Trial, ...]:
        """Trials that a diagnosis has to explain: all since the robot failed."""
        return tuple(trial for trial in self.trials if trial.plan.stage != "before")

    @property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """Hypotheses of the newest diagnosis, best first; empty before the first diagnosis."""
        if not self.diagnoses:
            return ()
        return tuple(candidate.hypothesis for candidate in self.diagnoses[-1].ranked)

    def with_trial(self, trial: Trial) -> "Database":
        """Returns a copy with one trial more."""
        return dataclasses.replace(self, trials=(*self.trials, trial))

    def with_diagnosis(self, diagnosis: Diagnosis) -> "Database":
        """Returns a copy with one diagnosis more."""
        return dataclasses.replace(self, diagnoses=(*self.diagnoses, diagnosis))


class Journal(Protocol):
    """Storage of the diagnoses of a recovery; ``RunTrial`` stores its trials."""

    def add(self, diagnosis: Diagnosis) -> None:
        """Stores a diagnosis after the earlier ones."""
        ...
