"""The self-model in motion: many robots, each with its hypothesis and driver, in one batch."""

import copy
from collections.abc import Sequence
from functools import lru_cache, partial
from time import perf_counter

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.command_source import CommandSource, make_batch
from selfmodel.faults.build import apply_faults, build
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.physical.reality_gap import perturbed_models
from selfmodel.robot.embodiment import Embodiment
from selfmodel.robot.robot import Robot
from selfmodel.robot.sensing import SensorReader
from selfmodel.simulation.batch import LiveBatch, live_signals, new_batch, silence_mujoco_warnings
from selfmodel.simulation.ground_contacts import felt_points
from selfmodel.simulation.outcome import SimulationResult, SimulationStats
from selfmodel.simulation.prediction import predict
from selfmodel.simulation.requests import Ensemble, Segments
from selfmodel.trials.behaviour import Behaviour, Signal

Run = tuple[Hypothesis, CommandSource]
"""What one simulation runs: a robot with what the hypothesis says wrong, and what drives it."""

REMEMBERED_EMBODIMENTS = 1024
"""Built models that are kept, where they are small."""

REMEMBERED_TRIALS = 16
"""Trials whose felt ground is kept."""

REMEMBERED_SHAPES = 16
"""Shapes of the robot and its world of which the members of an ensemble are kept."""

REMEMBERED_BYTES = 2**29
"""What they may take: one of our robots' takes 0.3 MB, a dog's with its meshes 5 MB."""


class Simulator:
    """Steps batches of one robot closed loop; a run's bits do not depend on its batch or threads.

    Args:
        robot: The robot with nothing wrong.
        threads: Threads that MuJoCo steps on, the caller's included.
        stats: Is told what was simulated; a new one if none is given.
    """

    def __init__(self, robot: Robot, threads: int, stats: SimulationStats | None = None) -> None:
        self.robot = robot
        self.threads = threads
        self.stats = SimulationStats() if stats is None else stats
        room = REMEMBERED_BYTES // int(robot.model.nbuffer)
        self._embodiment = lru_cache(max(1, min(REMEMBERED_EMBODIMENTS, room)))(
            partial(build, robot)
        )
        self._felt = lru_cache(REMEMBERED_TRIALS)(partial(felt_points, robot))
        self._members = lru_cache(REMEMBERED_SHAPES)(partial(perturbed_models, robot))

    def run(self, runs: Sequence[Run], steps: int, record: Sequence[Signal]) -> SimulationResult:
        """Simulates each run for ``steps`` control steps from its start.

        Args:
            runs: At least one.
            steps: Control steps, and rows of every signal.
            record: The signals to keep; what is not kept costs nothing.
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
            hypotheses: At least one.
            segments: Where to begin and what was commanded.
            observed: The trial, from which the ground is felt where a hypothesis says that it is
                not known; without it, or where the base's place is not part of the segments'
                state, the self-model's own is taken.
        """
        embodiments = [self._embodiment(hypothesis) for hypothesis in hypotheses]
        if observed is not None and "base_position" in segments.states:
            embodiments = [
                self._on_felt_ground(embodiment, hypothesis, observed)
                for embodiment, hypothesis in zip(embodiments, hypotheses, strict=True)
            ]
        first: dict[Hypothesis, int] = {}
        moves_as = [
            first.setdefault(hypothesis.dynamics_part, i) for i, hypothesis in enumerate(hypotheses)
        ]
        return predict(
            self.robot,
            embodiments,
            segments,
            moves_as=moves_as,
            threads=self.threads,
            stats=self.stats,
        )

    def _on_felt_ground(
        self, embodiment: Embodiment, hypothesis: Hypothesis, observed: Behaviour
    ) -> Embodiment:
        ways = [
            (fault.kind.adapt_to_contacts, fault)
            for fault in hypothesis.faults
            if fault.kind.adapt_to_contacts
        ]
        if not ways:
            return embodiment
        own = copy.deepcopy(embodiment)  # the other is remembered
        for feel, fault in ways:
            feel(own, fault, self._felt(observed))
        return own

    def run_ensemble(
        self,
        hypotheses: Sequence[Hypothesis],
        driver: CommandSource,
        steps: int,
        ensemble: Ensemble,
    ) -> SimulationResult:
        """Simulates each hypothesis with each of some self-models that differ a little.

        Args:
            hypotheses: At least one.
            driver: What drives the robot.
            steps: Control steps, and rows of every signal.
            ensemble: How many self-models, and how different.

        Returns:
            Signals of ``(n, members, steps, width)``; a hypothesis has diverged if any member has.
        """
        embodiments = [
            apply_faults(model, self.robot.anatomy, hypothesis)
            for hypothesis in hypotheses
            for model in self._members(hypothesis.spec_part, ensemble.members, ensemble.level)
        ]
        flat = self._run(embodiments, [driver] * len(embodiments), steps, ensemble.record)
        outcome = flat.grouped(len(hypotheses), ensemble.members)
        return SimulationResult(outcome.behaviour, np.asarray(outcome.diverged.any(axis=1)))

    def _run(
        self,
        embodiments: Sequence[Embodiment],
        drivers: Sequence[CommandSource],
        steps: int,
        record: Sequence[Signal],
    ) -> SimulationResult:
        robot, n = self.robot, len(embodiments)
        batch = new_batch(robot.model, embodiments, self.threads)
        senses = SensorReader(robot.model, robot.anatomy, embodiments)
        brains = make_batch(
            drivers,
            [embodiment.silent_neurons for embodiment in embodiments],
            len(robot.anatomy.sensors),
        )
        sensordata, qpos, ctrl = (batch.bind(field) for field in ("sensordata", "qpos", "ctrl"))
        motors = _DelayLine(ctrl, robot.control_delay)
        live = live_signals(robot, batch, embodiments, record)
        live |= {"sensors": lambda: brains.readings, "commands": lambda: motors.inlet}
        # By step while it runs, so that a step is written in one piece.
        kept = {
            signal: np.empty((steps, n, robot.anatomy.names.width(signal))) for signal in record
        }
        # After every field is bound: one that is bound later stays zero until the next step.
        batch.reset()
        alive = LiveBatch(batch)
        with silence_mujoco_warnings():
            for k in range(steps):
                senses.read(sensordata, qpos, brains.readings)
                brains.step(motors.inlet)
                motors.advance()
                for signal, rows in kept.items():
                    rows[k] = live[signal]()
                if k + 1 < steps:
                    start = perf_counter()
                    alive.step(robot.substeps)
                    self.stats.physics_seconds += perf_counter() - start
        diverged = alive.diverged()
        self.stats.runs += n
        self.stats.steps += n * steps
        self.stats.diverged += int(diverged.sum())
        signals = {
            signal: np.ascontiguousarray(rows.swapaxes(0, 1)) for signal, rows in kept.items()
        }
        time = np.arange(steps, dtype=np.float64) * robot.control_timestep
        return SimulationResult(Behaviour(robot.anatomy.names, time, signals), diverged)


class _DelayLine:
    """Commands on their way to the motors; before the first arrives, the motors hold 0.

    Args:
        outlet: What the motors obey, ``(n, motors)``, written.
        delay: Control steps from a command to its effect.
    """

    def __init__(self, outlet: FloatArray, delay: int) -> None:
        self._outlet = outlet
        self._line = np.zeros((delay, *outlet.shape))
        self._step = 0
        self.inlet = np.zeros(outlet.shape) if delay else outlet
        """Where the next command is written: where nothing is delayed, the outlet itself."""

    def advance(self) -> None:
        """Takes what stands in the inlet, and hands on what is due."""
        if len(self._line):
            place = self._step % len(self._line)
            self._outlet[:] = self._line[place]
            self._line[place] = self.inlet
            self._step += 1
