"""Fitness of controllers on rollouts under random conditions."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
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
        self,
        controllers: Sequence[Controller],
        groups: int,
        steps: int,
        rng: np.random.Generator,
    ) -> FloatArray:
        """Returns scores under one condition, ``(controllers,)``, at 70 % of the cost.

        Controllers that are behind in their group are stopped early, and have the score up to then.
        A score that grows with time would be larger; any other is limited to less than those of the
        group that went on. A search that recombines the better half of each group needs no more.

        Args:
            controllers: At least one controller per group, group by group.
            groups: Number of groups of equal size.
            steps: Control steps of a rollout.
            rng: Random number generator of the condition.
        """
        conditions = draw_conditions(self.hypotheses, self.uncertainty, 1, rng)
        shares = {round(time * steps): share for time, share in RACE}
        size = len(controllers) // groups
        at_stop = np.full(len(controllers), np.nan)
        lasted = np.full(len(controllers), steps)

        def behind(behaviour: Behaviour, diverged: BoolArray) -> BoolArray:
            scores = self.score.of(self.simulator.robot, conditions[0].hypothesis, behaviour)
            # Those that were stopped before are behind, and remain so.
            out = diverged | np.isnan(scores) | np.isfinite(at_stop)
            ranked = np.where(out, -np.inf, scores).reshape(groups, size)
            order = np.argsort(-ranked, axis=1, kind="stable")
            stopped = np.ones((groups, size), dtype=bool)
            first = math.ceil(shares[behaviour.steps] * size)
            np.put_along_axis(stopped, order[:, :first], values=False, axis=1)
            new = stopped.ravel() & np.isnan(at_stop) & ~diverged
            at_stop[new], lasted[new] = scores[new], behaviour.steps
            return stopped.ravel()

        stop = EarlyStop(tuple(shares), behind)
        scores = self._scores(controllers, conditions, steps, stop)[:, 0]
        scores = np.where(np.isneginf(scores) | np.isnan(at_stop), scores, at_stop)
        if self.score.grows_with_time:
            return scores
        own = (part.reshape(groups, size) for part in (scores, lasted))
        return np.concatenate([_below_leaders(*group) for group in zip(*own, strict=True)])

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


def _below_leaders(scores: FloatArray, lasted: IndexArray) -> FloatArray:
    """Returns scores, limited to less than all finite ones of rollouts that lasted longer.

    Args:
        scores: ``(n,)``; negative infinity for a diverged rollout.
        lasted: Control steps after which each rollout was stopped, ``(n,)``.
    """
    limited = scores.copy()
    for end in np.unique(lasted)[-2::-1]:
        longer = limited[(lasted > end) & np.isfinite(limited)]
        if len(longer):
            rows = lasted == end
            limited[rows] = np.minimum(limited[rows], np.nextafter(longer.min(), -np.inf))
    return limited


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
