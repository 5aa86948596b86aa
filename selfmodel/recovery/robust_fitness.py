"""Fitness of controllers on rollouts under random conditions."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.controllers.controller import Controller
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.fitness import Score
from selfmodel.simulation.conditions import Condition, Uncertainty, draw_conditions
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import Behaviour

TAIL = 0.25
"""Fraction of the conditions, those with the lowest scores, that count as the lower tail."""


@dataclass(frozen=True, eq=False)
class RobustFitness:
    """Scores of controllers under random conditions, common to all controllers of a call.

    Attributes:
        simulator: Self-model.
        score: Score of a rollout.
        hypotheses: Hypotheses that cannot be told apart, at least one.
        uncertainty: Distribution of the rollouts.
    """

    simulator: Simulator
    score: Score
    hypotheses: Sequence[Hypothesis]
    uncertainty: Uncertainty

    def __call__(
        self, controllers: Sequence[Controller], count: int, steps: int, rng: np.random.Generator
    ) -> FloatArray:
        """Returns scores, ``(controllers, count)``; negative infinity for a diverged rollout.

        Args:
            controllers: At least one controller.
            count: Number of conditions.
            steps: Control steps of a rollout.
            rng: Random number generator of the conditions.
        """
        conditions = draw_conditions(self.hypotheses, self.uncertainty, count, rng)
        outcome = self.simulator.run_under(
            conditions, self.uncertainty, controllers, steps, self.score.record
        )
        scores = np.full(outcome.diverged.shape, -np.inf)
        for column, condition in enumerate(conditions):
            finite = ~outcome.diverged[:, column]
            if finite.any():
                scores[finite, column] = self._scores(condition, outcome.behaviour, finite, column)
        return scores

    def _scores(
        self, condition: Condition, simulated: Behaviour, rows: BoolArray, column: int
    ) -> FloatArray:
        signals = {signal: values[rows, column] for signal, values in simulated.signals.items()}
        behaviour = Behaviour(simulated.names, simulated.time, signals)
        return self.score.of(self.simulator.robot, condition.hypothesis, behaviour)


def robust(scores: FloatArray) -> FloatArray:
    """Returns the mean of the mean score and of the mean of the lower tail, ``(controllers,)``.

    Args:
        scores: ``(controllers, conditions)``.
    """
    tail = np.sort(scores, axis=1)[:, : max(1, round(TAIL * scores.shape[1]))]
    return np.asarray((scores.mean(axis=1) + tail.mean(axis=1)) / 2)
