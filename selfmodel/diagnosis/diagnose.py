"""The diagnostic search: an EA over hypotheses, local refinement, and the verdict."""

import dataclasses
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.diagnosis.evidence import Evidence
from selfmodel.diagnosis.judgement import by_distance, judged, ranked_by_distance
from selfmodel.diagnosis.loss_functions import Losses, LossFunctions
from selfmodel.diagnosis.question import Question, question_of
from selfmodel.diagnosis.search.joint_faults import with_joint_faults
from selfmodel.diagnosis.search.refine import refined
from selfmodel.diagnosis.search.search_cost import SearchSize
from selfmodel.diagnosis.search.surrogate import Surrogate, own_surrogates, surrogate_of
from selfmodel.diagnosis.verdicts.change_point import Change, best_split, change_at, is_change
from selfmodel.diagnosis.verdicts.significance import MIN_Z, excess_over_healthy
from selfmodel.diagnosis.verdicts.unsearched import unsearched_space
from selfmodel.evolution import Evolution, GenerationCallback, evolve
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import GENE_VALUES, HypothesisSpace
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial, TrialPart, trial_names

REFINEMENT_STARTS = 2
"""Hypotheses from the EA that the refinement starts from, best first."""


MIN_SURROGATE_PIECES = 2
"""Pieces of the surrogate comparator after a change that a search needs."""


class DiagnosticSearch:
    """Evolves hypotheses against logged trials; every distance is cached.

    Fitness is minus the sum of the distances over all trials. Source: the paper, section III. For
    a comparator with losses per segment or window, the best hypotheses are refined; see ``refine``.

    Args:
        simulator: The self-model.
        comparator: Distance between simulations and a trial.
        settings: Parameters of the EA.
        kinds: Fault kinds to search, as far as they apply to the robot; see ``HypothesisSpace.of``.
        intact: Trials of the healthy robot, which measure the loss of a correct model; without
            any, no verdict is ``unexplained``.

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
        intact: Sequence[Trial] = (),
    ) -> None:
        self._settings = settings
        self._space = HypothesisSpace.of(kinds, simulator.robot.anatomy)
        self._intact = tuple(intact)
        self.evidence = Evidence(simulator, comparator)
        self._own_surrogates = own_surrogates(comparator, simulator)
        self._proposed: set[Hypothesis] = set()
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
        surrogate = surrogate_of(self.evidence, self._own_surrogates, trials)
        found = self._evolved(surrogate, seeds, rng, on_generation)
        names = trial_names(trials)
        question = self._question(trials, names, surrogate.losses)
        if not self.evidence.is_piecewise(trials):
            return ranked_by_distance(found, question)
        best, compared = self._refined(found[:REFINEMENT_STARTS], question)
        change = self._change(best, found, trials, question)
        if change is None:
            return judged(best, compared, question)
        rest = partial(surrogate.evidence.losses, trials=change.since(surrogate.trials))
        if rest([INTACT]).shape[1] < MIN_SURROGATE_PIECES:
            return judged(best, compared, question)
        change = self._with_refined_before(change, found, trials, surrogate)
        healthy = change.until(trials) if change.before == INTACT else []
        later = self._question(change.since(trials), names, rest, healthy)
        after, compared_later = self._refined([change.after, *found[:REFINEMENT_STARTS]], later)
        if after == change.before:
            return judged(best, compared, question)
        diagnosis = judged(after, compared_later, later)
        dated = self._dated(change, diagnosis.best, trials)
        return dataclasses.replace(diagnosis, change=dated, trials=len(trials))

    def check(self, trials: Sequence[Trial]) -> None:
        """Checks that the comparator accepts all trials, before any search.

        Raises:
            InputError: The comparator rejects a trial; the message contains every such trial and
                the reason.
        """
        self.evidence.check([*self._intact, *trials])
        surrogate = surrogate_of(self.evidence, self._own_surrogates, trials)
        surrogate.evidence.check(surrogate.trials)

    def simulated_steps(self, trials: Sequence[Trial]) -> int:
        """Returns the estimated number of control steps that a diagnosis of some trials simulates.

        Args:
            trials: Trials that the comparator accepts; see ``check``.
        """
        surrogate = surrogate_of(self.evidence, self._own_surrogates, trials)
        return SearchSize(
            settings=self._settings,
            candidates=len(self._space.coarse_candidates),
            unsearched=len(unsearched_space(self._space).coarse_candidates),
            surrogate_steps=surrogate.evidence.steps_per_hypothesis(surrogate.trials),
            is_refined=self.evidence.is_piecewise(trials),
            uses_segments=self.evidence.uses_segments(trials),
            has_healthy=bool(self._intact),
        ).simulated_steps

    @property
    def distinct_hypotheses(self) -> int:
        """Number of distinct hypotheses that were proposed, by all searches so far."""
        return len(self._proposed)

    def _evolved(
        self,
        surrogate: Surrogate,
        seeds: Sequence[Hypothesis],
        rng: np.random.Generator,
        on_generation: GenerationCallback,
    ) -> list[Hypothesis]:
        """The hypotheses that the EA evaluated, smallest distance first."""
        genes = self._settings.genes
        totals: dict[Hypothesis, float] = {}

        def fitness(genomes: FloatArray) -> FloatArray:
            hypotheses = [self._space.decode(genome) for genome in genomes]
            distances = surrogate.distances(hypotheses)
            totals.update(zip(hypotheses, map(float, distances), strict=True))
            return 0.0 - distances  # not -distances: a perfect fitness is 0, not -0

        search = Evolution(
            genes * GENE_VALUES,
            np.random.Generator.random,
            self._settings,
            rng,
            [self._space.encode(hypothesis, genes) for hypothesis in seeds],
        )
        evolve(search, fitness, on_generation)
        self.evaluations += search.evaluations
        self._proposed |= totals.keys()
        return by_distance(totals)

    def _question(
        self,
        trials: Sequence[Trial | TrialPart],
        names: Mapping[str, str],
        surrogate: Losses,
        earlier: Sequence[Trial | TrialPart] = (),
    ) -> Question:
        """Returns the question of the hypothesis that explains some trials, or parts of them.

        Args:
            trials: Trials to explain, or parts of them.
            names: Names of the trials of the whole diagnosis, by path.
            surrogate: Losses of the surrogate comparator on these.
            earlier: Trials, or parts of them, of the robot before it changed: the healthy reference
                if there are no trials of the healthy robot.
        """
        return question_of(
            self.evidence,
            self._space,
            trials,
            names=names,
            intact=self._intact or earlier,
            surrogate=surrogate,
            kept=self._settings.kept,
        )

    def _refined(
        self, known: Sequence[Hypothesis], question: Question
    ) -> tuple[Hypothesis, set[Hypothesis]]:
        """Returns the best hypothesis around known ones, and all that were compared.

        Hypotheses that only the tests of a verdict compare with the trials are never ranked.
        """
        compared: set[Hypothesis] = set()
        best = refined(
            known,
            question.space,
            self._settings.genes,
            LossFunctions(
                damaged=_recorded(question.losses.damaged, compared),
                surrogate=_recorded(question.losses.surrogate, self._proposed),
                healthy=question.losses.healthy,
            ),
        )
        if question.joints is not None:
            best = with_joint_faults(
                best,
                question.space,
                self._settings.genes,
                _recorded(question.losses.damaged, compared),
                question.joints,
            )
        compared |= {best, INTACT}
        self._proposed |= compared
        return best, compared

    def _change(
        self,
        best: Hypothesis,
        found: Sequence[Hypothesis],
        trials: Sequence[Trial],
        question: Question,
    ) -> Change | None:
        """Returns the change in time that predicts the trials significantly better than ``best``.

        None if there is no such change, or if the losses of the comparator have no times.
        """
        timeline = self.evidence.timeline(trials)
        if timeline is None:
            return None
        losses = question.losses
        singles = question.space.with_one_more(INTACT)
        before = dict.fromkeys([INTACT, best, *question.space.with_one_less(best)])
        after = dict.fromkeys([best, *found[:REFINEMENT_STARTS], *singles])
        split = best_split(list(before), list(after), losses.surrogate, losses.damaged)
        if split is None or not is_change(split, best, losses.damaged):
            return None
        return change_at(split, losses.damaged, timeline, _names_of(trials))

    def _with_refined_before(
        self,
        change: Change,
        found: Sequence[Hypothesis],
        trials: Sequence[Trial],
        surrogate: Surrogate,
    ) -> Change:
        """Returns a change with the refined hypothesis about the time before it.

        If the empty hypothesis predicts this time as well as the healthy trials, or if there are
        none, it stays: the search would only find model error.
        """
        earlier = change.until(trials)
        coarse = partial(surrogate.evidence.losses, trials=change.until(surrogate.trials))
        if coarse([INTACT]).shape[1] < MIN_SURROGATE_PIECES:
            return change
        question = self._question(earlier, trial_names(trials), coarse)
        if change.before == INTACT:
            healthy = question.healthy_losses
            losses = question.losses.damaged([INTACT])[0]
            if healthy is None or excess_over_healthy(losses, healthy) < MIN_Z:
                return change
        before, _ = self._refined([change.before, *found[:REFINEMENT_STARTS]], question)
        return dataclasses.replace(change, before=before)

    def _dated(self, change: Change, after: Hypothesis, trials: Sequence[Trial]) -> Change:
        """Returns a change with the time that the final hypothesis gives it."""
        losses, timeline = (
            partial(self.evidence.losses, trials=trials),
            self.evidence.timeline(trials),
        )
        split = best_split([change.before], [after], losses, losses)
        if split is None or timeline is None:
            return change
        dated = change_at(split, losses, timeline, _names_of(trials))
        return dated if dated.index == change.index else change


def _names_of(trials: Sequence[Trial]) -> list[str]:
    """Returns the name of each of all trials."""
    names = trial_names(trials)
    return [names[trial.path] for trial in trials]


def _recorded(losses: Losses, into: set[Hypothesis]) -> Losses:
    """Returns a loss function that adds every hypothesis to a set."""

    def recorded(hypotheses: Sequence[Hypothesis]) -> FloatArray:
        into.update(hypotheses)
        return losses(hypotheses)

    return recorded
