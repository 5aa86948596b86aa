"""Simulator: batches of closed-loop rollouts, short predictions and ensembles of the self-model."""

import copy
from collections.abc import Callable, Sequence
from functools import lru_cache, partial

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import CommandSource
from selfmodel.faults.build import apply_faults, build
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.robot.embodiment import Embodiment
from selfmodel.robot.mujoco_errors import uncounted_warnings
from selfmodel.robot.robot import Robot
from selfmodel.simulation.batch import SimulationResult, SimulationStats, batch_bytes
from selfmodel.simulation.domain import (
    DomainDistribution,
    DomainSample,
    ReadingNoise,
    initial_positions,
)
from selfmodel.simulation.ground_contacts import ground_contact_points
from selfmodel.simulation.prediction import predict
from selfmodel.simulation.reality_gap import perturbed_models
from selfmodel.simulation.requests import Ensemble, Segments
from selfmodel.simulation.rollout import Rollout
from selfmodel.simulation.threads import thread_count
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.signals import Signal

Run = tuple[Hypothesis, CommandSource]
"""A simulation: faults of the robot, and the source of its commands."""

MAX_CACHED_EMBODIMENTS = 1024
"""Largest number of cached models, if the memory does not limit it."""

MAX_CACHED_TRIALS = 16
"""Trials with cached ground contact points."""

MAX_CACHED_ENSEMBLES = 16
"""Largest number of cached ensembles, one per edit of the model's specification."""

CACHED_SHARE = 0.5
"""Size of the cached models, and of the cached ensembles, relative to the models of a batch."""

_ENSEMBLE_MODELS = 8


class Simulator:
    """Batch simulator of one robot; a run is bit-identical in every batch and thread count.

    Example:
        >>> import selfmodel
        >>> robot = selfmodel.load_robot("quadruped")
        >>> walk = selfmodel.read_log("before.mcap").trial.plan.controller
        >>> damaged = selfmodel.parse_hypothesis("break:front_left_knee", robot)
        >>> runs = [(selfmodel.Hypothesis(), walk), (damaged, walk)]
        >>> result = selfmodel.Simulator(robot).run(runs, steps=20, record=["base_position"])
        >>> result.behaviour["base_position"].shape
        (2, 20, 3)

    Args:
        robot: The healthy robot.
        threads: Threads of MuJoCo's steps, including the caller's; 0 for all processors.
        stats: Statistics that are updated; new ones by default.
    """

    def __init__(
        self,
        robot: Robot,
        threads: int = 0,
        stats: SimulationStats | None = None,
    ) -> None:
        self.robot = robot
        self.threads = thread_count(threads)
        self.stats = SimulationStats() if stats is None else stats
        # A quadruped or hexapod has 0.3 MB, a dog with its meshes 5 MB.
        affordable = int(CACHED_SHARE * batch_bytes()) // int(robot.model.nbuffer)
        self._embodiment = lru_cache(max(1, min(MAX_CACHED_EMBODIMENTS, affordable)))(
            partial(build, robot)
        )
        self._contact_points = lru_cache(MAX_CACHED_TRIALS)(partial(ground_contact_points, robot))
        ensembles = max(1, min(MAX_CACHED_ENSEMBLES, affordable // _ENSEMBLE_MODELS))
        self._members = lru_cache(ensembles)(partial(perturbed_models, robot))

    def run(self, runs: Sequence[Run], steps: int, record: Sequence[Signal]) -> SimulationResult:
        """Simulates each run for ``steps`` control steps from the initial pose.

        Args:
            runs: At least one run.
            steps: Control steps, and rows of every signal.
            record: Signals to record; other signals are not computed.
        """
        embodiments = [self._embodiment(hypothesis) for hypothesis, _ in runs]
        return self._run(embodiments, [driver for _, driver in runs], steps, record)

    def predict(
        self,
        hypotheses: Sequence[Hypothesis],
        segments: Segments,
        observed: Behaviour | None = None,
    ) -> SimulationResult:
        """Predicts segments of a trial under each hypothesis; see ``prediction.predict``.

        Args:
            hypotheses: At least one hypothesis.
            segments: Initial states and commands.
            observed: Behaviour of the trial, for fault kinds whose model adapts to its ground
                contacts. If None, or without the base's position in the segments, such a fault
                has the self-model's own ground.
        """
        embodiments = [self._embodiment(hypothesis) for hypothesis in hypotheses]
        if observed is not None and "base_position" in segments.states:
            embodiments = [
                self._adapted_to_contacts(embodiment, hypothesis, observed)
                for embodiment, hypothesis in zip(embodiments, hypotheses, strict=True)
            ]
        first: dict[Hypothesis, int] = {}
        same_dynamics_as = [
            first.setdefault(hypothesis.dynamics_part, i) for i, hypothesis in enumerate(hypotheses)
        ]
        return predict(
            self.robot,
            embodiments,
            segments,
            same_dynamics_as=same_dynamics_as,
            threads=self.threads,
            stats=self.stats,
        )

    def _adapted_to_contacts(
        self, embodiment: Embodiment, hypothesis: Hypothesis, observed: Behaviour
    ) -> Embodiment:
        """Returns an embodiment adapted to the ground contacts of a trial."""
        faults = [fault for fault in hypothesis.faults if fault.kind.adapts_to_contacts]
        if not faults:
            return embodiment
        own = copy.deepcopy(embodiment)  # the argument is in the cache
        for fault in faults:
            fault.kind.adapt_to_contacts(own, fault, self._contact_points(observed))
        return own

    def run_ensemble(
        self,
        hypotheses: Sequence[Hypothesis],
        driver: CommandSource,
        steps: int,
        ensemble: Ensemble,
    ) -> SimulationResult:
        """Simulates each hypothesis with each member of an ensemble of perturbed self-models.

        Args:
            hypotheses: At least one hypothesis.
            driver: Source of the commands.
            steps: Control steps, and rows of every signal.
            ensemble: Number of members, gap level and recorded signals.

        Returns:
            Signals of ``(n, members, steps, width)``; a hypothesis has diverged if any member has.
        """
        embodiments = [
            apply_faults(model, self.robot.anatomy, hypothesis)
            for hypothesis in hypotheses
            for model in self._members(hypothesis.spec_part, ensemble.members, ensemble.level)
        ]
        flat = self._run(embodiments, [driver] * len(embodiments), steps, ensemble.record)
        grouped = flat.grouped(len(hypotheses), ensemble.members)
        return SimulationResult(grouped.behaviour, np.asarray(grouped.diverged.any(axis=1)))

    def run_under(
        self,
        conditions: Sequence[DomainSample],
        uncertainty: DomainDistribution,
        drivers: Sequence[CommandSource],
        steps: int,
        record: Sequence[Signal],
    ) -> SimulationResult:
        """Simulates each driver under each condition.

        Args:
            conditions: At least one condition.
            uncertainty: Distribution of the conditions.
            drivers: Sources of the commands, at least one.
            steps: Control steps, and rows of every signal.
            record: Signals to record.

        Returns:
            Signals of ``(drivers, conditions, steps, width)``, and a mask of
            ``(drivers, conditions)``.
        """
        robot, count = self.robot, len(drivers)
        embodiments = [condition.embodiment(robot) for condition in conditions]
        start = initial_positions(robot, embodiments, conditions, uncertainty.start)
        flat = self._run(
            [*embodiments] * count,
            [driver for driver in drivers for _ in conditions],
            steps,
            record,
            start=np.tile(start, (count, 1)),
            disturb=ReadingNoise(robot.anatomy, embodiments, conditions, uncertainty).add,
        )
        return flat.grouped(count, len(conditions))

    @uncounted_warnings()
    def _run(
        self,
        embodiments: Sequence[Embodiment],
        drivers: Sequence[CommandSource],
        steps: int,
        record: Sequence[Signal],
        *,
        start: FloatArray | None = None,
        disturb: Callable[[FloatArray], None] = lambda _: None,
    ) -> SimulationResult:
        robot, n = self.robot, len(embodiments)
        rollout = Rollout(
            robot,
            embodiments,
            drivers,
            record,
            threads=self.threads,
            stats=self.stats,
            start=start,
            disturb=disturb,
        )
        # Steps first during the run, so that each step is written to contiguous memory.
        kept = {
            signal: np.empty((steps, n, robot.anatomy.names.width(signal))) for signal in record
        }
        for k in rollout.steps(steps):
            for signal, rows in kept.items():
                rows[k] = rollout.live[signal]()
        diverged = rollout.diverged()
        self.stats.runs += n
        self.stats.diverged += int(diverged.sum())
        signals = {
            signal: np.ascontiguousarray(rows.swapaxes(0, 1)) for signal, rows in kept.items()
        }
        time = np.arange(steps, dtype=np.float64) * robot.control_timestep
        return SimulationResult(Behaviour(robot.anatomy.names, time, signals), diverged)
