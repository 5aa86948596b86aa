"""The diagnostic EA: evolves hypotheses that explain all trials."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.diagnosis.diagnosis import Candidate, Diagnosis, Outside, Verdict
from selfmodel.diagnosis.evidence import Evidence
from selfmodel.diagnosis.genome import VALUES, decode, encode
from selfmodel.diagnosis.loss_functions import Looks
from selfmodel.diagnosis.model_error import mends_in_part
from selfmodel.diagnosis.refine import refined
from selfmodel.diagnosis.screening import screen_of
from selfmodel.diagnosis.severity import coarse_candidates
from selfmodel.diagnosis.significance import TEST, is_better, is_worse_than_ever
from selfmodel.diagnosis.undetectable import unseen
from selfmodel.diagnosis.unsearched import better_outside
from selfmodel.evolution import Evolution, Observe, evolve
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.kind import Kind
from selfmodel.faults.registry import PAPER_KINDS, considered
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial

KNOWN = 2
"""Of what the EA found closest, how much is refined."""

EQUAL = "equal distances"
"""The test of a comparator that gives one number for a trial."""


class Diagnose:
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
        kinds: Sequence[Kind] = PAPER_KINDS,
        *,
        intact: Sequence[Trial] = (),
    ) -> None:
        self._anatomy = simulator.robot.anatomy
        self._settings = settings
        self._kinds = considered(kinds, self._anatomy)
        self._intact = tuple(intact)
        self.evidence = Evidence(simulator, comparator)
        self._screen = screen_of(comparator, simulator, self.evidence)
        # What is only looked at is remembered apart, so that it is never ranked.
        self._aside, self._screen_aside = self.evidence.aside(), self._screen.aside()
        self.evaluations = 0

    def __call__(
        self,
        trials: Sequence[Trial],
        seeds: Sequence[Hypothesis],
        rng: np.random.Generator,
        observe: Observe,
    ) -> Diagnosis:
        """Returns the hypotheses that explain the trials best.

        Args:
            trials: At least one.
            seeds: Hypotheses to start from, beside random ones.
            rng: Every random choice comes from it.
            observe: Is told of every generation.
        """
        found = self._evolved(trials, seeds, rng, observe)
        best, aside = found[0], self._looks_aside(trials)
        if self.evidence.in_pieces:
            best = self._refined(trials, found[:KNOWN], aside)
        judged = list(self.evidence.judged(trials) | {best, INTACT})
        totals = dict(zip(judged, map(float, self.evidence.distances(judged, trials)), strict=True))
        others = [one for one in _ranked(totals) if one != best]
        rivals = self._rivals(best, others, aside)
        better = better_outside(best, self._kinds, self._anatomy, aside)
        besides = unseen(best, self._kinds, self._anatomy, aside) if self.evidence.in_pieces else []
        kept = self._settings.kept
        return Diagnosis(
            ranked=tuple(Candidate(one, totals[one]) for one in [best, *others][:kept]),
            trials=len(trials),
            intact_distance=totals[INTACT],
            rivals=rivals[:kept],
            verdict=self._verdict(best, rivals, better, aside),
            test=TEST if self.evidence.in_pieces else EQUAL,
            outside=better,
            unseen=tuple(besides[:kept]),
        )

    def check(self, trials: Sequence[Trial]) -> None:
        """Checks that the comparator can judge all trials, before any search.

        Raises:
            InputError: It cannot; the sentence names every trial that it cannot judge, and why.
        """
        self.evidence.check([*self._intact, *trials])
        self._screen.evidence.check(self._screen.of(trials))

    @property
    def distinct_hypotheses(self) -> int:
        """How many hypotheses of the considered kinds were ever simulated."""
        return len(self.evidence.hypotheses | self._screen.evidence.hypotheses)

    def _evolved(
        self,
        trials: Sequence[Trial],
        seeds: Sequence[Hypothesis],
        rng: np.random.Generator,
        observe: Observe,
    ) -> list[Hypothesis]:
        """The hypotheses that the EA looked at, closest first."""
        genes, anatomy = self._settings.genes, self._anatomy
        looked_at = self._screen.of(trials)
        totals: dict[Hypothesis, float] = {}

        def fitness(genomes: FloatArray) -> FloatArray:
            hypotheses = [decode(genome, anatomy, self._kinds) for genome in genomes]
            distances = self._screen.evidence.distances(hypotheses, looked_at)
            totals.update(zip(hypotheses, map(float, distances), strict=True))
            return 0.0 - distances  # not -distances: a perfect fitness reads 0, not -0

        search = Evolution(
            genes * VALUES,
            np.random.Generator.random,
            self._settings,
            rng,
            [encode(hypothesis, genes, anatomy, self._kinds) for hypothesis in seeds],
        )
        evolve(search, fitness, observe)
        self.evaluations += search.evaluations
        return _ranked(totals)

    def _looks_aside(self, trials: Sequence[Trial]) -> Looks:
        """How badly hypotheses predict the trials, without a trace in what is ranked.

        Pieces of a whole trial, closed loop, hang together: what helps there may be luck, and is
        not compared with what helped before.
        """
        known = [*self._intact, *trials]
        comparable = self.evidence.in_pieces and self.evidence.in_segments(known)
        return Looks(
            after=partial(self._aside.losses, trials=trials),
            screen=partial(self._screen_aside.losses, trials=trials),
            before=partial(self._aside.losses, trials=self._intact)
            if comparable and self._intact
            else None,
        )

    def _refined(
        self, trials: Sequence[Trial], known: Sequence[Hypothesis], aside: Looks
    ) -> Hypothesis:
        """The best hypothesis around those known."""
        return refined(
            known,
            coarse_candidates(self._kinds, self._anatomy),
            self._settings.genes,
            Looks(
                after=partial(self.evidence.losses, trials=trials),
                screen=partial(self._screen.losses, trials=trials),
                before=aside.before,
            ),
            self._anatomy,
        )

    def _rivals(
        self, best: Hypothesis, others: Sequence[Hypothesis], aside: Looks
    ) -> tuple[Hypothesis, ...]:
        """Those that cannot be told from the best, but for those that only say more of the same."""
        said = _without_degrees(best)
        candidates = [other for other in others if not said <= _without_degrees(other)]
        mine, *theirs = aside.after([best, *candidates])
        if self.evidence.in_pieces:
            told = [is_better(mine, losses) for losses in theirs]
        else:
            told = [bool(losses.sum() != mine.sum()) for losses in theirs]
        untold = [other for other, apart in zip(candidates, told, strict=True) if not apart]
        return tuple(one for one in untold if not mends_in_part(one, aside, self._anatomy))

    def _verdict(
        self,
        best: Hypothesis,
        rivals: Sequence[Hypothesis],
        better: Outside | None,
        aside: Looks,
    ) -> Verdict:
        if better is not None:
            return "unexplained"
        if self._intact:
            usual = self._aside.losses([INTACT], self._intact)[0]
            if is_worse_than_ever(aside.after([best])[0], usual):
                return "unexplained"
        return "ambiguous" if rivals else "explained"


def _without_degrees(hypothesis: Hypothesis) -> set[tuple[Kind, str]]:
    return {(fault.kind.without_degree, fault.part) for fault in hypothesis.faults}


def _ranked(totals: dict[Hypothesis, float]) -> list[Hypothesis]:
    return sorted(totals, key=lambda known: (totals[known], len(known), known))
