"""Simulator: batches of closed-loop rollouts, short predictions and ensembles of the self-model."""

import copy
from collections.abc import Mapping, Sequence
from functools import lru_cache, partial
from time import perf_counter

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.controllers.controller import CommandSource, make_batch
from selfmodel.faults.build import apply_faults, build
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.physical.measurement_noise import dead_sensors
from selfmodel.physical.reality_gap import perturbed_models
from selfmodel.robot.control_delay import added_steps, split_delay
from selfmodel.robot.embodiment import Embodiment
from selfmodel.robot.mujoco_errors import uncounted_warnings
from selfmodel.robot.robot import Robot
from selfmodel.robot.sensing import SensorReader
from selfmodel.simulation.batch import EarlyStop, LiveBatch, live_signals, new_batch
from selfmodel.simulation.batch_memory import batch_bytes
from selfmodel.simulation.conditions import (
    Condition,
    ReadingNoise,
    Uncertainty,
    initial_positions,
)
from selfmodel.simulation.ground_contacts import ground_contact_points
from selfmodel.simulation.outcome import SimulationResult, SimulationStats
from selfmodel.simulation.prediction import predict
from selfmodel.simulation.requests import Ensemble, Segments
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

    def detached_hinges(self, hypothesis: Hypothesis) -> frozenset[str]:
        """Returns the names of the hinges that a hypothesis detaches."""
        return frozenset(self._embodiment(hypothesis).detached)

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
        conditions: Sequence[Condition],
        uncertainty: Uncertainty,
        drivers: Sequence[CommandSource],
        steps: int,
        record: Sequence[Signal],
        *,
        early_stop: EarlyStop | None = None,
    ) -> SimulationResult:
        """Simulates each driver under each condition.

        Args:
            conditions: At least one condition.
            uncertainty: Distribution of the conditions.
            drivers: Sources of the commands, at least one.
            steps: Control steps, and rows of every signal.
            record: Signals to record.
            early_stop: Runs to stop before the end, each of which then has its last row in all
                later rows of its state; none by default.

        Returns:
            Signals of ``(drivers, conditions, steps, width)``, and a mask of
            ``(drivers, conditions)``.
        """
        robot, count = self.robot, len(drivers)
        embodiments = [condition.embodiment(robot) for condition in conditions]
        silent = np.array([dead_sensors(robot.anatomy, own) for own in embodiments])
        start = initial_positions(robot, embodiments, conditions, uncertainty.start)
        flat = self._run(
            [*embodiments] * count,
            [driver for driver in drivers for _ in conditions],
            steps,
            record,
            start=np.tile(start, (count, 1)),
            noise=ReadingNoise(conditions, uncertainty, silent),
            early_stop=early_stop,
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
        noise: ReadingNoise | None = None,
        early_stop: EarlyStop | None = None,
    ) -> SimulationResult:
        robot, n, substeps = self.robot, len(embodiments), self.robot.substeps
        batch = new_batch(robot.model, embodiments, self.threads)
        reader = SensorReader(robot.model, robot.anatomy, embodiments)
        controllers = make_batch(
            drivers,
            [embodiment.silent_neurons for embodiment in embodiments],
            len(robot.anatomy.sensors),
        )
        sensordata, qpos, ctrl = (batch.bind(field) for field in ("sensordata", "qpos", "ctrl"))
        whole, part = split_delay(robot.control_delay, substeps)
        added = [
            added_steps(robot.control_delay, float(embodiment.added_delay[0]))
            for embodiment in embodiments
        ]
        motors = _DelayLine(ctrl, whole + bool(part) + np.array(added, dtype=np.intp))
        live = live_signals(robot, batch, embodiments, record)
        live |= {"sensors": lambda: controllers.readings, "commands": lambda: motors.inlet}
        # Steps first during the run, so that each step is written to contiguous memory.
        kept = {
            signal: np.empty((steps, n, robot.anatomy.names.width(signal))) for signal in record
        }
        # After all bindings: a field that is bound later remains zero until the next step.
        alive = LiveBatch(batch)
        alive.reset(mujoco.mjtStage.mjSTAGE_ACC)
        if start is not None:
            qpos[:] = start
            alive.forward()
        for k in range(steps):
            reader.read(sensordata, qpos, controllers.readings)
            if noise is not None:
                noise.add(controllers.readings)
            controllers.step(motors.inlet)
            motors.advance()
            for signal, rows in kept.items():
                rows[k] = live[signal]()
            if early_stop is not None and k + 1 in early_stop.steps:
                alive.stop(early_stop.chosen(_behaviour(robot, kept, k + 1), alive.diverged()))
            self.stats.steps += alive.running
            if k + 1 < steps:
                clock = perf_counter()
                if part:
                    alive.step(part)
                    motors.release()
                alive.step(substeps - part)
                self.stats.physics_seconds += perf_counter() - clock
        diverged = alive.diverged()
        self.stats.runs += n
        self.stats.diverged += int(diverged.sum())
        return SimulationResult(_behaviour(robot, kept, steps), diverged)


def _behaviour(robot: Robot, kept: Mapping[Signal, FloatArray], steps: int) -> Behaviour:
    """Returns the behaviour of the first steps from rows of ``(steps, n, width)`` per signal."""
    signals = {
        signal: np.ascontiguousarray(rows[:steps].swapaxes(0, 1)) for signal, rows in kept.items()
    }
    time = np.arange(steps, dtype=np.float64) * robot.control_timestep
    return Behaviour(robot.anatomy.names, time, signals)


class _DelayLine:
    """Delay line of the commands; the motors' commands are 0 until the first arrives.

    Args:
        outlet: Commands at the motors, ``(n, motors)``; written.
        delays: Control delay of each run, control steps, rounded up, ``(n,)``.
    """

    def __init__(self, outlet: FloatArray, delays: IndexArray) -> None:
        self._outlet, self._delays = outlet, delays
        longest = int(delays.max())
        self._line = np.zeros((longest + 1, *outlet.shape))
        self._rows = np.arange(len(outlet))
        self._step = 0
        self._delayed = longest > 0
        self.inlet = np.zeros(outlet.shape) if self._delayed else outlet
        """Next commands, ``(n, motors)``; the outlet itself without a delay."""

    def advance(self) -> None:
        """Moves the commands of the inlet into the line, and the delayed ones to the outlet."""
        if self._delayed:
            self._step += 1
            self._line[self._step % len(self._line)] = self.inlet
            self._send(self._delays)

    def release(self) -> None:
        """Moves those commands to the outlet that would be there a step later."""
        self._send(self._delays - 1)

    def _send(self, delays: IndexArray) -> None:
        self._outlet[:] = self._line[(self._step - delays) % len(self._line), self._rows]
