"""Low-cost surrogate of a comparator on trials, used to pre-select hypotheses."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis.comparator import Comparator, ComparatorWithSurrogate
from selfmodel.diagnosis.evidence import Evidence
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial

OPENING = 1 / 3
"""Part of a trial that is simulated, from its beginning, if the comparator has no surrogate.

The first part discriminates best: later, contact has made any two simulations differ."""

MIN_OPENING = 100
"""Control steps of the shortest opening; a shorter trial is simulated whole."""


@dataclass(frozen=True)
class Surrogate:
    """Low-cost losses and distances on some trials.

    Attributes:
        evidence: Losses of the surrogate comparator.
        trials: The trials, or their openings.
    """

    evidence: Evidence
    trials: Sequence[Trial]

    def losses(self, hypotheses: Sequence[Hypothesis]) -> FloatArray:
        """Returns the losses of each hypothesis, ``(n, pieces)``; see ``Evidence.losses``."""
        return self.evidence.losses(hypotheses, self.trials)

    def distances(self, hypotheses: Sequence[Hypothesis]) -> FloatArray:
        """Returns the distance of each hypothesis, ``(n,)``; see ``Evidence.distances``."""
        return self.evidence.distances(hypotheses, self.trials)


def own_surrogate(comparator: Comparator, simulator: Simulator) -> Evidence | None:
    """Returns the evidence of the comparator's own surrogate; None if it has none."""
    if isinstance(comparator, ComparatorWithSurrogate):
        return Evidence(simulator, comparator.surrogate)
    return None


def surrogate_of(evidence: Evidence, own: Evidence | None, trials: Sequence[Trial]) -> Surrogate:
    """Returns the surrogate of a comparator on trials.

    The surrogate of a comparator without losses is the comparator itself: its hypotheses are not
    refined, so its distances from the whole trials make the ranking. Otherwise it is the
    comparator's own surrogate, or the comparator on the openings of the trials.

    Args:
        evidence: Losses of the comparator.
        own: Losses of the comparator's own surrogate, if it has one.
        trials: Trials that the comparator can judge.
    """
    if not evidence.is_piecewise(trials):
        return Surrogate(evidence, trials)
    if own is not None:
        return Surrogate(own, trials)
    return Surrogate(evidence, [_opening(evidence, trial) for trial in trials])


def _opening(evidence: Evidence, trial: Trial) -> Trial:
    """The first part of a trial, or the whole trial if the comparator cannot judge the part."""
    steps = max(round(OPENING * trial.behaviour.steps), min(MIN_OPENING, trial.behaviour.steps))
    opening = dataclasses.replace(trial, behaviour=trial.behaviour.first(steps))
    try:
        evidence.check([opening])
    except InputError:
        return trial
    return opening
