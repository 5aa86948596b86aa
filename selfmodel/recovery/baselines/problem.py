"""What every baseline is given, and the physical trials that it may spend."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller, Design
from selfmodel.recovery.baselines.measurement import Measured, Track, measure
from selfmodel.recovery.repertoire.evaluation import Evaluate
from selfmodel.recovery.repertoire.repertoire import Repertoire

Fitness = Callable[[Sequence[Controller]], FloatArray]
"""Fitness of controllers, ``(n,)``: forward displacement up to the first fall, m."""

Search = Callable[[Design, Fitness, int, np.random.Generator], Sequence[Controller]]
"""Search for controllers: from a design, a fitness, a number of evaluations and random numbers to
the distinct controllers that it evaluated, best first; it may leave out the worse ones."""


@dataclass(frozen=True, eq=False)
class Problem:
    """A damaged physical robot, and what a method may use to recover it.

    Attributes:
        track: The damaged physical robot.
        design: Design of the controllers.
        evaluate: Evaluation in simulation of the healthy robot, without noise.
        healthy: Fitness in simulation of the healthy robot, with noise of sensors and start.
        hidden: Fitness of the physical robot's own model with its own noise: for the oracle alone.
        search: Search for controllers.
        repertoire: Repertoire of the healthy robot; None if no method needs it.
    """

    track: Track
    design: Design
    evaluate: Evaluate
    healthy: Fitness
    hidden: Fitness
    search: Search
    repertoire: Repertoire | None = None


@dataclass(frozen=True)
class BaselineSettings:
    """Sizes of the baselines.

    Attributes:
        trials: Physical trials that a method may spend.
        evaluations: Evaluations of each search in simulation.
        searches: Number of searches of the oracle.
        population: Genomes in a generation.
        period: Generations of T-Resilience between two physical trials.
    """

    trials: int = 20
    evaluations: int = 6000
    searches: int = 2
    population: int = 100
    period: int = 40


@dataclass(frozen=True)
class BaselineTrial:
    """A physical trial of a baseline.

    Attributes:
        controller: The controller.
        measured: Displacement and falls.
        best: Largest ``measured.upright`` of this trial and all before it, m.
    """

    controller: Controller
    measured: Measured
    best: float


OnTrial = Callable[[BaselineTrial], None]
"""Callback, called after each physical trial."""


class PhysicalTrials:
    """The physical trials of a method: runs them, and counts them against their number.

    Args:
        problem: The physical robot.
        settings: The number of trials.
        on_trial: Callback, called after each trial.

    Attributes:
        done: Trials so far.
    """

    def __init__(self, problem: Problem, settings: BaselineSettings, on_trial: OnTrial) -> None:
        self._problem, self._settings, self._on_trial = problem, settings, on_trial
        self.done: tuple[BaselineTrial, ...] = ()

    @property
    def left(self) -> int:
        """Number of trials that are left."""
        return self._settings.trials - len(self.done)

    def run(self, controller: Controller) -> float:
        """Runs a trial, and returns its displacement up to the first fall, m.

        Raises:
            ValueError: No trials are left.
        """
        if not self.left:
            raise ValueError(f"all {self._settings.trials} physical trials are spent")
        found = measure(self._problem.track, controller)
        best = max([found.upright, *(trial.best for trial in self.done[-1:])])
        self.done = (*self.done, BaselineTrial(controller, found, best))
        self._on_trial(self.done[-1])
        return found.upright


Baseline = Callable[
    [Problem, BaselineSettings, np.random.Generator, OnTrial], tuple[BaselineTrial, ...]
]
"""A method of recovery: returns its physical trials, at most ``settings.trials``."""
