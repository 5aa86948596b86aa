"""Candidates of a repair: their scores under uncertain conditions, and at a finer time step.

A generation of a robust repair has new conditions: noise of the readings, initial poses, parameters
of the model and indistinguishable hypotheses. The last candidates have to keep their scores at a
quarter of the physics time step: a search finds what a coarse one flatters.
"""

import copy
import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller
from selfmodel.errors import WorkError
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.falls import fallen
from selfmodel.recovery.scores import UPRIGHT, Score, scores_of
from selfmodel.simulation.domain import DomainDistribution, draw_samples
from selfmodel.simulation.simulator import Simulator

VIABLE = 0.5
"""Smallest share of the last conditions in which the rollouts of a candidate remain finite."""

FINER, LOSS = 4, 0.2
"""Physics steps in place of each under which the last candidates are simulated again, and the share
of its score that one of them may lose by that. The conditions are the first quarter of the last
ones, so that one candidate takes as many physics steps as in the last comparison."""

TAIL = 0.25
"""Fraction of the conditions, those with the lowest scores, that count as the lower tail."""


@dataclass(frozen=True, eq=False)
class CandidateController:
    """A controller for the next trial, and its simulated score under each condition.

    There is a single score from a repair that simulates the self-model alone.

    Attributes:
        controller: The controller.
        scores: Score under each condition; negative infinity for a rollout that diverged.
        parts: Physics steps in place of each, under which it was evolved: ``FINER`` if the
            self-model at its own step flatters.
    """

    controller: Controller
    scores: FloatArray
    parts: int = 1

    @property
    def mean(self) -> float:
        """Mean score of the rollouts that did not diverge; NaN if all did."""
        finite = self.scores[np.isfinite(self.scores)]
        return float(np.mean(finite)) if len(finite) else math.nan


@dataclass(frozen=True, eq=False)
class RobustFitness:
    """Scores of controllers under random conditions, common to all controllers of a call.

    The conditions have indistinguishable hypotheses in turn, and an uncertain model.
    """

    simulator: Simulator
    score: Score
    hypotheses: Sequence[Hypothesis]
    uncertainty: DomainDistribution

    def __call__(
        self, controllers: Sequence[Controller], count: int, steps: int, rng: np.random.Generator
    ) -> FloatArray:
        """Returns scores, ``(controllers, count)``; negative infinity for a diverged rollout."""
        conditions = draw_samples(self.hypotheses, self.uncertainty, count, rng)
        faults, record = [each.hypothesis for each in conditions], self.score.record
        until = None
        if self.score.ends_at_fall:
            until = fallen(self.simulator.robot, faults * len(controllers))
            record = tuple(dict.fromkeys([*record, *UPRIGHT.record]))
        outcome = self.simulator.run_under(
            conditions, self.uncertainty, controllers, steps, record, until=until
        )
        return scores_of(self.score, self.simulator.robot, faults, outcome)


def viable(
    controllers: Sequence[Controller],
    scores: FloatArray,
    fitness: RobustFitness,
    evaluations: int,
) -> tuple[CandidateController, ...]:
    """Returns the candidates whose rollouts remained finite under most conditions, best first.

    The scores are ``(controllers, conditions)``, and the fitness is what scored them.

    Raises:
        WorkError: None did; the message has the evaluations of the search.
    """
    finite = np.isfinite(scores)
    rows = np.flatnonzero(finite.mean(axis=1) >= VIABLE).tolist()
    if not rows:
        share = f"{np.count_nonzero(finite)} of {finite.size}"
        best_of = f"with the best {len(finite)} of {evaluations} controllers"
        raise divergence(fitness.simulator, fitness.hypotheses[0], f"{share} {best_of}")
    return tuple(CandidateController(controllers[i], scores[i]) for i in rows)


class Evolves(Protocol):
    """A repair that simulates a self-model, at a number of physics steps in place of each."""

    simulator: Simulator
    parts: int


Candidates = tuple[CandidateController, ...]
"""Candidates, best first, at least one."""


def unflattered(repair: Evolves, search: Callable[[], tuple[Candidates, Candidates]]) -> Candidates:
    """Returns the candidates of a search that keep their scores at a quarter of the time step.

    If none does, the repair has that time step from now on, and the search is repeated. The search
    returns all candidates, and what ``converged`` keeps of them.
    """
    found, kept = search()
    if not kept and repair.parts == 1:
        repair.simulator, repair.parts = repair.simulator.finer(FINER), FINER
        found, kept = search()
    return tuple(replace(one, parts=repair.parts) for one in kept or found)


def converged(
    candidates: Candidates,
    fitness: RobustFitness,
    steps: int,
    rng: np.random.Generator,
    known: Collection[Controller] = (),
) -> Candidates:
    """Returns the candidates that keep their scores at a quarter of the physics time step.

    They are those up to the first that is not known, which is the next trial. A candidate is left
    out if it loses more than ``LOSS`` of its mean score, by a standard error over the conditions,
    or if a further rollout diverges. What a stiff servo or a massless rotor does at a coarse time
    step is no motion of a robot, and costs all rollouts their scores; a fall in one of four is
    chance. The fitness is what scored the candidates, best first, and the generator in the state in
    which their conditions were drawn.
    """
    finer = replace(fitness, simulator=fitness.simulator.finer(FINER))
    conditions, kept = max(1, len(candidates[0].scores) // FINER), list[CandidateController]()
    for one in candidates:
        (fine,) = finer([one.controller], conditions, steps, copy.deepcopy(rng))
        if _keeps(one.scores[:conditions], fine):
            kept.append(one)
            if one.controller not in known:
                break
    return tuple(kept)


def _keeps(coarse: FloatArray, fine: FloatArray) -> bool:
    known = np.isfinite(coarse)
    before, after = coarse[known], fine[known]
    if not len(before) or not np.isfinite(after).all():
        return False
    lost = before - after
    error = lost.std(ddof=1) / math.sqrt(len(lost)) if len(lost) > 1 else 0.0
    return bool(lost.mean() - error <= LOSS * abs(before.mean()))


def robust(scores: FloatArray) -> FloatArray:
    """Returns the mean of the mean score and of the mean of the lower tail, ``(controllers,)``.

    ``scores`` are ``(controllers, conditions)``. A rollout that diverged counts as worse than all
    others by 1; a controller of which all did has negative infinity.
    """
    finite = np.isfinite(scores)
    if not finite.any():
        return np.full(len(scores), -np.inf)
    known = np.where(finite, scores, scores[finite].min() - 1.0)
    tail = np.sort(known, axis=1)[:, : max(1, round(TAIL * scores.shape[1]))]
    values = (known.mean(axis=1) + tail.mean(axis=1)) / 2
    return np.asarray(np.where(finite.any(axis=1), values, -np.inf))


def divergence(simulator: Simulator, hypothesis: Hypothesis, finite: str) -> WorkError:
    """Returns the error of a repair with too few simulations that remained finite."""
    return WorkError(
        f"expected finite simulations of {simulator.robot.name} as {hypothesis}, got {finite}: "
        f"check the model, such as its physics time step, masses and motors"
    )
