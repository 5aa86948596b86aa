"""Fitness of controllers on rollouts under random conditions."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.scores.fitness import Score
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
        hypotheses: Indistinguishable hypotheses, at least one.
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
        return self._scores(controllers, conditions, steps)

    def _scores(
        self,
        controllers: Sequence[Controller],
        conditions: Sequence[Condition],
        steps: int,
    ) -> FloatArray:
        outcome = self.simulator.run_under(
            conditions, self.uncertainty, controllers, steps, self.score.record
        )
        simulated, robot = outcome.behaviour, self.simulator.robot
        scores = np.full(outcome.diverged.shape, -np.inf)
        for column, condition in enumerate(conditions):
            rows = ~outcome.diverged[:, column]
            if rows.any():
                signals = {name: values[rows, column] for name, values in simulated.signals.items()}
                behaviour = Behaviour(simulated.names, simulated.time, signals)
                scores[rows, column] = self.score.of(robot, condition.hypothesis, behaviour)
        return scores


def robust(scores: FloatArray) -> FloatArray:
    """Returns the mean of the mean score and of the mean of the lower tail, ``(controllers,)``.

    A rollout that diverged counts as worse than all others by 1; a controller of which all did has
    negative infinity.

    Args:
        scores: ``(controllers, conditions)``.
    """
    finite = np.isfinite(scores)
    if not finite.any():
        return np.full(len(scores), -np.inf)
    known = np.where(finite, scores, scores[finite].min() - 1.0)
    tail = np.sort(known, axis=1)[:, : max(1, round(TAIL * scores.shape[1]))]
    values = (known.mean(axis=1) + tail.mean(axis=1)) / 2
    return np.asarray(np.where(finite.any(axis=1), values, -np.inf))
