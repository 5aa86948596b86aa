"""The self-model in motion: many robots, each with its hypothesis and driver, in one batch."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from time import perf_counter

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.behaviour import Behaviour, Signal
from selfmodel.driver import Driver, drive
from selfmodel.embodiment import Embodiment
from selfmodel.hypothesis import Hypothesis
from selfmodel.places import places
from selfmodel.robot import Robot
from selfmodel.senses import Senses

Run = tuple[Hypothesis, Driver]
"""What one simulation runs: a robot with what the hypothesis says wrong, and what drives it."""

REMEMBERED_EMBODIMENTS = 1024
"""Built models that are kept: a few tens of kB each."""


@dataclass
class Tally:
    """What a simulator has done so far.

    Attributes:
        runs: Simulations.
        steps: Control steps, over all simulations.
        diverged: Simulations that diverged, or in which MuJoCo warned.
        physics_seconds: Wall time spent inside MuJoCo's steps.
    """

    runs: int = 0
    steps: int = 0
    diverged: int = 0
    physics_seconds: float = 0.0


@dataclass(frozen=True, eq=False)
class Simulated:
    """The outcome of a batch of runs.

    Attributes:
        behaviour: The signals that were asked for, ``(n, steps, width)``.
        diverged: ``(n,)``: which runs mean nothing, because the simulation broke down.
    """

    behaviour: Behaviour
    diverged: BoolArray


class Simulator:
    """Steps batches of one robot closed loop; a run's bits do not depend on its batch or threads.

    Args:
        robot: The robot with nothing wrong.
        threads: Threads that MuJoCo steps on, the caller's included.
    """

    def __init__(self, robot: Robot, threads: int) -> None:
        self.robot = robot
        self.tally = Tally()
        self._threads = threads
        self._embodiment = lru_cache(REMEMBERED_EMBODIMENTS)(robot.build)

    def run(self, runs: Sequence[Run], steps: int, record: Sequence[Signal]) -> Simulated:
        """Simulates each run for ``steps`` control steps from its start.

        Args:
            runs: At least one.
            steps: Control steps, and rows of every signal.
            record: The signals to keep; what is not kept costs nothing.
        """
        robot, n = self.robot, len(runs)
        embodiments = [self._embodiment(hypothesis) for hypothesis, _ in runs]
        batch = _batch(robot.model, embodiments, self._threads)
        senses = Senses(robot.model, robot.anatomy, embodiments)
        brains = drive(
            [driver for _, driver in runs],
            np.array([embodiment.neurons for embodiment in embodiments]),
            len(robot.anatomy.sensors),
        )
        sensordata, qpos, ctrl = (batch.bind(field) for field in ("sensordata", "qpos", "ctrl"))
        live = _live(robot, batch, brains.readings, record)
        # By step while it runs, so that a step is written in one piece.
        kept = {
            signal: np.empty((steps, n, robot.anatomy.names.width(signal))) for signal in record
        }
        # After every field is bound: one that is bound later stays zero until the next step.
        batch.reset()
        alive = _Alive(batch)
        with _counted_not_printed():
            for k in range(steps):
                senses.read(sensordata, qpos, brains.readings)
                brains.step(ctrl)
                for signal, rows in kept.items():
                    values, chosen = live[signal]
                    rows[k] = values[:, chosen]
                if k + 1 < steps:
                    start = perf_counter()
                    alive.step(robot.substeps)
                    self.tally.physics_seconds += perf_counter() - start
        diverged = alive.diverged()
        self.tally.runs += n
        self.tally.steps += n * steps
        self.tally.diverged += int(diverged.sum())
        signals = {
            signal: np.ascontiguousarray(rows.swapaxes(0, 1)) for signal, rows in kept.items()
        }
        time = np.arange(steps, dtype=np.float64) * robot.control_timestep
        return Simulated(Behaviour(robot.anatomy.names, time, signals), diverged)


@contextmanager
def _counted_not_printed() -> Iterator[None]:
    """Keeps MuJoCo's warnings off the terminal and out of a file: each is counted by its run."""
    before, quiet = mujoco.MjLogConfig.get(), mujoco.MjLogConfig.get()
    quiet.logto_console = quiet.logto_file = False
    mujoco.MjLogConfig.set(quiet)
    try:
        yield
    finally:
        mujoco.MjLogConfig.set(before)


class _Alive:
    """Steps the simulations of a batch that MuJoCo has not raised in, and knows which broke down.

    One that MuJoCo warns about is reset by it and goes on, worthless but harmless: rows of a batch
    do not touch each other.
    """

    def __init__(self, batch: Batch) -> None:
        self._batch = batch
        self._ids: IndexArray | None = None
        self._failed = np.zeros(batch.nsim, dtype=bool)

    def step(self, substeps: int) -> None:
        try:
            self._batch.step(self._ids, nstep=substeps)
        except SimulationError as error:
            self._failed[error.ids] = True
            self._ids = np.flatnonzero(~self._failed)

    def diverged(self) -> BoolArray:
        warned: BoolArray = self._batch.warning[:, :, 1].any(axis=1)
        return self._failed | warned


def _batch(model: mujoco.MjModel, embodiments: Sequence[Embodiment], threads: int) -> Batch:
    """A batch with each simulation on its embodiment's model."""
    batch = Batch(model, len(embodiments), nthread=threads)
    batch.set_models([embodiment.model for embodiment in embodiments])
    return batch


def _live(
    robot: Robot, batch: Batch, readings: FloatArray, record: Sequence[Signal]
) -> dict[Signal, tuple[FloatArray, slice | list[int]]]:
    """For each signal the array that always holds its present value, and its columns in it."""
    state = places(robot)
    return {
        signal: (readings, slice(None))
        if signal == "sensors"
        else (batch.bind(state[signal].field), state[signal].columns)
        for signal in record
    }
