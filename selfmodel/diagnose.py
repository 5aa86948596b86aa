"""The diagnostic EA: evolves hypotheses that explain all trials."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.behaviour import SIGNALS
from selfmodel.comparator import Comparator
from selfmodel.diagnosis import Candidate, Diagnosis
from selfmodel.errors import InputError
from selfmodel.evolution import Evolution, Observe, evolve
from selfmodel.faults import PAPER_KINDS, Kind
from selfmodel.genome import VALUES, decode, encode
from selfmodel.hypothesis import Hypothesis
from selfmodel.memo import Memo
from selfmodel.settings import Settings
from selfmodel.simulator import Simulator
from selfmodel.trial import Trial


class Diagnose:
    """Evolves hypotheses against logged trials; it remembers every distance.

    Fitness is minus the sum of the distances over all trials. Source: the paper, section III.

    Args:
        simulator: The self-model.
        comparator: Says what to simulate and how far it is from a trial.
        settings: The numbers of the search.
        kinds: What is considered.
    """

    def __init__(
        self,
        simulator: Simulator,
        comparator: Comparator,
        settings: Settings,
        kinds: Sequence[Kind] = PAPER_KINDS,
    ) -> None:
        self._simulator = simulator
        self._comparator = comparator
        self._settings = settings
        self._kinds = tuple(kinds)
        self._distances: dict[str, Memo[Hypothesis]] = {}  # by the trial's log
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
        anatomy, genes = self._simulator.robot.anatomy, self._settings.genes
        totals: dict[Hypothesis, float] = {}

        def fitness(genomes: FloatArray) -> FloatArray:
            hypotheses = [decode(genome, anatomy, self._kinds) for genome in genomes]
            distances = self.distances(hypotheses, trials)
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
        ranked = sorted(totals, key=lambda known: (totals[known], len(known), known))
        return Diagnosis(
            ranked=tuple(
                Candidate(known, totals[known]) for known in ranked[: self._settings.kept]
            ),
            trials=len(trials),
        )

    def check(self, trials: Sequence[Trial]) -> None:
        """Checks that the comparator can judge all trials, before any search.

        Raises:
            InputError: It cannot; the sentence names every trial that it cannot judge, and why.
        """
        problems = []
        for trial in trials:
            try:
                self._comparator.request(trial)
            except InputError as error:
                problems.append(str(error))
        if problems:
            raise InputError("; ".join(problems))

    def distances(self, hypotheses: Sequence[Hypothesis], trials: Sequence[Trial]) -> FloatArray:
        """Returns how far each hypothesis is from all trials together, ``(n,)``.

        A hypothesis whose simulation diverges is infinitely far.
        """
        total = np.zeros(len(hypotheses))
        for trial in trials:
            memo = self._distances.setdefault(trial.path, Memo())
            total += memo.values(hypotheses, partial(self._simulate, trial))
        return total

    @property
    def distinct_hypotheses(self) -> int:
        """How many hypotheses were ever simulated."""
        return len({hypothesis for memo in self._distances.values() for hypothesis in memo})

    def _simulate(self, trial: Trial, hypotheses: list[Hypothesis]) -> FloatArray:
        controller, steps = trial.plan.controller, trial.behaviour.steps
        record = self._comparator.request(trial).record
        if not record or not set(record) <= set(SIGNALS):
            raise self._broken(f"asked for the signals {record!r}, of {', '.join(SIGNALS)}")
        runs = [(hypothesis, controller) for hypothesis in hypotheses]
        outcome = self._simulator.run(runs, steps, record)
        distances = np.asarray(self._comparator.distances(outcome.behaviour, trial))
        if distances.shape != (len(runs),):
            raise self._broken(f"gave {distances.shape} distances for {len(runs)} simulations")
        if not np.all((distances >= 0) | outcome.diverged):
            raise self._broken(f"gave a distance that is not a number of at least 0: {distances}")
        return np.where(outcome.diverged, np.inf, distances)

    def _broken(self, what: str) -> InputError:
        return InputError(
            f"the comparator {self._comparator.name!r} {what}: run "
            f"selfmodel.contract.check_comparator on it"
        )
