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

LEVELS, MANY_TRIALS = 2, 3
"""Surrogates, each of the one before, and trials from which on the last one is used."""

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


def own_surrogates(comparator: Comparator, simulator: Simulator) -> tuple[Evidence, ...]:
    """Returns the evidence of the comparator's own surrogate and of that one's, as far as they are.

    Args:
        comparator: The comparator.
        simulator: The self-model.
    """
    found: list[Evidence] = []
    current = comparator
    while len(found) < LEVELS and isinstance(current, ComparatorWithSurrogate):
        current = current.surrogate
        found.append(Evidence(simulator, current))
    return tuple(found)


def surrogate_of(evidence: Evidence, own: Sequence[Evidence], trials: Sequence[Trial]) -> Surrogate:
    """Returns the surrogate of a comparator on trials.

    The surrogate of a comparator without losses is the comparator itself: its hypotheses are not
    refined, so its distances from the whole trials make the ranking. Otherwise it is the
    comparator's own surrogate, or the comparator on the openings of the trials. Of ``MANY_TRIALS``
    or more, the surrogate of the surrogate is enough: together they have as many pieces as one. A
    surrogate that cannot judge a trial, such as one with many late steps, is left out.

    Args:
        evidence: Losses of the comparator.
        own: Losses of the comparator's own surrogates; see ``own_surrogates``.
        trials: Trials that the comparator can judge.
    """
    if not evidence.is_piecewise(trials):
        return Surrogate(evidence, trials)
    for cheaper in reversed(own if len(trials) >= MANY_TRIALS else own[:1]):
        try:
            cheaper.check(trials)
        except InputError:
            continue
        return Surrogate(cheaper, trials)
    if own:
        return Surrogate(evidence, trials)
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
