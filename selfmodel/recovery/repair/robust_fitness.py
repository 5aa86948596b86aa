"""Fitness of controllers on rollouts under random conditions."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.controllers.controller import Controller
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.scores.fitness import Score
from selfmodel.simulation.batch import EarlyStop
from selfmodel.simulation.conditions import Condition, Uncertainty, draw_conditions
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import Behaviour

TAIL = 0.25
"""Fraction of the conditions, those with the lowest scores, that count as the lower tail."""

RACE = ((0.3, 2 / 3), (0.6, 1 / 2))
"""Fractions of a rollout after which only the leading share of a generation goes on."""


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

    def race(
        self, controllers: Sequence[Controller], steps: int, rng: np.random.Generator
    ) -> FloatArray:
        """Returns scores under one condition, ``(controllers,)``, at two thirds of the cost.

        Controllers that are behind are stopped early, and have the score up to then. A search that
        recombines the better half of a generation needs no more.

        Args:
            controllers: At least one controller.
            steps: Control steps of a rollout.
            rng: Random number generator of the condition.
        """
        conditions = draw_conditions(self.hypotheses, self.uncertainty, 1, rng)
        shares = {round(time * steps): share for time, share in RACE}

        def behind(behaviour: Behaviour) -> BoolArray:
            scores = self.score.of(self.simulator.robot, conditions[0].hypothesis, behaviour)
            first = math.ceil(shares[behaviour.steps] * len(scores))
            behind = np.ones(len(scores), dtype=bool)
            known = np.where(np.isnan(scores), -np.inf, scores)  # of a simulation that diverged
            behind[np.argsort(-known, kind="stable")[:first]] = False
            return behind

        stop = EarlyStop(tuple(shares), behind)
        return self._scores(controllers, conditions, steps, stop)[:, 0]

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
        stop: EarlyStop | None = None,
    ) -> FloatArray:
        outcome = self.simulator.run_under(
            conditions, self.uncertainty, controllers, steps, self.score.record, early_stop=stop
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

    Args:
        scores: ``(controllers, conditions)``.
    """
    tail = np.sort(scores, axis=1)[:, : max(1, round(TAIL * scores.shape[1]))]
    return np.asarray((scores.mean(axis=1) + tail.mean(axis=1)) / 2)
