"""The diagnosis of trials: diagnostic EA, local refinement, change in time, and verdict.

**Change in time.** The pieces of all trials, in the order of the trials, are one timeline. Before a
change, one hypothesis predicts the pieces; after it, another. The losses of the candidates are
known from the search, so a scan over all times is a cumulative sum and needs no further simulation.

Source: Page, "Continuous inspection schemes", Biometrika 41 (1954), the cumulative sum; here of the
differences of two hypotheses' losses, over all times afterwards.
"""

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.diagnosis import significance
from selfmodel.diagnosis.alternatives import best_severities
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.diagnosis.diagnosis import Candidate, Change, Cost, Diagnosis, Doubt
from selfmodel.diagnosis.direct_evidence import evident
from selfmodel.diagnosis.joints import with_joint_faults
from selfmodel.diagnosis.losses import (
    LimitReachedError,
    LossFunction,
    LossTable,
    Timeline,
)
from selfmodel.diagnosis.problem import Problem, Refits
from selfmodel.diagnosis.search import (
    LocalSearch,
    by_distance,
    chosen_of,
    evolved,
    with_fitted_severities,
)
from selfmodel.diagnosis.verdict import diagnosis_of
from selfmodel.errors import InputError
from selfmodel.evolution import Generation
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.registry import DEFAULT_KINDS, PAPER_KINDS, suitable
from selfmodel.progress import Progress
from selfmodel.settings import EA, STEPWISE, Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial, TrialPart, trial_names

REFINEMENT_STARTS = 2
"""Hypotheses from the EA that the refinement starts from, best first."""

SHORTLIST = 8
"""Candidates whose change is computed with the comparator itself."""


class DiagnosticSearch:
    """Diagnoses logged trials; every loss is kept for the next diagnosis.

    The search is that of the settings; see ``search``. At their limit of simulated control steps it
    ends with the best hypothesis so far, and the trials are ``not judged``.

    Args:
        simulator: The self-model.
        comparator: Distance between simulations and a trial.
        settings: The search, its limit, and the parameters of the EA.
        kinds: Fault kinds to search, as far as they apply to the robot; see ``HypothesisSpace.of``.
            If they include the default ones, unsearched kinds that predict the trials better are
            searched too, but for robots with a fixed base.
        healthy_trials: Trials of the healthy robot, which measure the loss of a correct model;
            without any, no verdict is ``unexplained``.
        refit: Fits the self-model again, by which an accusation is checked (``adequacy``); None
            for a self-model that is given as it is.

    Attributes:
        losses: Losses of hypotheses on the trials.
        evaluations: Evaluations by the EA, over all diagnoses so far.

    Raises:
        InputError: No kind applies to the robot, or a kind is not searchable.
    """

    def __init__(
        self,
        simulator: Simulator,
        comparator: Comparator,
        settings: Settings,
        kinds: Sequence[FaultKind] = PAPER_KINDS,
        *,
        healthy_trials: Sequence[Trial] = (),
        refit: Refits | None = None,
    ) -> None:
        self._refit = refit
        self._settings = settings
        self._space = HypothesisSpace.of(kinds, simulator.robot.anatomy)
        # On a real servo on a bench, a load was found in the place of lost torque, and damping in
        # that of half its gain.
        anatomy = simulator.robot.anatomy
        is_whole = set(kinds).issuperset(suitable(DEFAULT_KINDS, anatomy))
        self._is_extended = is_whole and not simulator.robot.has_fixed_base
        self._healthy_trials = [*map(TrialPart, healthy_trials)]
        self.losses = LossTable(simulator, comparator)
        self._ended: tuple[Hypothesis | None, Collection[Hypothesis]] | None = None
        self.evaluations = 0

    def __call__(
        self,
        trials: Sequence[Trial],
        seeds: Sequence[Hypothesis],
        rng: np.random.Generator,
        observer: Callable[[Generation | Progress], None],
    ) -> Diagnosis:
        """Returns the diagnosis of at least one trial.

        ``seeds`` are hypotheses of the initial population, in addition to random ones. The
        ``observer`` is called after each generation, and with the progress of each later stage.
        """
        self._ended = None
        limit, account = self._settings.max_simulated_steps, self.losses.account
        account.limit = None if limit is None else limit * len(trials)
        try:
            diagnosis = self._searched(trials, seeds, rng, observer)
        except LimitReachedError:
            diagnosis = self._unfinished(trials)
        return replace(diagnosis, cost=Cost(len(account.hypotheses), account.steps))

    def _searched(
        self,
        trials: Sequence[Trial],
        seeds: Sequence[Hypothesis],
        rng: np.random.Generator,
        observer: Callable[[Generation | Progress], None],
    ) -> Diagnosis:
        self.losses.losses([INTACT], trials)  # with a limit, something to end with
        surrogate, how = self.losses.surrogate(trials), self._settings.diagnostic_search
        space = self._space.including(seeds[:1])
        problem = Problem(
            self.losses,
            space,
            [*map(TrialPart, trials)],
            surrogate=surrogate,
            healthy_trials=self._healthy_trials,
            names=trial_names(trials),
            settings=self._settings,
            refit=self._refit,
            observer=observer,
        )
        shown = evident(problem.standing, problem.space) if how != EA else []
        known = [one for one in dict.fromkeys([*seeds, *shown]) if problem.space.has(one)]
        ranked = [one for one in known if len(one) <= self._settings.genes]
        # With many losses, the refinement from the last hypotheses, or from those that standing
        # encoders show, needs no start of the EA; nor does that of a long trial.
        needs_no_start = self.losses.has_sections(trials) or (
            ranked and self.losses.is_piecewise(trials)
        )
        if how == EA or (how != STEPWISE and not needs_no_start):
            table, of_trials = (self.losses, trials) if how == EA else surrogate
            distances = partial(table.distances, trials=of_trials)
            ranked, evaluations = evolved(
                distances, problem.space, self._settings, ranked, rng, on_generation=observer
            )
            self.evaluations += evaluations
        if how == EA:
            self._ended = None, ranked
            return diagnosis_of(problem, ranked)
        starts = ranked[:REFINEMENT_STARTS]
        diagnosis = self._refined_diagnosis(starts, trials, problem)
        better = diagnosis.unsearched.named if diagnosis.unsearched and self._is_extended else ()
        if named := [one for one in better if len(one) <= self._settings.genes]:
            problem = replace(problem, space=space.including(named))
            diagnosis = self._refined_diagnosis([*named, *starts], trials, problem)
        asked = self._space.kinds
        also = tuple(kind.name for kind in problem.space.kinds if kind not in asked)
        return replace(diagnosis, also_searched=also)

    def _unfinished(self, trials: Sequence[Trial]) -> Diagnosis:
        """Returns the diagnosis at the limit: by what the search has compared until then.

        The EA alone decides by the distance, as ever; the other searches by their tests. Where the
        search itself has ended, what was simulated for the verdict does not count.
        """
        known, account = self.losses.known(trials), self.losses.account
        best, compared = self._ended or (None, known)
        if INTACT not in known:
            raise InputError(
                f"expected a limit of control steps with which a hypothesis can be simulated in "
                f"all trials, got {account.limit} for {len(trials)}: give more"
            )
        known = [one for one in known if one in compared or one == INTACT]
        totals = dict(zip(known, map(float, self.losses.distances(known, trials)), strict=True))
        ranked = by_distance(totals)
        if self._settings.diagnostic_search != EA:
            if best is None:
                best = chosen_of(known, partial(self.losses.compared, trials=trials))
            ranked = [best, *ranked]
        return Diagnosis(
            ranked=tuple(
                Candidate(one, totals[one])
                for one in best_severities(ranked)[: self._settings.kept]
            ),
            trials=len(trials),
            intact_distance=totals[INTACT],
            indistinguishable=(),
            verdict="not judged",
            test=significance.TEST,
            doubt=Doubt(
                f"the limit of {account.limit:,} simulated control steps ended the search; "
                f"{ranked[0]} is the best hypothesis until then",
                "give more steps (--max-simulated-steps), or search fewer kinds of faults",
                f"it is not known whether the robot has a fault: the search ended at its limit, "
                f"with {ranked[0].words} as its best",
            ),
        )

    def _refined_diagnosis(
        self, starts: Sequence[Hypothesis], trials: Sequence[Trial], problem: Problem
    ) -> Diagnosis:
        # Of a long trial, the time after a clear change costs less than all of it.
        if self._healthy_trials and self.losses.has_sections(trials):
            alone = LocalSearch(problem).best_alone
            if after := self._after_change(alone, starts, trials, problem, is_refined=False):
                return after
        best, compared = self._ended = self._refined(starts, problem)
        after = self._after_change(best, starts, trials, problem)
        return after or diagnosis_of(problem, compared, best)

    @property
    def distinct_hypotheses(self) -> int:
        """Number of distinct hypotheses that were simulated, by all diagnoses so far."""
        return len(self.losses.account.hypotheses)

    def _refined(
        self, known: Iterable[Hypothesis], problem: Problem
    ) -> tuple[Hypothesis, set[Hypothesis]]:
        """Returns the best hypothesis around known ones, and all that were compared.

        Hypotheses that only the tests of a verdict compare with the trials are never ranked.
        """
        search = LocalSearch(problem)
        best = search.refined(known)
        if problem.has_joints:
            best = with_joint_faults(best, search)
        return best, search.compared | {best, INTACT}

    def _after_change(
        self,
        best: Hypothesis,
        starts: Sequence[Hypothesis],
        trials: Sequence[Trial],
        problem: Problem,
        *,
        is_refined: bool = True,
    ) -> Diagnosis | None:
        """Returns the diagnosis of the time after a change of the robot.

        None if no change predicts the trials significantly better than the best hypothesis, if too
        little time follows it, or if the losses of the comparator have no times. If the best
        hypothesis is not refined yet, the change has to be better than all its faults are for the
        whole time.
        """
        timeline = self.losses.timeline(trials)
        if timeline is None:
            return None
        names = [problem.names[trial.path] for trial in trials]
        dated = partial(change_at, losses=problem.losses, timeline=timeline, names=names)
        space = problem.space
        before = dict.fromkeys([INTACT, best, *space.with_one_less(best)])
        after = dict.fromkeys([best, *starts, *space.with_one_more(INTACT)])
        split = best_split(list(before), list(after), problem.coarse, problem.losses)
        if split is None or not is_change(split, best, problem.losses):
            return None
        change = dated(split)
        if problem.within(change.since) is None:
            return None
        change = self._with_refined_before(change, starts, problem)
        is_as_healthy = change.before == INTACT
        later = problem.within(change.since, change.until(trials) if is_as_healthy else ())
        if later is None:
            return None
        refined, compared = self._refined([change.after, *starts], later)
        split = best_split([change.before], [refined], problem.losses, problem.losses)
        if refined == change.before or not (is_refined or is_better_than_always(split, problem)):
            return None
        diagnosis = diagnosis_of(later, compared, refined)
        final = change if split is None else dated(split)
        change = final if final.index == change.index else change
        # What came with the change may be what a refit has left out.
        parts = {one.without_severities for one in (diagnosis.best, change.before)}
        is_same = diagnosis.left_out and len(parts) == 1
        return None if is_same else replace(diagnosis, change=change, trials=len(trials))

    def _with_refined_before(
        self, change: Change, starts: Sequence[Hypothesis], problem: Problem
    ) -> Change:
        """Returns a change with the refined hypothesis about the time before it.

        If the empty hypothesis predicts this time as well as the healthy trials, or if there are
        none, it stays: the search would only find model error.
        """
        earlier = problem.within(change.until)
        if earlier is None:
            return change
        if change.before == INTACT:
            healthy, (losses,) = earlier.reference, earlier.losses([INTACT])
            if (
                healthy is None
                or significance.excess_over_healthy(losses, healthy) < significance.MIN_Z
            ):
                return change
        before, _ = self._refined([change.before, *starts], earlier)
        return replace(change, before=before)


class Split(NamedTuple):
    """A change of a timeline: the hypotheses before and after it, and the first piece after it."""

    before: Hypothesis
    after: Hypothesis
    piece: int


def check_known(hypothesis: Hypothesis, settings: Settings) -> None:
    """Raises ``InputError`` for a hypothesis from which no search can begin."""
    if len(hypothesis) > settings.genes:
        raise InputError(
            f"expected at most {settings.genes} faults (genes) in the hypothesis to begin from, "
            f"got {len(hypothesis)} in {hypothesis}: allow more, or leave some out"
        )
    if hidden := [fault for fault in hypothesis.faults if not fault.kind.searchable]:
        raise InputError(f"no diagnosis may propose {hidden[0]}: leave it out of the hypothesis")


def best_split(
    before: Sequence[Hypothesis],
    after: Sequence[Hypothesis],
    coarse: LossFunction,
    losses: LossFunction,
) -> Split | None:
    """Returns the change between two hypotheses with the smallest total loss.

    The losses of the surrogate comparator, ``coarse``, select the hypotheses; those of the
    comparator itself decide. None if the timeline is too short, or if every simulation diverged.
    """
    pieces, few = (each(before[:1]).shape[1] for each in (losses, coarse))
    least = max(2, round(significance.MIN_PIECES * few / pieces))
    ranked = dict.fromkeys(split.after for split in _splits(before, after, coarse, least))
    splits = _splits(before, list(ranked)[:SHORTLIST], losses, significance.MIN_PIECES)
    return splits[0] if splits else None


def is_change(split: Split, single: Hypothesis, losses: LossFunction) -> bool:
    """Returns whether a change predicts the trials significantly better than no change.

    Three conditions hold: before the change, the first hypothesis is significantly better than the
    second; after it, the second is better than the first by ``MIN_Z_OF_CHANGE`` standard errors;
    and with the change, all pieces together are predicted significantly better than by ``single``,
    the best hypothesis without a change.
    """
    before, after, alone = losses([split.before, split.after, single])
    k = split.piece
    changed = np.concatenate([before[:k], after[k:]])
    return (
        significance.is_better(before[:k], after[:k])
        and significance.is_better(after[k:], before[k:])
        and significance.paired_z(before[k:], after[k:]) >= significance.MIN_Z_OF_CHANGE
        and significance.is_better(changed, alone)
    )


def is_better_than_always(split: Split | None, problem: Problem) -> bool:
    """Returns whether a change predicts the trials better than all its faults for all the time."""
    if split is None:
        return False
    every = problem.space.canonical([*split.after.faults, *split.before.faults])
    always = with_fitted_severities(every, problem.coarse, problem.space)
    return is_change(split, always, problem.losses)


def change_at(
    split: Split, losses: LossFunction, timeline: Timeline, names: Sequence[str]
) -> Change:
    """Returns the change of a split, with its time and the bounds of the time.

    The bounds are those of the pieces between which the change costs at most ``CHANGE_TOLERANCE``
    mean differences of a piece more than at the best place.
    """
    before, after = losses([split.before, split.after])
    k = split.piece
    totals = _totals(before, after)
    typical = min((after - before)[:k].mean(), (before - after)[k:].mean())
    possible = _run_around(
        totals <= totals[k] + significance.CHANGE_TOLERANCE * max(float(typical), 0.0), k
    )
    index = int(timeline.trial[k])
    inside = np.flatnonzero(timeline.trial == index)
    first, last = np.clip(possible, inside[0], inside[-1]).tolist()
    return Change(
        trial=names[index],
        index=index,
        time=float(timeline.begin[k]),
        earliest=float(timeline.begin[max(first - 1, inside[0])]),
        latest=float(timeline.end[last]),
        before=split.before,
        after=split.after,
    )


def _splits(
    before: Sequence[Hypothesis], after: Sequence[Hypothesis], losses: LossFunction, least: int
) -> list[Split]:
    """Returns the best change from any hypothesis before to each one after, best first.

    ``least`` pieces lie before and after a change, at least.
    """
    rows = losses([*before, *after])
    if rows.shape[1] < 2 * least:
        return []
    splits: list[tuple[float, Split]] = []
    for second, later in zip(after, rows[len(before) :], strict=True):
        for first, earlier in zip(before, rows, strict=False):
            if first == second or not (np.isfinite(earlier).all() and np.isfinite(later).all()):
                continue
            totals = _totals(earlier, later)
            piece = least + int(np.argmin(totals[least : len(later) - least + 1]))
            splits.append((float(totals[piece]), Split(first, second, piece)))
    return [split for _, split in sorted(splits, key=lambda one: one[0])]  # stable


def _totals(before: FloatArray, after: FloatArray) -> FloatArray:
    """Returns the total loss of a change before each piece, ``(pieces + 1,)``."""
    past = np.append(0.0, np.cumsum(before))
    rest = np.append(np.cumsum(after[::-1])[::-1], 0.0)
    return np.asarray(past + rest)


def _run_around(mask: BoolArray, k: int) -> tuple[int, int]:
    """Returns the first and the last index of the run of true values around index k."""
    no = np.flatnonzero(~mask)
    first = int(no[no < k].max(initial=-1)) + 1
    last = int(no[no > k].min(initial=len(mask))) - 1
    return max(first, 1), min(last, len(mask) - 2)
