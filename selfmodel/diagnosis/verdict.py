"""The verdict on the best hypothesis of a search: a function of the trials and the hypotheses.

It does not depend on the random numbers of the search: alternatives to the best hypothesis come
from its neighbourhood, whatever the search compared. (The best hypothesis, of which a refit may
leave faults out, and the rest of the ranking are the search's.)
"""

import math
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from selfmodel.diagnosis import search, significance
from selfmodel.diagnosis.adequacy import doubt_of
from selfmodel.diagnosis.diagnosis import (
    Candidate,
    DetectableSeverity,
    Diagnosis,
    Fit,
    Residual,
    UnsearchedFault,
    Verdict,
)
from selfmodel.diagnosis.joints import excesses, joints_of, lead_at_joints
from selfmodel.diagnosis.losses import LossFunction, by_total_loss
from selfmodel.diagnosis.probability import probabilities, unlikeness
from selfmodel.diagnosis.problem import Problem
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import ENVIRONMENT, Fault, FaultKind
from selfmodel.faults.registry import ALL_KINDS
from selfmodel.progress import Observer, followed, ignore
from selfmodel.trials.trial import have_one_gait

EQUAL_DISTANCES = "equal distances"
"""Name of the test for a comparator with one distance per trial."""

NO_TEST = "none: every simulation diverged"
"""Name of the test of a diagnosis without a finite distance."""

WINDOW = 8
"""Neighbouring pieces among which the worst time of a residual is found."""

MAX_SHARE = 0.1
"""Share of the loss that a fault explains beside others, up to which it has to beat a refit."""

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
    best one with a fault of an unsearched kind, if that is better.
    """
    if unsearched is not None or is_too_high(fit) or fit.joints:
        return "unexplained"
    if alike:
        return "ambiguous"
    return "explained" if best else "intact"


def is_too_high(fit: Fit) -> bool:
    """Returns whether the loss is higher than that of healthy trials, significantly and by much."""
    return unlikeness(fit) > 1.0


def diagnosis_of(
    problem: Problem, compared: Iterable[Hypothesis], best: Hypothesis | None = None
) -> Diagnosis:
    """Returns the diagnosis of a search.

    A comparator with one distance per trial has no test: the best hypothesis, and those at the same
    distance, are of those that were compared.

    Args:
        problem: The trials and their losses.
        compared: Every hypothesis that was compared with the trials: they are ranked.
        best: The best of them by the paired tests; None for that with the smallest distance.
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
    leads = leads_of(best, by_refit) if problem.has_test else {}
    if problem.has_test:
        alike, unsearched = indistinguishable(leads), unsearched_fault(best, by_refit)
    else:
        equal = [one for one in order if totals[one] == totals[best]]
        alike, unsearched = [one for one in equal if not _has_more(one, best)], None
    fit = _fit_of(best, by_refit)
    verdict = verdict_of(best, fit, alike, unsearched)
    explained = INTACT if verdict == "unexplained" else best
    accused = explained if unsearched is None else unsearched.hypothesis
    doubt = None if verdict == "intact" else doubt_of(accused, fit, by_refit)
    probability: dict[str, float] = {}
    if problem.has_test and doubt is None and fit.healthy_loss is not None:
        nearest = best_severities([*alike, *sorted(leads, key=lambda one: leads[one])])
        misses = unsearched is not None or bool(fit.joints)
        some = {one: leads[one] for one in nearest}
        probability = probabilities(best, some, fit, misses=misses)
    has_severities = problem.has_test and not best and doubt is None
    severities = (
        detectable_severities(best, problem.space, problem.losses, problem.observer)
        if has_severities
        else []
    )
    return Diagnosis(
        ranked=tuple(Candidate(one, totals[one]) for one in order[:kept]),
        trials=len(problem.trials),
        intact_distance=totals[INTACT],
        indistinguishable=tuple(alike[:kept]),
        verdict=verdict if doubt is None else "not judged",
        test=significance.TEST if problem.has_test else EQUAL_DISTANCES,
        unsearched=unsearched,
        undetectable=tuple(undetectable(best, by_refit)[:kept]) if problem.has_test else (),
        detectable=tuple(severities),
        fit=fit,
        residual=_residual_of(best, by_refit) if verdict == "unexplained" else None,
        doubt=doubt,
        probability=probability,
        left_out=tuple(Hypothesis((fault,)) for fault in _missing(best, found)),
    )


def _all_diverged(ranked: Sequence[Hypothesis], problem: Problem) -> Diagnosis:
    """Returns the diagnosis of trials on which the simulation of every hypothesis diverged."""
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


def supported(best: Hypothesis, problem: Problem) -> tuple[Hypothesis, Problem]:
    """Returns a hypothesis without the faults that an error of the self-model explains as well.

    A fault beside others is doubted if it explains little of the loss, or if the others alone do
    not make the trials unexplained. It is left out if a self-model that is fitted to the healthy
    trials and to these, with the others in these, predicts all of them as well as one that is
    fitted with all the faults in them. The problem that is returned has the losses by that
    self-model, which has absorbed the faults left out.

    Nothing is left out of a hypothesis that does not explain the trials: a fault is missing.
    """
    rest, by_refit = best, problem
    if problem.calibrate is None or problem.healthy([INTACT]) is None or len(best) < 2:
        return best, problem
    if best.spec_part or is_too_high(_fit_of(best, problem)):  # a fit has the compiled model
        return best, problem
    while fewer := [one for one in problem.space.with_one_less(rest) if 0 < len(one) < len(rest)]:
        for one in by_total_loss(fewer, problem.losses):
            if (found := _without_some(one, best, problem)) is not None:
                rest, by_refit = found
                break
        else:
            break
    return rest, by_refit


def _without_some(
    fewer: Hypothesis, best: Hypothesis, problem: Problem
) -> tuple[Hypothesis, Problem] | None:
    """Returns fewer faults and the problem of a refit with which they explain as much, if any."""
    others = _missing(fewer, best)
    if not others or not all(fault.kind.affects_dynamics for fault in others):
        return None  # the readings of a sensor are not fitted
    rest = search.with_fitted_severities(fewer, problem.coarse, problem.space)
    losses = problem.losses([best, rest, INTACT])
    if len(rest) < len(fewer) or not np.isfinite(losses).all():
        return None
    loss, without, intact = losses.mean(axis=1)
    is_small = without - loss <= MAX_SHARE * (intact - loss)
    if not is_small and is_too_high(_fit_of(rest, problem)):
        return None
    by_some, by_all = problem.refitted(rest), problem.refitted(best)
    if by_some is None or by_all is None:
        return None
    with_some, with_all = (
        np.concatenate([*by.losses([one]), *by.table.losses([INTACT], by.healthy_trials)])
        for by, one in ((by_some, rest), (by_all, best))
    )
    joints = joints_of(others, problem) if problem.has_joints else []
    is_needed = significance.is_better(with_all, with_some) or any(
        significance.joint_is_better(
            by_all.of_joint(joint, [best])[0], by_some.of_joint(joint, [rest])[0]
        )
        for joint in joints
    )
    return None if is_needed else (rest, by_some)


def _missing(fewer: Hypothesis, more: Hypothesis) -> list[Fault]:
    """Returns the faults of a hypothesis that another lacks, whatever their severities."""
    kept = without_severities(fewer)
    return [one for one in more.faults if not without_severities(Hypothesis((one,))) <= kept]


def _fit_of(best: Hypothesis, problem: Problem) -> Fit:
    """Returns how well the best hypothesis predicts the trials.

    Trials with the gait of the healthy ones are compared with all of these. Others are compared
    with the one that is predicted worst: gaits differ in how hard they are to predict, which the
    scatter of the pieces of all healthy trials does not contain. Joints are suspected only in the
    same gait: another one loads the joints otherwise, and 16 of 24 healthy robots would be
    suspected.
    """
    losses, intact = problem.losses([best, INTACT])
    rows = ([part.rows for part in each] for each in (problem.trials, problem.healthy_trials))
    is_one_gait = have_one_gait(*rows)
    joints = excesses(INTACT, problem) if is_one_gait and not best else {}
    loss, intact_loss = float(losses.mean()), float(intact.mean())
    healthy_loss = excess = left = None
    reference = problem.reference if is_one_gait else problem.hardest
    if reference is not None:
        healthy_loss = float(reference.mean())
        excess = significance.excess_over_healthy(losses, reference)
        left = significance.share_left(loss, intact_loss, healthy_loss)
    return Fit(
        loss,
        intact_loss,
        healthy_loss,
        excess,
        threshold=significance.MIN_Z_OF_ONE_GAIT
        if is_one_gait
        else significance.MIN_Z_OF_OTHER_GAITS,
        has_faults=bool(best),
        left=left,
        joints={joint: z for joint, z in joints.items() if z >= significance.MIN_Z_OF_JOINT},
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


def best_severities(hypotheses: Iterable[Hypothesis]) -> list[Hypothesis]:
    """Returns the first of the hypotheses that differ in severities alone, in the same order."""
    first: dict[frozenset[tuple[FaultKind, str]], Hypothesis] = {}
    for one in hypotheses:
        first.setdefault(without_severities(one), one)
    return list(first.values())


def without_severities(hypothesis: Hypothesis) -> frozenset[tuple[FaultKind, str]]:
    """Returns the kind and the part of each fault."""
    return frozenset((fault.kind.without_severity, fault.part) for fault in hypothesis.faults)


def _has_more(one: Hypothesis, best: Hypothesis) -> bool:
    """Returns whether a hypothesis has all faults of the best one, whatever their severities."""
    return without_severities(best) <= without_severities(one)


def leads_of(best: Hypothesis, problem: Problem) -> dict[Hypothesis, float]:
    """Returns by how many standard errors the best hypothesis predicts better than its neighbours.

    The neighbours have one fault less than the best, or another fault of the searched kinds in the
    place of one of its faults, or are single faults or none; they have at most as many faults. The
    eight best by the surrogate are compared, with the severity of the other fault fitted, and the
    empty hypothesis. The lead is that of the loss, or that at a joint at which the two differ;
    infinite over a neighbour of whose faults one corrects model error. They are sorted by total
    loss.
    """
    space = problem.space
    neighbours = dict.fromkeys(
        [*space.with_one_less(best), *space.with_one_replaced(best), *space.with_one_more(INTACT)]
    )
    smaller = [one for one in neighbours if len(one) <= len(best) and not _has_more(one, best)]
    few = best_severities(by_total_loss(smaller, problem.coarse))[: search.SHORTLIST_SIZE]
    fitted = [
        _with_fitted_others(one, best, problem)
        for one in followed(few, "alternatives", problem.observer)
    ]
    others = [one for one in dict.fromkeys([*few, *fitted, INTACT]) if not _has_more(one, best)]
    leads = {}
    for one in by_total_loss(others, problem.losses):
        lead = significance.lead(*problem.losses([best, one]))
        if problem.has_joints:
            lead = max(lead, lead_at_joints(best, one, problem))
        if lead < significance.MIN_Z and search.any_fault_is_model_error(one, problem):
            lead = math.inf
        leads[one] = lead
    return leads


def indistinguishable(leads: Mapping[Hypothesis, float]) -> list[Hypothesis]:
    """Returns the neighbours over which the best hypothesis has no significant lead.

    Of those that differ in severities alone, there is the one with the smallest loss.
    """
    return best_severities(one for one, lead in leads.items() if lead < significance.MIN_Z)


def _with_fitted_others(one: Hypothesis, best: Hypothesis, problem: Problem) -> Hypothesis:
    """Returns a neighbour with the severities fitted of the faults that the best lacks.

    A neighbour that is far from the best by the surrogate stays as it is: no fit makes up for it.
    """
    best_losses, losses = problem.coarse([best, one])
    if losses.mean() > significance.LOSS_RATIO * best_losses.mean() + significance.NEGLIGIBLE_LOSS:
        return one
    for fault in one.faults:
        if fault not in best.faults and fault in one.faults:
            index = one.faults.index(fault)
            one = search.with_fitted_severity(one, index, problem.coarse, problem.space)
    return one


def undetectable(best: Hypothesis, problem: Problem) -> list[Hypothesis]:
    """Returns the best hypothesis with one fault more, for each fault that does not show.

    Added to the best hypothesis, an undetectable fault changes the loss significantly in neither
    direction. An example is a dead touch sensor in a foot that the gait never puts down. Kinds with
    severities are excluded: most have a severity that is too small to detect. Hypotheses that the
    surrogate comparator distinguishes from the best are not simulated further. The others are
    sorted by total loss.
    """
    space = problem.space
    faults = [fault for fault in space.coarse_candidates if fault.kind.bounds is None]
    distinct = dict.fromkeys(space.canonical([*best.faults, fault]) for fault in faults)
    candidates = [one for one in distinct if len(one) > len(best)]
    for losses in (problem.coarse, problem.losses):
        best_losses, *rows = losses([best, *candidates])
        candidates = [
            one
            for one, row in zip(candidates, rows, strict=True)
            if np.isfinite(best_losses).all()
            and not significance.is_better(best_losses, row)
            and not significance.is_better(row, best_losses)
        ]
    return by_total_loss(candidates, problem.losses)


def unsearched_fault(best: Hypothesis, problem: Problem) -> UnsearchedFault | None:
    """Returns the best hypothesis with one fault of an unsearched kind, if significantly better.

    One fault of a built-in kind is added to the best hypothesis, or replaces all faults of the same
    part. The gain has to be significant, and significantly larger than the gain of the fault alone
    on healthy trials; otherwise the fault corrects model error. Of those that pass, the one with
    the lowest total loss is returned, with the best hypothesis of each other kind; None if there is
    none, or if there are no comparable healthy trials.
    """
    (best_losses,) = problem.losses([best])
    is_exact = (
        not np.isfinite(best_losses).all() or best_losses.mean() <= significance.NEGLIGIBLE_LOSS
    )
    if problem.healthy([INTACT]) is None or is_exact:
        return None
    faults = _with_unsearched(best, problem.space)
    better: dict[str, Hypothesis] = {}
    for candidate in _largest_gains(best, faults, problem):
        fault, losses = faults[candidate], problem.losses([candidate])[0]
        # Most are no gain: what they do to the healthy trials is not needed.
        if fault.kind.name in better or not significance.is_gain(losses, best_losses):
            continue
        healthy = problem.healthy([problem.space.canonical([fault]), INTACT])
        if healthy is None:
            continue
        # A reading that healthy trials predict better with the fault is predicted badly as such.
        if not fault.kind.affects_dynamics and significance.is_better(*healthy):
            continue
        is_gain = significance.gain_exceeds_healthy_gain(losses, best_losses, *healthy)
        if is_gain and len(supported(candidate, problem)[0]) == len(candidate):
            better[fault.kind.name] = candidate
    if not better:
        return None
    (first, hypothesis), *others = better.items()
    return UnsearchedFault(hypothesis, first, dict(others))


def _with_unsearched(best: Hypothesis, space: HypothesisSpace) -> dict[Hypothesis, Fault]:
    """Returns hypotheses with a fault of an unsearched kind, each with that fault.

    Kinds that edit the specification, such as rough terrain, are excluded: each hypothesis needs a
    compiled model. So are kinds that do not suit the robot, such as wind on a bench.
    """
    suited = [kind for kind in ALL_KINDS if kind.suits(space.anatomy)]
    kinds = [kind for kind in suited if kind not in space.kinds and not kind.edits_specification]
    unsearched: dict[Hypothesis, Fault] = {}
    for fault in replace(space, kinds=tuple(kinds)).coarse_candidates:
        others = [other for other in best.faults if other.part != fault.part]
        for faults in ((*best.faults, fault), (*others, fault)):
            unsearched.setdefault(space.canonical(faults), fault)
    unsearched.pop(best, None)
    return unsearched


def _largest_gains(
    best: Hypothesis, faults: Mapping[Hypothesis, Fault], problem: Problem
) -> list[Hypothesis]:
    """The most significant gains by the surrogate, sorted by total loss of the comparator.

    Of each fault on each side of its nominal severity, the mildest is first; a severity beyond one
    that predicts the trials significantly worse is assumed to be worse.
    """
    sides: dict[Hashable, list[Hypothesis]] = {}
    for own, fault in sorted(faults.items(), key=lambda one: _distance_from_nominal(one[1])):
        nominal, others = fault.kind.nominal, frozenset(own.faults) - {fault}
        side = (fault.kind, fault.part, fault.severity > (nominal or 0.0), others)
        sides.setdefault(own if nominal is None else side, []).append(own)
    z: dict[Hypothesis, float] = {}
    left = [*sides.values()]
    while left:
        mildest = [own[0] for own in left]
        best_losses, *rows = problem.coarse([best, *mildest])
        for own, row in zip(mildest, rows, strict=True):
            is_finite = np.isfinite([best_losses, row]).all()
            z[own] = significance.paired_z(best_losses, row) if is_finite else -np.inf
        left = [
            own[1:]
            for own, row in zip(left, rows, strict=True)
            if own[1:] and not significance.is_better(best_losses, row)
        ]
    tried = [own for own in faults if own in z]
    order = np.argsort([z[own] for own in tried], kind="stable")[::-1]
    return by_total_loss([tried[i] for i in order[: search.SHORTLIST_SIZE]], problem.losses)


def _distance_from_nominal(fault: Fault) -> float:
    return abs(fault.severity - (fault.kind.nominal or 0.0))


def detectable_severities(
    best: Hypothesis, space: HypothesisSpace, losses: LossFunction, observer: Observer = ignore
) -> list[DetectableSeverity]:
    """Returns the smallest detectable severities of every kind with a nominal severity.

    The nominal friction is the model's; the level with the smallest loss is taken for it. Parts
    with a fault in the best hypothesis are left out. A severity beyond one that shows is assumed to
    show too, so that a bisection over the kind's levels finds the limit. A fault shows if it
    predicts the trials worse by ``MIN_Z_ACROSS_TRIALS`` standard errors: a diagnosis requires
    ``MIN_Z``, but the losses of a trial with the fault are not known. On the log of a real robot,
    weaknesses with ``MIN_Z`` were found in half of the cases.
    """
    faulty = {fault.part for fault in best.faults}
    faults = [
        Fault(kind, part)
        for kind in space.kinds
        if kind.bounds is not None and not kind.edits_specification
        for part in space.parts(kind)
        if part not in faulty
    ]
    sides: list[tuple[Fault, list[float]]] = []
    for fault in faults:
        nominal = _nominal(fault, best, space, losses)
        if nominal is not None:
            levels = sorted(space.levels(fault))
            below = [level for level in reversed(levels) if level < nominal]
            above = [level for level in levels if level > nominal]
            # The nearest level is preceded by half of it.
            sides += [
                (fault, [(nominal + side[0]) / 2, *side] if side else []) for side in (below, above)
            ]
    low, high = [0 for _ in sides], [len(severities) for _, severities in sides]
    rounds = range(max(high, default=0).bit_length())
    for _ in followed(rounds, "detectable severities", observer):
        undecided = [i for i in range(len(sides)) if low[i] < high[i]]
        middles = {i: (low[i] + high[i]) // 2 for i in undecided}
        tried = [replace(sides[i][0], severity=sides[i][1][k]) for i, k in middles.items()]
        candidates = [space.canonical([*best.faults, fault]) for fault in tried]
        best_losses, *rows = losses([best, *candidates])
        for (i, middle), row in zip(middles.items(), rows, strict=True):
            if significance.is_better(best_losses, row, significance.MIN_Z_ACROSS_TRIALS):
                high[i] = middle
            else:
                low[i] = middle + 1
    smallest = [(*severities, None)[i] for (_, severities), i in zip(sides, high, strict=True)]
    return [
        DetectableSeverity(fault.kind.name, fault.part, below, above)
        for (fault, _), below, above in zip(sides[::2], smallest[::2], smallest[1::2], strict=True)
    ]


def _nominal(
    fault: Fault, best: Hypothesis, space: HypothesisSpace, losses: LossFunction
) -> float | None:
    """Returns the severity at which a fault has no effect; None if the kind has none."""
    if fault.kind.nominal is not None or fault.part != ENVIRONMENT:
        return fault.kind.nominal
    levels = space.levels(fault)
    rows = losses([space.canonical([*best.faults, replace(fault, severity=s)]) for s in levels])
    return levels[int(np.argmin(rows.sum(axis=1)))]
