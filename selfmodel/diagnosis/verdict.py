"""The verdict on the best hypothesis of a search: a function of the trials and the hypotheses.

``verdict_of`` decides it; ``diagnosis_of`` makes it ``not judged`` where the self-model cannot
carry it, and a search of which every simulation diverged is ``unexplained``.

It does not depend on the random numbers of the search: alternatives to the best hypothesis come
from its neighbourhood, whatever the search compared. (The best hypothesis, of which a refit may
leave faults out, the rest of the ranking, and a fault that was passed over are the search's.)

Probabilities are from the statistics that decide the verdict. A hypothesis over which the best one
leads by ``z`` standard errors (``leads_of``) has the weight ``exp(-z^2 / 2)``, the best has 1.
Those with ``z`` below ``MIN_Z``, 1.1 % of the best's weight, cannot be told apart. Beside all of
them there is a fault that was not searched, whose odds grow with the loss that is left
(``unlikeness``). A probability is that of the kinds and parts of all faults, at about the named
severities, if no fault is too small to show. The constants are of recordings of our own generator;
docs/results has the reliability on those of another one.
"""

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from selfmodel.diagnosis import search, significance
from selfmodel.diagnosis.adequacy import (
    MOVING_LONGER,
    contradiction,
    doubt_of,
    fit_of,
    is_too_high,
    supported,
    unlikeness,
    unreproduced,
)
from selfmodel.diagnosis.alternatives import (
    best_severities,
    detectable_severities,
    indistinguishable,
    leads_of,
    passed_over,
    undetectable,
    unsearched_fault,
)
from selfmodel.diagnosis.diagnosis import (
    Candidate,
    Diagnosis,
    Doubt,
    Fit,
    Residual,
    UnsearchedFault,
    Verdict,
)
from selfmodel.diagnosis.problem import Problem
from selfmodel.faults.hypothesis import INTACT, Hypothesis

UNKNOWN = 0.03
"""Least probability that a clear diagnosis is wrong. Of 1,134 that were ``explained``, with gaps of
0.05 to 0.2, 30 were wrong (1.9 to 3.8 %): 23 of 541 of one trial, 7 of 593 of three. Of 173 clear
diagnoses of one trial of another generator, 3 were."""

STEEPNESS = 4.0
"""Power of ``unlikeness`` in the odds of a fault that was not searched, which are even at the limit
of the verdict. In 52 diagnoses of known faults and missing ones, the most probable power is 2.5,
with a limit of 1.6 it is 4.5: in 38 of them, of trials of 4 s, right hypotheses had up to 1.84."""

NO_TEST = "none: every simulation diverged"
"""Name of the test of a diagnosis without a finite distance."""

WINDOW = 8
"""Neighbouring pieces among which the worst time of a residual is found."""

MAX_SIGNALS = 3
"""Signals of a residual that are named."""


def verdict_of(
    best: Hypothesis,
    fit: Fit,
    alike: Sequence[Hypothesis],
    unsearched: UnsearchedFault | None,
) -> Verdict:
    """Returns the verdict about the best hypothesis of a diagnosis.

    ``alike`` are the hypotheses that are indistinguishable from the best, ``unsearched`` is the
    best one with a fault of an unsearched kind, if that is better. ``diagnosis_of`` says
    ``not judged`` in place of a verdict that the trials do not carry.
    """
    if unsearched is not None or is_too_high(fit) or fit.joints:
        return "unexplained"
    if alike:
        return "ambiguous"
    return "explained" if best else "intact"


def diagnosis_of(
    problem: Problem, compared: Iterable[Hypothesis], best: Hypothesis | None = None
) -> Diagnosis:
    """Returns the diagnosis of a search.

    Args:
        problem: The trials and their losses.
        compared: Every hypothesis that was compared with the trials: they are ranked.
        best: The best of them by the search; None for that with the smallest distance.
    """
    listed = list({*compared, INTACT})
    distances = problem.table.distances(listed, problem.trials)
    totals = dict(zip(listed, map(float, distances), strict=True))
    ranked, kept = search.by_distance(totals), problem.settings.kept
    if best is None or not math.isfinite(totals[best]):
        best = ranked[0]
    if not math.isfinite(totals[best]):
        return _all_diverged(ranked, problem)
    found = best
    best, by_refit = supported(found, problem)
    totals.setdefault(best, float(problem.table.distances([best], problem.trials)[0]))
    order = best_severities([best, *ranked])
    leads = leads_of(best, by_refit)
    alike, unsearched = indistinguishable(leads), unsearched_fault(best, by_refit)
    fit = fit_of(best, by_refit)
    verdict = verdict_of(best, fit, alike, unsearched)
    explained = INTACT if verdict == "unexplained" else best
    accused = explained if unsearched is None else unsearched.hypothesis
    doubt = unreproduced(fit, by_refit) or contradiction(found, problem)
    if doubt is None and verdict == "intact" and not found:
        fault = passed_over(ranked, problem)
        if fault is not None:
            doubt, alike = _untold(fault, problem), [fault]
    if doubt is None and verdict != "intact":
        doubt = doubt_of(accused, fit, by_refit)
    probability: dict[str, float] = {}
    if doubt is None and fit.healthy_loss is not None:
        nearest = best_severities([*alike, *sorted(leads, key=lambda one: leads[one])])
        misses = unsearched is not None or bool(fit.joints)
        some = {one: leads[one] for one in nearest}
        probability = probabilities(best, some, fit, misses=misses)
    severities = []
    if not best and doubt is None:
        severities = detectable_severities(best, problem.space, problem.losses, problem.observer)
    return Diagnosis(
        ranked=tuple(Candidate(one, totals[one]) for one in order[:kept]),
        trials=len(problem.trials),
        intact_distance=totals[INTACT],
        indistinguishable=tuple(alike[:kept]),
        verdict=verdict if doubt is None else "not judged",
        test=significance.TEST,
        unsearched=unsearched,
        undetectable=tuple(undetectable(best, by_refit)[:kept]),
        detectable=tuple(severities),
        fit=fit,
        residual=_residual_of(best, by_refit) if verdict == "unexplained" else None,
        doubt=doubt,
        probability=probability,
        left_out=tuple(Hypothesis((fault,)) for fault in found.lacking(best)),
    )


def probabilities(
    best: Hypothesis, leads: Mapping[Hypothesis, float], fit: Fit, *, misses: bool
) -> dict[str, float]:
    """Returns the probabilities of the best hypothesis and its neighbours, by their notation.

    Args:
        best: The best hypothesis.
        leads: Its lead over each neighbour, standard errors. Of neighbours that differ in
            severities alone, there is the one with the smallest lead.
        fit: How well the best hypothesis predicts the trials.
        misses: Whether a fault of an unsearched kind predicts the trials better, or a joint moves
            otherwise.

    Returns:
        Numbers of which the rest up to 1 is the probability of a fault that was not searched, of a
        further one, or of an error.
    """
    weights = {best: 1.0} | {one: math.exp(-(lead**2) / 2) for one, lead in leads.items()}
    odds = unlikeness(fit) ** STEEPNESS
    share = UNKNOWN + (0.0 if misses else (1 - 2 * UNKNOWN) / (1 + odds))
    total = sum(weights.values())
    return {str(one): share * weight / total for one, weight in weights.items()}


def _untold(fault: Hypothesis, problem: Problem) -> Doubt:
    """Returns the doubt about a robot without a fault, most of whose loss a fault explains."""
    intact, other = problem.losses([INTACT, fault])
    return Doubt(
        f"{fault} leaves {other.mean() / intact.mean():.0%} of the loss without a fault, and leads "
        f"by {significance.lead(other, intact):.1f} standard errors, where {significance.MIN_Z:g} "
        f"are needed: few pieces of the trials tell",
        f"check whether {fault.words}. If it is, mend it. If not, {MOVING_LONGER}",
        f"it is not known whether something is wrong: perhaps {fault.words}, but too little of "
        f"these logs shows it",
    )


def _all_diverged(ranked: Sequence[Hypothesis], problem: Problem) -> Diagnosis:
    logs = ", ".join(part.trial.path for part in problem.trials)
    kept = best_severities(ranked)[: problem.settings.kept]
    return Diagnosis(
        ranked=tuple(Candidate(hypothesis, math.inf) for hypothesis in kept),
        trials=len(problem.trials),
        intact_distance=math.inf,
        indistinguishable=(),
        verdict="unexplained",
        test=NO_TEST,
        reason=(
            f"no simulation of the trials remained finite: check the model, and the units and the "
            f"odometry of {logs}"
        ),
    )


def _residual_of(best: Hypothesis, problem: Problem) -> Residual | None:
    """Returns the signals and the time of the loss that is left; None if they are unknown."""
    table, trials = problem.table, problem.trials
    timeline, (losses,) = table.timeline(trials), problem.losses([best])
    if timeline is None or not np.isfinite(losses).all():
        return None
    healthy = table.by_signal(INTACT, problem.healthy_trials)
    excess = {
        name: float(parts.mean()) - (float(healthy[name].mean()) if name in healthy else 0.0)
        for name, parts in table.by_signal(best, trials).items()
    }
    largest = sorted((name for name in excess if excess[name] > 0), key=lambda name: -excess[name])
    if not largest:
        return None
    width = min(WINDOW, len(losses))
    first = int(np.argmax(np.convolve(losses, np.ones(width), mode="valid")))
    trial = int(timeline.trial[first])
    last = min(first + width - 1, int(np.flatnonzero(timeline.trial == trial)[-1]))
    return Residual(
        signals={name: excess[name] for name in largest[:MAX_SIGNALS]},
        trial=problem.names[trials[trial].trial.path],
        begin=float(timeline.begin[first]),
        end=float(timeline.end[last]),
    )
