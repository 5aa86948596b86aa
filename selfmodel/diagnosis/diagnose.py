"""The diagnostic search: an EA over hypotheses, local refinement, and the verdict."""

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.diagnosis.detectable import detectable_weaknesses
from selfmodel.diagnosis.diagnosis import Candidate, Diagnosis
from selfmodel.diagnosis.evidence import Evidence
from selfmodel.diagnosis.loss_functions import Losses, LossFunctions
from selfmodel.diagnosis.model_error import any_fault_is_model_error
from selfmodel.diagnosis.refine import refined
from selfmodel.diagnosis.search_cost import SearchSize
from selfmodel.diagnosis.significance import TEST, is_better
from selfmodel.diagnosis.surrogate import Surrogate, own_surrogate, surrogate_of
from selfmodel.diagnosis.undetectable import undetectable_faults
from selfmodel.diagnosis.unsearched import best_unsearched_fault
from selfmodel.diagnosis.verdict import all_diverged, verdict_of
from selfmodel.evolution import Evolution, GenerationCallback, evolve
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import GENE_VALUES, HypothesisSpace
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial

REFINEMENT_STARTS = 2
"""Hypotheses from the EA that the refinement starts from, best first."""

EQUAL_DISTANCES = "equal distances"
"""Name of the test for a comparator with one distance per trial."""


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
        self._own_surrogate = own_surrogate(comparator, simulator)
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
        surrogate = surrogate_of(self.evidence, self._own_surrogate, trials)
        is_piecewise = self.evidence.is_piecewise(trials)
        found = self._evolved(surrogate, seeds, rng, on_generation)
        best, losses = found[0], self._loss_functions(trials, surrogate)
        # Ranked: hypotheses that were proposed and compared with the whole trials. Hypotheses that
        # only the tests below compare with the trials are never ranked.
        ranked: set[Hypothesis] = set() if is_piecewise else set(found)
        if is_piecewise:
            best = self._refined(found[:REFINEMENT_STARTS], losses, ranked)
        ranked |= {best, INTACT}
        self._proposed |= ranked
        judged = list(ranked)
        totals = dict(zip(judged, map(float, self.evidence.distances(judged, trials)), strict=True))
        if not math.isfinite(totals[best]):
            best = _ranked(totals)[0]
        if not math.isfinite(totals[best]):
            return all_diverged(_ranked(totals)[: self._settings.kept], trials)
        others = [one for one in _ranked(totals) if one != best]
        indistinguishable = self._indistinguishable(best, others, losses, is_piecewise=is_piecewise)
        unsearched = best_unsearched_fault(best, self._space, losses)
        undetectable = undetectable_faults(best, self._space, losses) if is_piecewise else []
        kept = self._settings.kept
        return Diagnosis(
            ranked=tuple(Candidate(one, totals[one]) for one in [best, *others][:kept]),
            trials=len(trials),
            intact_distance=totals[INTACT],
            indistinguishable=indistinguishable[:kept],
            verdict=verdict_of(
                losses=partial(losses.damaged, [best]),
                healthy=self._healthy_losses,
                indistinguishable=indistinguishable,
                unsearched=unsearched,
            ),
            test=TEST if is_piecewise else EQUAL_DISTANCES,
            unsearched=unsearched,
            undetectable=tuple(undetectable[:kept]),
            detectable=tuple(detectable_weaknesses(best, self._space, losses.damaged))
            if is_piecewise
            else (),
        )

    def check(self, trials: Sequence[Trial]) -> None:
        """Checks that the comparator accepts all trials, before any search.

        Raises:
            InputError: The comparator rejects a trial; the message contains every such trial and
                the reason.
        """
        self.evidence.check([*self._intact, *trials])
        surrogate = surrogate_of(self.evidence, self._own_surrogate, trials)
        surrogate.evidence.check(surrogate.trials)

    def simulated_steps(self, trials: Sequence[Trial]) -> int:
        """Returns the estimated number of control steps that a diagnosis of some trials simulates.

        Args:
            trials: Trials that the comparator accepts; see ``check``.
        """
        surrogate = surrogate_of(self.evidence, self._own_surrogate, trials)
        return SearchSize(
            settings=self._settings,
            candidates=len(self._space.coarse_candidates),
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
        return _ranked(totals)

    def _loss_functions(self, trials: Sequence[Trial], surrogate: Surrogate) -> LossFunctions:
        """Returns the losses on the trials, the surrogate's, and those on healthy trials.

        Closed-loop windows are correlated, so gains on them are not compared with gains on healthy
        trials.
        """
        known = [*self._intact, *trials]
        comparable = self.evidence.is_piecewise(trials) and self.evidence.uses_segments(known)
        return LossFunctions(
            damaged=partial(self.evidence.losses, trials=trials),
            surrogate=surrogate.losses,
            healthy=partial(self.evidence.losses, trials=self._intact)
            if comparable and self._intact
            else None,
        )

    @property
    def _healthy_losses(self) -> Callable[[], FloatArray] | None:
        """The losses of the empty hypothesis on healthy trials; None without such trials."""
        return partial(self.evidence.losses, [INTACT], self._intact) if self._intact else None

    def _refined(
        self, known: Sequence[Hypothesis], losses: LossFunctions, compared: set[Hypothesis]
    ) -> Hypothesis:
        """Returns the best hypothesis around the known ones.

        Args:
            known: Hypotheses to start from.
            losses: Losses on the trials.
            compared: Every hypothesis that is compared with the whole trials is added.
        """
        return refined(
            known,
            self._space,
            self._settings.genes,
            LossFunctions(
                damaged=_recorded(losses.damaged, compared),
                surrogate=_recorded(losses.surrogate, self._proposed),
                healthy=losses.healthy,
            ),
        )

    def _indistinguishable(
        self,
        best: Hypothesis,
        others: Sequence[Hypothesis],
        losses: LossFunctions,
        *,
        is_piecewise: bool,
    ) -> tuple[Hypothesis, ...]:
        """Hypotheses not significantly worse than the best, without supersets of its faults."""
        parts = _without_severities(best)
        candidates = [other for other in others if not parts <= _without_severities(other)]
        best_losses, *rows = losses.damaged([best, *candidates])
        if is_piecewise:
            distinct = [is_better(best_losses, row) for row in rows]
        else:
            distinct = [bool(row.sum() != best_losses.sum()) for row in rows]
        indistinct = [one for one, apart in zip(candidates, distinct, strict=True) if not apart]
        return tuple(
            one for one in indistinct if not any_fault_is_model_error(one, losses, self._space)
        )


def _recorded(losses: Losses, into: set[Hypothesis]) -> Losses:
    """Returns a loss function that adds every hypothesis to a set."""

    def recorded(hypotheses: Sequence[Hypothesis]) -> FloatArray:
        into.update(hypotheses)
        return losses(hypotheses)

    return recorded


def _without_severities(hypothesis: Hypothesis) -> set[tuple[FaultKind, str]]:
    return {(fault.kind.without_severity, fault.part) for fault in hypothesis.faults}


def _ranked(totals: dict[Hypothesis, float]) -> list[Hypothesis]:
    return sorted(totals, key=lambda one: (totals[one], len(one), one))
