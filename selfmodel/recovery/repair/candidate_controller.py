"""Candidates of a repair, and the interface of repairs."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller, Design
from selfmodel.evolution import GenerationCallback
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.scores.fitness import Score
from selfmodel.settings import Settings
from selfmodel.simulation.conditions import Uncertainty
from selfmodel.simulation.simulator import Simulator


@dataclass(frozen=True, eq=False)
class CandidateController:
    """A controller for the next trial, with its predicted scores.

    Attributes:
        controller: The controller.
        scores: Score in simulation under each condition, ``(conditions,)``; a single one for
            a repair that simulates the self-model alone.
    """

    controller: Controller
    scores: FloatArray

    @property
    def predicted(self) -> float:
        """Mean predicted score of the rollouts that did not diverge; NaN if all did."""
        finite = self.scores[np.isfinite(self.scores)]
        return float(np.mean(finite)) if len(finite) else math.nan


class Repair(Protocol):
    """Search for controllers that compensate for the faults of a hypothesis.

    Attributes:
        evaluations: Number of controllers evaluated so far.
    """

    evaluations: int

    def __call__(
        self,
        hypotheses: Sequence[Hypothesis],
        uncertainty: Callable[[], Uncertainty],
        seeds: Sequence[Controller],
        rng: np.random.Generator,
        on_generation: GenerationCallback,
        /,
    ) -> tuple[CandidateController, ...]:
        """Returns candidates for the next trial, best first, at least one.

        Args:
            hypotheses: The best hypothesis, then those indistinguishable from it.
            uncertainty: Returns the uncertainty of the self-model; not called by a repair that
                simulates the self-model alone.
            seeds: Known controllers; those of another design are ignored.
            rng: Random number generator of all random choices.
            on_generation: Callback, called after each generation.

        Raises:
            WorkError: The simulation diverged with every controller.
        """
        ...


MakeRepair = Callable[[Simulator, Settings, Design, Score], Repair]
"""Function that makes a repair from the self-model, the settings, the design of the controllers and
the score."""
