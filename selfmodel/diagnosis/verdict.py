"""The verdict on the best hypothesis of a search: a function of the trials and the hypotheses.

It does not depend on the random numbers of the search: alternatives to the best hypothesis come
from its neighbourhood, whatever the search compared. (The best hypothesis itself and the rest of
the ranking are the search's.)
"""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis.alternatives import (
    best_severities,
    detectable_severities,
    indistinguishable,
    undetectable,
    unsearched_fault,
    without_severities,
)
from selfmodel.diagnosis.diagnosis import (
    Candidate,
    Diagnosis,
    Fit,
    Residual,
    UnsearchedFault,
    Verdict,
)
from selfmodel.diagnosis.joints import excesses
from selfmodel.diagnosis.problem import Problem
from selfmodel.diagnosis.search import by_distance
from selfmodel.diagnosis.significance import (
    MIN_Z_OF_JOINT,
    MIN_Z_OF_ONE_GAIT,
    MIN_Z_OF_OTHER_GAITS,
    TEST,
    excess_over_healthy,
)
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.trials.trial import have_one_gait, whole

EQUAL_DISTANCES = "equal distances"
"""Name of the test for a comparator with one distance per trial."""

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

    Args:
        best: The best hypothesis.
        fit: Its loss, compared with that of healthy trials.
        alike: Hypotheses that are indistinguishable from the best.
        unsearched: The best hypothesis with a fault of an unsearched kind, if it is better.
    """
    if unsearched is not None or fit.is_unexplained:
        return "unexplained"
    if alike:
        return "ambiguous"
    return "explained" if best else "intact"


def judged(best: Hypothesis, compared: Iterable[Hypothesis], problem: Problem) -> Diagnosis:
    """Returns the diagnosis of a refined search, for a comparator with losses.

    Args:
        best: The best hypothesis.
        compared: Every hypothesis that was compared with the trials, the best included: they are
            ranked.
        problem: The trials and their losses.
    """
    totals = _totals(compared, problem)
    if not math.isfinite(totals[best]):
        best = by_distance(totals)[0]
    if not math.isfinite(totals[best]):
        return _all_diverged(by_distance(totals), problem)
    ranked = best_severities([best, *(one for one in by_distance(totals) if one != best)])
    kept = problem.kept
    alike = indistinguishable(best, problem)
    unsearched = unsearched_fault(best, problem)
    fit = _fit_of(best, problem)
    verdict = verdict_of(best, fit, alike, unsearched)
    severities = () if best else detectable_severities(best, problem.space, problem.losses)
    return Diagnosis(
        ranked=tuple(Candidate(one, totals[one]) for one in ranked[:kept]),
        trials=len(problem.trials),
        intact_distance=totals[INTACT],
        indistinguishable=tuple(alike[:kept]),
        verdict=verdict,
        test=TEST,
        unsearched=unsearched,
        undetectable=tuple(undetectable(best, problem)[:kept]),
        detectable=tuple(severities),
        fit=fit,
        residual=_residual_of(best, problem) if verdict == "unexplained" else None,
    )


def ranked_by_distance(found: Iterable[Hypothesis], problem: Problem) -> Diagnosis:
    """Returns the diagnosis of a comparator without losses: hypotheses by their distance.

    There is no test and no refinement: the best hypothesis, and those at the same distance, are of
    those that the EA compared.

    Args:
        found: Every hypothesis that was compared with the trials.
        problem: The trials and their distances.
    """
    totals = _totals({*found, INTACT}, problem)
    ranked, kept = by_distance(totals), problem.kept
    best = ranked[0]
    if not math.isfinite(totals[best]):
        return _all_diverged(ranked, problem)
    parts = without_severities(best)
    equal = best_severities(
        one
        for one in ranked[1:]
        if totals[one] == totals[best] and not parts <= without_severities(one)
    )
    fit = _fit_of(best, problem)
    return Diagnosis(
        ranked=tuple(Candidate(one, totals[one]) for one in best_severities(ranked)[:kept]),
        trials=len(problem.trials),
        intact_distance=totals[INTACT],
        indistinguishable=equal[:kept],
        verdict=verdict_of(best, fit, equal, None),
        test=EQUAL_DISTANCES,
        fit=fit,
    )


def _totals(hypotheses: Iterable[Hypothesis], problem: Problem) -> dict[Hypothesis, float]:
    """Returns the distance of each hypothesis."""
    listed = list(hypotheses)
    distances = problem.table.distances(listed, problem.trials)
    return dict(zip(listed, map(float, distances), strict=True))


def _all_diverged(ranked: Sequence[Hypothesis], problem: Problem) -> Diagnosis:
    """Returns the diagnosis of trials on which the simulation of every hypothesis diverged.

    The verdict is ``unexplained``: the trials do not support any of the hypotheses.
    """
    logs = ", ".join(whole(trial).trial.path for trial in problem.trials)
    kept = best_severities(ranked)[: problem.kept]
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


def _fit_of(best: Hypothesis, problem: Problem) -> Fit:
    """Returns how well the best hypothesis predicts the trials.

    Joints are suspected only if the trials have the gait of the healthy ones: another one loads
    the joints otherwise, and 16 of 24 healthy robots would be suspected.
    """
    losses, intact = problem.losses([best, INTACT])
    rows = ([whole(one).rows for one in each] for each in (problem.trials, problem.healthy_trials))
    is_one_gait = have_one_gait(*rows)
    found = excesses(INTACT, problem) if is_one_gait and not best else {}
    reference = problem.reference
    return Fit(
        loss=float(losses.mean()),
        intact_loss=float(intact.mean()),
        healthy_loss=None if reference is None else float(reference.mean()),
        excess=None if reference is None else excess_over_healthy(losses, reference),
        threshold=MIN_Z_OF_ONE_GAIT if is_one_gait else MIN_Z_OF_OTHER_GAITS,
        has_faults=bool(best),
        left=None if reference is None else _share_left(losses, intact, reference),
        joints={joint: z for joint, z in found.items() if z >= MIN_Z_OF_JOINT},
    )


def _share_left(losses: FloatArray, intact: FloatArray, healthy: FloatArray) -> float | None:
    """Returns the share of the empty hypothesis's loss beyond the reference that is left."""
    beyond = float(intact.mean()) - float(healthy.mean())
    if not beyond > 0:
        return None
    return min(max((float(losses.mean()) - float(healthy.mean())) / beyond, 0.0), 1.0)


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
        trial=problem.names[whole(trials[trial]).trial.path],
        begin=float(timeline.begin[first]),
        end=float(timeline.end[last]),
    )
