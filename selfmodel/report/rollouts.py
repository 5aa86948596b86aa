"""Rollouts of the trials of a report under the hypotheses that are shown."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.report.subject import Subject
from selfmodel.simulation.trial_replay import replay
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trial import Trial


@dataclass(frozen=True, eq=False)
class Rollout:
    """A trial simulated in closed loop, from the initial pose, under one hypothesis.

    Attributes:
        name: Name in legends, such as ``best hypothesis``.
        hypothesis: The hypothesis.
        behaviour: All signals.
        diverged: Whether the simulation diverged; the signals are then invalid.
    """

    name: str
    hypothesis: Hypothesis
    behaviour: Behaviour
    diverged: bool

    @property
    def displacement(self) -> float:
        """Forward displacement, m; NaN if the simulation diverged."""
        x = self.behaviour["base_position"][:, 0]
        return np.nan if self.diverged else float(x[-1] - x[0])


@dataclass(frozen=True, eq=False)
class TrialRollouts:
    """A trial and its rollouts.

    Attributes:
        name: Name of the trial.
        trial: The trial.
        rollouts: Rollouts, best hypothesis first; of a healthy trial, that of the self-model.
    """

    name: str
    trial: Trial
    rollouts: tuple[Rollout, ...]


def rollouts_of(subject: Subject) -> tuple[TrialRollouts, ...]:
    """Returns the rollouts of every trial of a report."""
    after = [("best hypothesis", subject.diagnosis.best)]
    if subject.runner_up is not None:
        after.append(("runner-up", subject.runner_up))
    before = [("self-model", INTACT)]
    return tuple(
        _rolled_out(subject, trial, hypotheses)
        for trials, hypotheses in ((subject.healthy, before), (subject.damaged, after))
        for trial in trials
    )


def _rolled_out(
    subject: Subject, trial: Trial, hypotheses: Sequence[tuple[str, Hypothesis]]
) -> TrialRollouts:
    found = []
    for name, hypothesis in hypotheses:
        result = replay(trial, hypothesis, subject.simulator)
        signals = {signal: result.simulated[signal] for signal in SIGNALS}
        simulated = Behaviour(result.simulated.names, trial.behaviour.time, signals)
        found.append(Rollout(name, hypothesis, simulated, result.diverged))
    return TrialRollouts(subject.names[trial.path], trial, tuple(found))
