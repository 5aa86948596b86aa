"""The diagnostic EA: evolves hypotheses that explain all trials."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.diagnosis.diagnosis import Candidate, Diagnosis, UnsearchedFault, Verdict
from selfmodel.diagnosis.evidence import Evidence
from selfmodel.diagnosis.genome import VALUES, decode, encode
from selfmodel.diagnosis.loss_functions import Losses, LossFunctions
from selfmodel.diagnosis.model_error import any_fault_is_model_error
from selfmodel.diagnosis.refine import refined
from selfmodel.diagnosis.severity import coarse_candidates
from selfmodel.diagnosis.significance import TEST, exceeds_healthy_loss, is_better
from selfmodel.diagnosis.surrogate import Surrogate, own_surrogate, surrogate_of
from selfmodel.diagnosis.undetectable import undetectable_faults
from selfmodel.diagnosis.unsearched import best_unsearched_fault
from selfmodel.evolution import Evolution, GenerationCallback, evolve
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.registry import PAPER_KINDS, applicable_kinds
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial

KNOWN = 2
"""Of what the EA found closest, how much is refined."""

EQUAL = "equal distances"
"""The test of a comparator that gives one number for a trial."""


class DiagnosticSearch:
    """Evolves hypotheses against logged trials; it remembers every distance.

    Fitness is minus the sum of the distances over all trials. Source: the paper, section III.
    Where the comparator judges in pieces, what the EA found is refined: see ``refine``.

    Args:
        simulator: The self-model.
        comparator: Says what to simulate and how far it is from a trial.
        settings: The numbers of the search.
        kinds: What is considered, as far as it can strike the robot; see ``considered``.
        intact: Trials of the robot with nothing wrong, which show how well the self-model
            predicts when it is right; without any, no verdict can be ``unexplained``.

    Raises:
        InputError: None of the kinds can strike the robot.
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
        self._anatomy = simulator.robot.anatomy
        self._settings = settings
        self._kinds = applicable_kinds(kinds, self._anatomy)
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
        """Returns the hypotheses that explain the trials best.

        Args:
            trials: At least one.
            seeds: Hypotheses to start from, beside random ones.
            rng: Every random choice comes from it.
            on_generation: Is told of every generation.
        """
        surrogate = surrogate_of(self.evidence, self._own_surrogate, trials)
        is_piecewise = self.evidence.is_piecewise(trials)
        found = self._evolved(surrogate, seeds, rng, on_generation)
        best, looks = found[0], self._loss_functions(trials, surrogate)
        # Ranked: hypotheses that were proposed and compared with the whole trials. Hypotheses that
        # only the tests below compare with the trials are never ranked.
        ranked: set[Hypothesis] = set() if is_piecewise else set(found)
        if is_piecewise:
            best = self._refined(found[:KNOWN], looks, ranked)
        ranked |= {best, INTACT}
        self._proposed |= ranked
        judged = list(ranked)
        totals = dict(zip(judged, map(float, self.evidence.distances(judged, trials)), strict=True))
        others = [one for one in _ranked(totals) if one != best]
        indistinguishable = self._indistinguishable(best, others, looks, is_piecewise=is_piecewise)
        better = best_unsearched_fault(best, self._kinds, self._anatomy, looks)
        besides = (
            undetectable_faults(best, self._kinds, self._anatomy, looks) if is_piecewise else []
        )
        kept = self._settings.kept
        return Diagnosis(
            ranked=tuple(Candidate(one, totals[one]) for one in [best, *others][:kept]),
            trials=len(trials),
            intact_distance=totals[INTACT],
            indistinguishable=indistinguishable[:kept],
            verdict=self._verdict(best, indistinguishable, better, looks),
            test=TEST if is_piecewise else EQUAL,
            unsearched=better,
            undetectable=tuple(besides[:kept]),
        )

    def check(self, trials: Sequence[Trial]) -> None:
        """Checks that the comparator can judge all trials, before any search.

        Raises:
            InputError: It cannot; the sentence names every trial that it cannot judge, and why.
        """
        self.evidence.check([*self._intact, *trials])
        surrogate = surrogate_of(self.evidence, self._own_surrogate, trials)
        surrogate.evidence.check(surrogate.trials)

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
        """The hypotheses that the EA looked at, closest first."""
        genes, anatomy = self._settings.genes, self._anatomy
        totals: dict[Hypothesis, float] = {}

        def fitness(genomes: FloatArray) -> FloatArray:
            hypotheses = [decode(genome, anatomy, self._kinds) for genome in genomes]
            distances = surrogate.distances(hypotheses)
            totals.update(zip(hypotheses, map(float, distances), strict=True))
            return 0.0 - distances  # not -distances: a perfect fitness reads 0, not -0

        search = Evolution(
            genes * VALUES,
            np.random.Generator.random,
            self._settings,
            rng,
            [encode(hypothesis, genes, anatomy, self._kinds) for hypothesis in seeds],
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
            after=partial(self.evidence.losses, trials=trials),
            screen=surrogate.losses,
            before=partial(self.evidence.losses, trials=self._intact)
            if comparable and self._intact
            else None,
        )

    def _refined(
        self, known: Sequence[Hypothesis], looks: LossFunctions, compared: set[Hypothesis]
    ) -> Hypothesis:
        """Returns the best hypothesis around the known ones.

        Args:
            known: Hypotheses to start from.
            looks: Losses on the trials.
            compared: Every hypothesis that is compared with the whole trials is added.
        """
        return refined(
            known,
            coarse_candidates(self._kinds, self._anatomy),
            self._settings.genes,
            LossFunctions(
                after=_recorded(looks.after, compared),
                screen=_recorded(looks.screen, self._proposed),
                before=looks.before,
            ),
            self._anatomy,
        )

    def _indistinguishable(
        self,
        best: Hypothesis,
        others: Sequence[Hypothesis],
        looks: LossFunctions,
        *,
        is_piecewise: bool,
    ) -> tuple[Hypothesis, ...]:
        """Those that cannot be told from the best, but for those that only say more of the same."""
        said = _without_severities(best)
        candidates = [other for other in others if not said <= _without_severities(other)]
        mine, *theirs = looks.after([best, *candidates])
        if is_piecewise:
            told = [is_better(mine, losses) for losses in theirs]
        else:
            told = [bool(losses.sum() != mine.sum()) for losses in theirs]
        untold = [other for other, apart in zip(candidates, told, strict=True) if not apart]
        return tuple(
            one for one in untold if not any_fault_is_model_error(one, looks, self._anatomy)
        )

    def _verdict(
        self,
        best: Hypothesis,
        indistinguishable: Sequence[Hypothesis],
        better: UnsearchedFault | None,
        looks: LossFunctions,
    ) -> Verdict:
        if better is not None:
            return "unexplained"
        if self._intact:
            usual = self.evidence.losses([INTACT], self._intact)[0]
            if exceeds_healthy_loss(looks.after([best])[0], usual):
                return "unexplained"
        return "ambiguous" if indistinguishable else "explained"


def _recorded(losses: Losses, into: set[Hypothesis]) -> Losses:
    """Returns a loss function that adds every hypothesis to a set."""

    def recorded(hypotheses: Sequence[Hypothesis]) -> FloatArray:
        into.update(hypotheses)
        return losses(hypotheses)

    return recorded


def _without_severities(hypothesis: Hypothesis) -> set[tuple[FaultKind, str]]:
    return {(fault.kind.without_severity, fault.part) for fault in hypothesis.faults}


def _ranked(totals: dict[Hypothesis, float]) -> list[Hypothesis]:
    return sorted(totals, key=lambda known: (totals[known], len(known), known))
