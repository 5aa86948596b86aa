"""Judgement of the best hypothesis of a search: its ranking, its alternatives and the verdict."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis.diagnosis import Candidate, Diagnosis
from selfmodel.diagnosis.evidence import Evidence
from selfmodel.diagnosis.joint_losses import JointLosses
from selfmodel.diagnosis.loss_functions import LossFunctions
from selfmodel.diagnosis.verdicts.detectable import detectable_severities
from selfmodel.diagnosis.verdicts.fit import Fit
from selfmodel.diagnosis.verdicts.model_error import any_fault_is_model_error
from selfmodel.diagnosis.verdicts.residual import Residual, residual_of
from selfmodel.diagnosis.verdicts.significance import TEST, is_better
from selfmodel.diagnosis.verdicts.undetectable import undetectable_faults
from selfmodel.diagnosis.verdicts.unsearched import best_unsearched_fault
from selfmodel.diagnosis.verdicts.verdict import all_diverged, fit_of, verdict_of
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import FaultKind
from selfmodel.trials.command_likeness import have_one_gait
from selfmodel.trials.observed_columns import observed_as
from selfmodel.trials.trial import Trial
from selfmodel.trials.trial_part import TrialPart, whole

EQUAL_DISTANCES = "equal distances"
"""Name of the test for a comparator with one distance per trial."""


@dataclass(frozen=True, eq=False)
class Question:
    """Trials to explain, and the losses of hypotheses about them.

    Attributes:
        evidence: Distances of hypotheses from trials.
        space: The hypotheses about the robot.
        trials: Trials to explain, or parts of them.
        names: Names of the trials of the whole diagnosis, by path.
        intact: Trials of the healthy robot, or parts of them.
        kept: Number of hypotheses in a ranking.
        losses: Loss functions of the trials.
        joints: Losses of single joints; None if the comparator has none.
    """

    evidence: Evidence
    space: HypothesisSpace
    trials: Sequence[Trial | TrialPart]
    names: Mapping[str, str]
    intact: Sequence[Trial | TrialPart]
    kept: int
    losses: LossFunctions
    joints: JointLosses | None = None

    @property
    def logs(self) -> list[str]:
        """Paths of the trials' logs."""
        return [whole(trial).trial.path for trial in self.trials]

    @property
    def healthy_losses(self) -> FloatArray | None:
        """Losses of the empty hypothesis on healthy trials, ``(pieces,)``; None without any.

        Encoders that are lost in the trials to explain are left out of the healthy ones.
        """
        if not self.intact:
            return None
        trials = [whole(trial).trial for trial in self.trials]
        parts = [whole(trial) for trial in self.intact]
        known = [replace(part, trial=observed_as(part.trial, trials)) for part in parts]
        return np.asarray(self.evidence.losses([INTACT], known)[0])


def judged(best: Hypothesis, compared: Iterable[Hypothesis], question: Question) -> Diagnosis:
    """Returns the diagnosis of a refined search, for a comparator with losses.

    Args:
        best: The best hypothesis.
        compared: Every hypothesis that was compared with the trials, the best included.
        question: The trials and their losses.
    """
    totals = _totals(compared, question)
    if not math.isfinite(totals[best]):
        best = by_distance(totals)[0]
    if not math.isfinite(totals[best]):
        ranked = _best_severities(by_distance(totals))
        return all_diverged(ranked[: question.kept], question.logs)
    others = [one for one in by_distance(totals) if one != best]
    ranked = _best_severities([best, *others])
    space, losses, kept = question.space, question.losses, question.kept
    indistinguishable = _indistinguishable(best, others, question)
    unsearched = best_unsearched_fault(best, space, losses)
    fit = _fit(best, question)
    verdict = verdict_of(best, fit, indistinguishable, unsearched)
    return Diagnosis(
        ranked=tuple(Candidate(one, totals[one]) for one in ranked[:kept]),
        trials=len(question.trials),
        intact_distance=totals[INTACT],
        indistinguishable=indistinguishable[:kept],
        verdict=verdict,
        test=TEST,
        unsearched=unsearched,
        undetectable=tuple(undetectable_faults(best, space, losses)[:kept]),
        detectable=() if best else tuple(detectable_severities(best, space, losses.damaged)),
        fit=fit,
        residual=_residual(best, question) if verdict == "unexplained" else None,
    )


def _fit(best: Hypothesis, question: Question) -> Fit:
    """Returns how well the best hypothesis predicts the trials."""
    losses, intact_losses = question.losses.damaged([best, INTACT])
    trials, healthy = (
        [whole(one).rows for one in some] for some in (question.trials, question.intact)
    )
    return fit_of(
        best,
        losses,
        intact_losses,
        question.healthy_losses,
        is_one_gait=have_one_gait(trials, healthy),
        joints=question.joints.excess(best) if question.joints else {},
    )


def _residual(best: Hypothesis, question: Question) -> Residual | None:
    """Returns the signals and the time of the loss that is left; None if they are unknown."""
    evidence, timeline = question.evidence, question.evidence.timeline(question.trials)
    if timeline is None:
        return None
    healthy = evidence.losses_by_signal(INTACT, question.intact) if question.intact else {}
    names = [question.names[path] for path in question.logs]
    signals = evidence.losses_by_signal(best, question.trials)
    losses = question.losses.damaged([best])[0]
    return residual_of(signals, healthy, losses, timeline, names)


def ranked_by_distance(found: Iterable[Hypothesis], question: Question) -> Diagnosis:
    """Returns the diagnosis of a comparator without losses: hypotheses by their distance.

    Args:
        found: Every hypothesis that was compared with the trials.
        question: The trials and their losses.
    """
    totals = _totals({*found, INTACT}, question)
    ranked, kept = by_distance(totals), question.kept
    best = ranked[0]
    if not math.isfinite(totals[best]):
        return all_diverged(_best_severities(ranked)[:kept], question.logs)
    parts = _without_severities(best)
    equal = _best_severities(
        one
        for one in ranked[1:]
        if totals[one] == totals[best] and not parts <= _without_severities(one)
    )
    fit = _fit(best, question)
    return Diagnosis(
        ranked=tuple(Candidate(one, totals[one]) for one in _best_severities(ranked)[:kept]),
        trials=len(question.trials),
        intact_distance=totals[INTACT],
        indistinguishable=equal[:kept],
        verdict=verdict_of(best, fit, equal, None),
        test=EQUAL_DISTANCES,
        fit=fit,
    )


def _totals(hypotheses: Iterable[Hypothesis], question: Question) -> dict[Hypothesis, float]:
    """Returns the distance of each hypothesis."""
    listed = list(hypotheses)
    distances = question.evidence.distances(listed, question.trials)
    return dict(zip(listed, map(float, distances), strict=True))


def by_distance(totals: Mapping[Hypothesis, float]) -> list[Hypothesis]:
    """Returns hypotheses by their distance; at equal distances, by their number of faults."""
    return sorted(totals, key=lambda one: (totals[one], len(one), one))


def _indistinguishable(
    best: Hypothesis, others: Sequence[Hypothesis], question: Question
) -> tuple[Hypothesis, ...]:
    """Hypotheses not significantly worse than the best, without supersets of its faults.

    Of hypotheses that differ in severities alone, the one with the smallest distance.
    """
    parts, losses = _without_severities(best), question.losses
    candidates = [other for other in others if not parts <= _without_severities(other)]
    best_losses, *rows = losses.damaged([best, *candidates])
    close = [
        one
        for one, row in zip(candidates, rows, strict=True)
        if not is_better(best_losses, row)
        and not any_fault_is_model_error(one, losses, question.space)
    ]
    if question.joints is not None:
        worse = question.joints.distinguishes(best, close)
        close = [one for one, is_worse in zip(close, worse, strict=True) if not is_worse]
    return _best_severities(close)


def _best_severities(hypotheses: Iterable[Hypothesis]) -> tuple[Hypothesis, ...]:
    """Returns the first of the hypotheses that differ in severities alone, in the same order."""
    first: dict[frozenset[tuple[FaultKind, str]], Hypothesis] = {}
    for one in hypotheses:
        first.setdefault(_without_severities(one), one)
    return tuple(first.values())


def _without_severities(hypothesis: Hypothesis) -> frozenset[tuple[FaultKind, str]]:
    return frozenset((fault.kind.without_severity, fault.part) for fault in hypothesis.faults)
