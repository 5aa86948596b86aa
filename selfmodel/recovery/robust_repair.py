"""Robust repair: evolves controllers on rollouts under random conditions.

A gait that is evolved in one exact simulation depends on that simulation: on a physical robot it
loses most of its speed. Here every generation has new conditions: noise of the readings, initial
poses, parameters of the model and hypotheses that cannot be told apart. Source: Jakobi, Husbands
and Harvey, "Noise and the reality gap" (ECAL 1995); the paper, section VI (noisy transfer).
"""

from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Protocol

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.errors import WorkError
from selfmodel.evolution import Draw, Generation, GenerationCallback
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.candidate import Candidate
from selfmodel.recovery.cma_es import CmaEs
from selfmodel.recovery.fitness import Score
from selfmodel.settings import Settings
from selfmodel.simulation.conditions import Condition, Uncertainty, draw_conditions
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import Behaviour

COST = 2.0
"""Simulated control steps of a repair, relative to those of the paper's repair EA."""

FIRST_STEPS = 200
"""Control steps of the rollouts of the random first generation."""

TAIL = 0.25
"""Fraction of the conditions, those with the lowest scores, that count as the lower tail."""

FINALISTS, FINAL_CONDITIONS = 12, 4
"""Candidates of a search, and conditions under which they are compared."""

JUDGED, JUDGED_CONDITIONS = 4, 16
"""Best candidates of that comparison, and conditions under which these are compared at last."""


class GenomeSearch(Protocol):
    """Search over genomes; fitness is maximised."""

    evaluations: int

    def ask(self) -> FloatArray:
        """Returns the genomes to evaluate, ``(n, length)``."""
        ...

    def tell(self, fitness: FloatArray) -> None:
        """Sets the fitness of the genomes that ``ask`` returned, ``(n,)``."""
        ...

    def stop(self) -> dict[str, int]:
        """Returns the stop reason; empty while the search runs."""
        ...

    def candidates(self, count: int) -> FloatArray:
        """Returns at most ``count`` genomes that may be the best, ``(n, length)``."""
        ...


MakeSearch = Callable[
    [int, Draw, Settings, np.random.Generator, Sequence[FloatArray]], GenomeSearch
]
"""Function from the length of a genome, the distribution of random genomes, the settings, the
random number generator and initial genomes to a search."""


class RobustRepair:
    """Repair under uncertainty; a ``Repair``.

    Args:
        simulator: Self-model.
        settings: The paper's numbers; they set the cost of a repair.
        design: Design of the controllers to evolve.
        score: Fitness of a rollout.
        uncertainty: Distribution of the rollouts.
        make_search: Makes the search.

    Attributes:
        evaluations: Number of controllers evaluated so far.
    """

    def __init__(
        self,
        simulator: Simulator,
        settings: Settings,
        design: Design,
        score: Score,
        uncertainty: Uncertainty,
        make_search: MakeSearch = CmaEs,
    ) -> None:
        self._simulator, self._settings, self._design = simulator, settings, design
        self._score, self._uncertainty, self._make_search = score, uncertainty, make_search
        self.evaluations = 0

    def __call__(
        self,
        hypotheses: Sequence[Hypothesis],
        seeds: Sequence[Controller],
        rng: np.random.Generator,
        on_generation: GenerationCallback,
    ) -> tuple[Candidate, ...]:
        """Returns candidates, best first; see ``Repair``.

        Raises:
            WorkError: The simulation diverged with every controller.
        """
        design, steps = self._design, self._settings.steps
        own = [controller.genome for controller in seeds if controller.design == design]
        search = self._make_search(design.weights, draw_genomes, self._settings, rng, own)
        finalists = min(FINALISTS, self._settings.population)
        judging = finalists * FINAL_CONDITIONS + JUDGED * JUDGED_CONDITIONS
        budget = (COST * self._settings.evaluations - judging) * steps
        spent, number, best, start = 0, 0, -np.inf, perf_counter()
        while number == 0 or (spent < budget and not search.stop()):
            genomes = search.ask()
            horizon = min(FIRST_STEPS, steps) if number == 0 else steps
            conditions = draw_conditions(hypotheses, self._uncertainty, 1, rng)
            fitness = robust(self._scores(self._controllers(genomes), conditions, horizon))
            search.tell(fitness)
            spent += len(genomes) * horizon
            number += 1
            best = float(fitness.max())
            left = int(np.ceil(max(0.0, budget - spent) / (len(search.ask()) * steps)))
            seconds = perf_counter() - start
            on_generation(Generation(number, number + left, best, search.evaluations, seconds))
        self.evaluations += search.evaluations
        found = self._controllers(search.candidates(finalists))
        found, _ = self._best(found, JUDGED, FINAL_CONDITIONS, hypotheses, rng)
        found, scores = self._best(found, JUDGED, JUDGED_CONDITIONS, hypotheses, rng)
        if not np.isfinite(scores[0]).any():
            raise WorkError(
                f"no simulation of {self._simulator.robot.name} as {hypotheses[0]} remained "
                f"finite, with {search.evaluations} controllers: check the model, such as its "
                f"physics time step, masses and motors"
            )
        return tuple(map(Candidate, found, scores))

    def _controllers(self, genomes: FloatArray) -> list[Controller]:
        return [Controller(self._design, genome) for genome in genomes]

    def _best(
        self,
        controllers: Sequence[Controller],
        count: int,
        conditions: int,
        hypotheses: Sequence[Hypothesis],
        rng: np.random.Generator,
    ) -> tuple[list[Controller], FloatArray]:
        """Returns the best controllers and their scores, ``(count, conditions)``, best first."""
        drawn = draw_conditions(hypotheses, self._uncertainty, conditions, rng)
        scores = self._scores(controllers, drawn, self._settings.steps)
        order = np.argsort(-robust(scores), kind="stable")[:count]
        return [controllers[i] for i in order], scores[order]

    def _scores(
        self, controllers: Sequence[Controller], conditions: Sequence[Condition], steps: int
    ) -> FloatArray:
        """Scores by condition, ``(controllers, conditions)``; -inf for a diverged rollout."""
        outcome = self._simulator.run_under(
            conditions, self._uncertainty, controllers, steps, self._score.record
        )
        scores = np.full(outcome.diverged.shape, -np.inf)
        for column, condition in enumerate(conditions):
            finite = ~outcome.diverged[:, column]
            if finite.any():
                simulated = outcome.behaviour
                signals = {
                    signal: values[finite, column] for signal, values in simulated.signals.items()
                }
                behaviour = Behaviour(simulated.names, simulated.time, signals)
                scores[finite, column] = self._score.of(
                    self._simulator.robot, condition.hypothesis, behaviour
                )
        return scores


def robust(scores: FloatArray) -> FloatArray:
    """Returns the mean of the mean score and of the mean of the lower tail.

    Args:
        scores: ``(controllers, conditions)``.

    Returns:
        ``(controllers,)``.
    """
    tail = np.sort(scores, axis=1)[:, : max(1, round(TAIL * scores.shape[1]))]
    return np.asarray((scores.mean(axis=1) + tail.mean(axis=1)) / 2)
