"""What tells more cheaply which hypotheses are far from the trials and which are near."""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis.comparator import Comparator, Screened
from selfmodel.diagnosis.evidence import Evidence
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial

OPENING = 1 / 3
"""The part of a whole trial that is simulated to tell what is far from what is near. It is the most
telling: later, contact has made any two simulations differ."""

FEWEST = 100
"""Control steps below which no opening is cut."""


@dataclass(frozen=True)
class Screen:
    """A cheaper look at trials.

    Attributes:
        evidence: Judges hypotheses.
        look: Gives the part of a trial that it looks at.
    """

    evidence: Evidence
    look: Callable[[Trial], Trial]

    def of(self, trials: Sequence[Trial]) -> list[Trial]:
        """Returns the parts of trials that are looked at."""
        return [self.look(trial) for trial in trials]

    def aside(self) -> "Screen":
        """Returns a screen that remembers apart; see ``Evidence.aside``."""
        return Screen(self.evidence.aside(), self.look)

    def losses(self, hypotheses: Sequence[Hypothesis], trials: Sequence[Trial]) -> FloatArray:
        """Returns how badly each hypothesis predicts what is looked at; see ``Evidence.losses``."""
        return self.evidence.losses(hypotheses, self.of(trials))


def screen_of(comparator: Comparator, simulator: Simulator, evidence: Evidence) -> Screen:
    """Returns a comparator's own screen; without one, the same comparator of the trials' openings.

    One that does not judge in pieces is not refined, and all there is decides.

    Args:
        comparator: Says what to simulate and how far it is from a trial.
        simulator: The self-model.
        evidence: What the comparator makes of whole trials.
    """
    if not evidence.is_piecewise:
        return Screen(evidence, lambda trial: trial)
    if isinstance(comparator, Screened):
        return Screen(Evidence(simulator, comparator.screen), lambda trial: trial)
    return Screen(Evidence(simulator, comparator), lru_cache(partial(_opening, comparator)))


def _opening(comparator: Comparator, trial: Trial) -> Trial:
    """The first part of a trial; all of it where that does not tell enough by itself."""
    steps = max(round(OPENING * trial.behaviour.steps), min(FEWEST, trial.behaviour.steps))
    opening = dataclasses.replace(trial, behaviour=trial.behaviour.first(steps))
    try:
        comparator.request(opening)
    except InputError:
        return trial
    return opening
