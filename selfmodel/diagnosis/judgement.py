"""Judgement of the best hypothesis of a search: its ranking, its alternatives and the verdict."""

import math
from collections.abc import Iterable, Mapping, Sequence

from selfmodel.diagnosis.diagnosis import Candidate, Diagnosis
from selfmodel.diagnosis.question import Question
from selfmodel.diagnosis.verdicts.detectable import detectable_severities
from selfmodel.diagnosis.verdicts.fit import Fit
from selfmodel.diagnosis.verdicts.model_error import any_fault_is_model_error
from selfmodel.diagnosis.verdicts.residual import Residual, residual_of
from selfmodel.diagnosis.verdicts.significance import MIN_Z_OF_JOINT, TEST, is_better
from selfmodel.diagnosis.verdicts.undetectable import undetectable_faults
from selfmodel.diagnosis.verdicts.unsearched import best_unsearched_fault
from selfmodel.diagnosis.verdicts.verdict import all_diverged, fit_of, verdict_of
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.kind import FaultKind
from selfmodel.trials.trial import have_one_gait, whole

EQUAL_DISTANCES = "equal distances"
"""Name of the test for a comparator with one distance per trial."""


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
    is_one_gait = have_one_gait(trials, healthy)
    return fit_of(
        best,
        losses,
        intact_losses,
        question.healthy_losses,
        is_one_gait=is_one_gait,
        joints=_suspected_joints(question) if is_one_gait and not best else {},
    )


def _suspected_joints(question: Question) -> dict[str, float]:
    """Returns the joints that the empty hypothesis predicts worse than in healthy trials.

    The trials have the gait of the healthy ones: another one loads the joints otherwise, and 16 of
    24 healthy robots would be suspected.
    """
    excess = question.joints.excess(INTACT) if question.joints else {}
    return {joint: z for joint, z in excess.items() if z >= MIN_Z_OF_JOINT}


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
