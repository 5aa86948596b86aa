"""The diagnosis of trials: diagnostic EA, local refinement, change in time, and verdict."""

import dataclasses
from collections.abc import Iterable, Sequence
from functools import partial

import numpy as np

from selfmodel.diagnosis.change import best_split, change_at, is_change
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.diagnosis.diagnosis import Change, Diagnosis
from selfmodel.diagnosis.joints import with_joint_faults
from selfmodel.diagnosis.losses import LossTable
from selfmodel.diagnosis.problem import Parts, Problem
from selfmodel.diagnosis.search import LocalSearch, evolved
from selfmodel.diagnosis.significance import MIN_Z, excess_over_healthy
from selfmodel.diagnosis.verdict import judged, ranked_by_distance
from selfmodel.evolution import GenerationCallback
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial, trial_names

REFINEMENT_STARTS = 2
"""Hypotheses from the EA that the refinement starts from, best first."""

MIN_SURROGATE_PIECES = 2
"""Pieces of the surrogate comparator after a change that a search needs."""


class DiagnosticSearch:
    """Diagnoses logged trials; every loss is kept for the next diagnosis.

    For a comparator with losses per segment or window, the best hypotheses of the EA are refined;
    see ``search``. For another, the ranking is that of the EA.

    Args:
        simulator: The self-model.
        comparator: Distance between simulations and a trial.
        settings: Parameters of the EA.
        kinds: Fault kinds to search, as far as they apply to the robot; see ``HypothesisSpace.of``.
        healthy_trials: Trials of the healthy robot, which measure the loss of a correct model;
            without any, no verdict is ``unexplained``.

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
    ) -> None:
        self._settings = settings
        self._space = HypothesisSpace.of(kinds, simulator.robot.anatomy)
        self._healthy_trials = tuple(healthy_trials)
        self._proposed: set[Hypothesis] = set()
        self.losses = LossTable(simulator, comparator)
        self.evaluations = 0

    def __call__(
        self,
        trials: Sequence[Trial],
        seeds: Sequence[Hypothesis],
        rng: np.random.Generator,
        on_generation: GenerationCallback,
    ) -> Diagnosis:
        """Returns the diagnosis of some trials.

        Args:
            trials: At least one trial.
            seeds: Hypotheses of the initial population, in addition to random ones.
            rng: Source of all random numbers.
            on_generation: Callback, called after each generation.
        """
        surrogate = self.losses.surrogate(trials)
        found, evaluations = evolved(
            partial(surrogate[0].distances, trials=surrogate[1]),
            self._space,
            self._settings,
            seeds,
            rng,
            on_generation=on_generation,
        )
        self.evaluations += evaluations
        self._proposed.update(found)
        problem = self._problem(trials, trials, surrogate)
        if not self.losses.is_piecewise(trials):
            return ranked_by_distance(found, problem)
        starts = found[:REFINEMENT_STARTS]
        best, compared = self._refined(starts, problem)
        return self._after_change(best, starts, trials, problem, surrogate) or judged(
            best, compared, problem
        )

    def check(self, trials: Sequence[Trial]) -> None:
        """Checks that the comparator accepts all trials, before any search.

        Raises:
            InputError: The comparator rejects a trial; the message contains every such trial and
                the reason.
        """
        self.losses.check([*self._healthy_trials, *trials])
        cheaper, its_trials = self.losses.surrogate(trials)
        cheaper.check(its_trials)

    @property
    def distinct_hypotheses(self) -> int:
        """Number of distinct hypotheses that were proposed, by all searches so far."""
        return len(self._proposed)

    def _problem(
        self,
        trials: Sequence[Trial],
        parts: Parts,
        surrogate: tuple[LossTable, Parts],
        earlier: Parts = (),
    ) -> Problem:
        """Returns the problem of some trials, or parts of them.

        Args:
            trials: All trials of the diagnosis.
            parts: Trials to explain, or parts of them.
            surrogate: Losses of the surrogate comparator, and its trials.
            earlier: Parts of the trials before the robot changed: the healthy reference if there
                are no trials of the healthy robot.
        """
        return Problem(
            self.losses,
            self._space,
            parts,
            surrogate=surrogate,
            healthy_trials=self._healthy_trials or earlier,
            names=trial_names(trials),
            settings=self._settings,
        )

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
        compared = search.compared | {best, INTACT}
        self._proposed |= compared | search.proposed
        return best, compared

    def _after_change(
        self,
        best: Hypothesis,
        starts: Sequence[Hypothesis],
        trials: Sequence[Trial],
        problem: Problem,
        surrogate: tuple[LossTable, Sequence[Trial]],
    ) -> Diagnosis | None:
        """Returns the diagnosis of the time after a change of the robot.

        None if no change predicts the trials significantly better than the best hypothesis, if too
        little time follows it, or if the losses of the comparator have no times.

        Args:
            best: The best hypothesis about all trials.
            starts: Hypotheses from the EA that refinements start from.
            trials: All trials.
            problem: The problem of all trials.
            surrogate: Losses of the surrogate comparator, and its trials.
        """
        table, its_trials = surrogate
        change = self._change(best, starts, trials, problem)
        if change is None:
            return None
        coarse_parts = change.since(its_trials)
        if table.losses([INTACT], coarse_parts).shape[1] < MIN_SURROGATE_PIECES:
            return None
        change = self._with_refined_before(change, starts, trials, surrogate)
        earlier = change.until(trials) if change.before == INTACT else []
        later = self._problem(trials, change.since(trials), (table, coarse_parts), earlier)
        after, compared = self._refined([change.after, *starts], later)
        if after == change.before:
            return None
        diagnosis = judged(after, compared, later)
        dated = self._dated(change, diagnosis.best, trials)
        return dataclasses.replace(diagnosis, change=dated, trials=len(trials))

    def _change(
        self,
        best: Hypothesis,
        starts: Sequence[Hypothesis],
        trials: Sequence[Trial],
        problem: Problem,
    ) -> Change | None:
        timeline = self.losses.timeline(trials)
        if timeline is None:
            return None
        space = problem.space
        before = dict.fromkeys([INTACT, best, *space.with_one_less(best)])
        after = dict.fromkeys([best, *starts, *space.with_one_more(INTACT)])
        split = best_split(list(before), list(after), problem.coarse, problem.losses)
        if split is None or not is_change(split, best, problem.losses):
            return None
        return change_at(split, problem.losses, timeline, _names_of(trials))

    def _with_refined_before(
        self,
        change: Change,
        starts: Sequence[Hypothesis],
        trials: Sequence[Trial],
        surrogate: tuple[LossTable, Sequence[Trial]],
    ) -> Change:
        """Returns a change with the refined hypothesis about the time before it.

        If the empty hypothesis predicts this time as well as the healthy trials, or if there are
        none, it stays: the search would only find model error.
        """
        table, its_trials = surrogate
        earlier, coarse_parts = change.until(trials), change.until(its_trials)
        if table.losses([INTACT], coarse_parts).shape[1] < MIN_SURROGATE_PIECES:
            return change
        problem = self._problem(trials, earlier, (table, coarse_parts))
        if change.before == INTACT:
            healthy, (losses,) = problem.reference, problem.losses([INTACT])
            if healthy is None or excess_over_healthy(losses, healthy) < MIN_Z:
                return change
        before, _ = self._refined([change.before, *starts], problem)
        return dataclasses.replace(change, before=before)

    def _dated(self, change: Change, after: Hypothesis, trials: Sequence[Trial]) -> Change:
        """Returns a change with the time that the final hypothesis gives it."""
        losses, timeline = partial(self.losses.losses, trials=trials), self.losses.timeline(trials)
        split = best_split([change.before], [after], losses, losses)
        if split is None or timeline is None:
            return change
        dated = change_at(split, losses, timeline, _names_of(trials))
        return dated if dated.index == change.index else change


def _names_of(trials: Sequence[Trial]) -> list[str]:
    """Returns the name of each of all trials."""
    names = trial_names(trials)
    return [names[trial.path] for trial in trials]
