"""Batches of MuJoCo simulations, closed-loop rollouts on them, and their memory.

The simulator and the simulated physical robot step the same rollout, so that the robot equals the
simulator's to the bit.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter
from typing import TypeVar

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.controllers.controller import TASK_PREFIX, CommandSource, make_batch
from selfmodel.isolation import available_memory
from selfmodel.robot.actuators import holding_commands
from selfmodel.robot.anatomy import added_steps, split_delay
from selfmodel.robot.model_variant import ModelVariant
from selfmodel.robot.mujoco_errors import mujoco_errors_as_input_errors
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import Bind, Reader, SensorReader, SignalSource, observed_fields
from selfmodel.simulation.requests import ClosedLoop, Ensemble, Request, Segments
from selfmodel.trials.signals import SIGNALS, Signal
from selfmodel.trials.trajectory import Trajectory

Name = TypeVar("Name", bound=str)

Disturb = Callable[[FloatArray, Mapping[str, FloatArray]], None]
"""Changes the readings, ``(n, sensors)``, and the other observed signals of a step in place."""


@dataclass
class SimulationStats:
    """Cumulative numbers of simulations, of control steps, and of simulations that diverged.

    ``physics_seconds`` is the wall time of MuJoCo's steps, s.
    """

    runs: int = 0
    steps: int = 0
    diverged: int = 0
    physics_seconds: float = 0.0

    def count(self, runs: int, steps: int, diverged: BoolArray) -> None:
        """Adds the simulations of a batch."""
        self.runs += runs
        self.steps += steps
        self.diverged += int(diverged.sum())

    @contextmanager
    def physics(self) -> Iterator[None]:
        """Adds the time of a block to ``physics_seconds``."""
        clock = perf_counter()
        yield
        self.physics_seconds += perf_counter() - clock


@dataclass(frozen=True, eq=False)
class SimulationResult:
    """Result of a batch of runs.

    Attributes:
        trajectory: The recorded signals, with a leading axis of ``n``.
        diverged: Mask of the runs that diverged, ``(n,)``; their signals are invalid.
    """

    trajectory: Trajectory
    diverged: BoolArray

    def grouped(self, *shape: int) -> "SimulationResult":
        """Returns the result with its axis of runs, ``(n,)``, reshaped in row-major order."""
        flat = self.trajectory
        signals = {
            signal: values.reshape(*shape, *values.shape[1:])
            for signal, values in flat.signals.items()
        }
        return SimulationResult(
            Trajectory(flat.names, flat.time, signals), np.asarray(self.diverged.reshape(shape))
        )


class RobotBatch:
    """A batch with one simulation per variant, which continues when some of them diverge.

    A simulation with a MuJoCo error is stepped no longer. MuJoCo resets a simulation with a
    warning, which continues to be stepped: its values are invalid, but the simulations of a batch
    are independent. Both are recorded as diverged, so the users of a batch do not count MuJoCo's
    warnings. The model is that of the layout of all variants.

    Attributes:
        bind: Returns the array of a field of MjData, ``(simulations, width)``, which changes with
            every step. A field that is bound after a step remains zero until the next one.
        running: Indices of the simulations that are stepped.

    Raises:
        InputError: MuJoCo cannot simulate the models, such as for lack of memory.
    """

    def __init__(
        self, model: mujoco.MjModel, variants: Sequence[ModelVariant], threads: int
    ) -> None:
        with mujoco_errors_as_input_errors("simulate the model"):
            self._batch = Batch(model, len(variants), nthread=threads)
            self._batch.set_models([variant.model for variant in variants])
        self.bind: Bind = self._batch.bind
        self._ids: IndexArray | None = None
        self.running: IndexArray = np.arange(len(variants))
        self._failed, self._ended = np.zeros((2, len(variants)), dtype=bool)

    def end(self, ended: BoolArray) -> None:
        """Steps some simulations no longer, by their mask, ``(n,)``; they keep their states."""
        if (ended & ~self._ended).any():
            self._ended |= ended
            self._leave_out()

    def reset(self, stage: mujoco.mjtStage) -> None:
        """Resets all simulations to the reference pose, and computes up to a stage of a step."""
        with self._failures():
            self._batch.reset(stage=stage)

    def forward(self) -> None:
        """Computes all quantities that depend on the state (``mj_forward``)."""
        with self._failures():
            self._batch.forward(self._ids)

    def step(self, substeps: int, stage: mujoco.mjtStage = mujoco.mjtStage.mjSTAGE_NONE) -> None:
        """Advances by a number of physics steps, and computes up to a stage of the next one."""
        with self._failures():
            self._batch.step(self._ids, nstep=substeps, stage=stage)

    def rollout(self, commands: FloatArray, fields: Sequence[str]) -> dict[str, FloatArray]:
        """Advances the running simulations by commands, ``(simulations, physics steps, motors)``.

        Returns:
            Values of bound fields after each physics step, ``(running, physics steps, width)``.
        """
        ids, steps = self.running, commands.shape[1]
        out = {name: np.zeros((len(ids), steps, self.bind(name).shape[1])) for name in fields}
        with self._failures():
            self._batch.rollout(steps, commands[ids], record=fields, ids=ids, out=out)
        return out

    @contextmanager
    def _failures(self) -> Iterator[None]:
        try:
            yield
        except SimulationError as error:
            self._failed[error.ids] = True
            self._leave_out()

    def _leave_out(self) -> None:
        self._ids = self.running = np.flatnonzero(~(self._failed | self._ended))

    def diverged(self) -> BoolArray:
        """Returns a mask of the simulations that diverged or had a warning, ``(n,)``."""
        warned: BoolArray = self._batch.warning[:, :, 1].any(axis=1)
        return np.asarray(self._failed | warned)


def live_signals(
    robot: Robot, bind: Bind, variants: Sequence[ModelVariant], record: Iterable[Name]
) -> dict[Name, Reader]:
    """Returns functions that read recorded signals, and observations of tasks, from a batch."""
    state = dict[str, SignalSource](observed_fields(robot, variants).items())
    if tasks := [name for name in record if name.startswith(TASK_PREFIX)]:
        from selfmodel.robot.observations import observation_source  # noqa: PLC0415  # few have one

        for name in tasks:
            state[name] = observation_source(name.removeprefix(TASK_PREFIX), robot.model)
    return {name: state[name](bind) for name in record if name not in ("sensors", "commands")}


class Rollout:
    """Closed-loop rollouts of a batch of robots of one layout.

    Args:
        robot: The robot as its model describes it.
        variants: The robot of each rollout, with its faults.
        drivers: Source of the commands of each rollout.
        record: Signals that ``live`` reads.
        threads: Threads of MuJoCo's steps.
        stats: Statistics that are updated.
        start: Initial generalised positions, ``(n, nq)``; None for the reference pose.
        speeds: Initial generalised velocities, ``(n, nv)``, with ``start``; None for rest.
        disturb: Changes the readings of each step, ``(n, sensors)``, and the other signals that
            the controllers observe, before they receive them.
        added_delay: Control delay in addition to that of the robot and its faults, control steps.

    Attributes:
        live: Function that reads each recorded signal, ``(n, width)``. The arrays change with the
            next step.
        bind: Returns the fields of the states, as of ``RobotBatch``.

    Raises:
        InputError: MuJoCo cannot simulate the models, such as for lack of memory.
    """

    def __init__(
        self,
        robot: Robot,
        variants: Sequence[ModelVariant],
        drivers: Sequence[CommandSource],
        record: Sequence[Signal],
        *,
        threads: int = 1,
        stats: SimulationStats | None = None,
        start: FloatArray | None = None,
        speeds: FloatArray | None = None,
        disturb: Disturb = lambda _readings, _observed: None,
        added_delay: int = 0,
    ) -> None:
        self._stats = SimulationStats() if stats is None else stats
        self._substeps, self._disturb = robot.substeps, disturb
        model, sensors = variants[0].model, len(robot.anatomy.sensors)
        self._batch = batch = RobotBatch(model, variants, threads)
        self.bind: Bind = batch.bind
        self._reader = SensorReader(model, robot.anatomy, variants)
        silent = [variant.silent_neurons for variant in variants]
        self._controllers = make_batch(drivers, silent, sensors)
        self._observe = live_signals(robot, batch.bind, variants, self._controllers.observed)
        # An observation of a task is of the state after a step, as dm_control's are.
        stages, tasks = mujoco.mjtStage, {*self._observe} - {*SIGNALS}
        self._stage = stages.mjSTAGE_VEL if tasks else stages.mjSTAGE_NONE
        self._sensordata, self._qpos = batch.bind("sensordata"), batch.bind("qpos")
        whole, self._part = split_delay(robot.control_delay, robot.substeps)
        added = [
            added_steps(robot.control_delay, float(variant.added_delay[0])) for variant in variants
        ]
        # Delay line of the commands; the motors hold the initial pose until the first arrives.
        self._delays = whole + bool(self._part) + added_delay + np.array(added, dtype=np.intp)
        self._motors = batch.bind("ctrl")
        line = (int(self._delays.max()) + 1, *self._motors.shape)
        self._sent = np.broadcast_to(holding_commands(robot.model), line).copy()
        self._commands = np.zeros(self._motors.shape)
        self.live: dict[Signal, Reader] = {
            **live_signals(robot, batch.bind, variants, record),
            "sensors": lambda: self._controllers.readings,
            # Those of the controllers, before the control delay.
            "commands": lambda: self._commands,
        }
        if start is None:
            batch.reset(mujoco.mjtStage.mjSTAGE_ACC)
        else:
            batch.reset(mujoco.mjtStage.mjSTAGE_NONE)
            self._qpos[:] = start
            if speeds is not None:
                batch.bind("qvel")[:] = speeds
            batch.forward()

    def steps(self, count: int) -> Iterator[int]:
        """Yields the number of each control step, whose signals can be read until the next one."""
        for k in range(count):
            if k:
                with self._stats.physics():
                    if self._part:
                        self._batch.step(self._part)
                        self._command(k)
                    self._batch.step(self._substeps - self._part, self._stage)
            self._reader.read(self._sensordata, self._qpos, self._controllers.readings)
            for signal, value in self._observe.items():
                self._controllers.observed[signal][:] = value()
            self._disturb(self._controllers.readings, self._controllers.observed)
            self._controllers.step(self._commands)
            self._sent[k % len(self._sent)] = self._commands
            self._command(k)
            self._stats.steps += len(self._batch.running)
            yield k

    @property
    def observed(self) -> Mapping[str, FloatArray]:
        """What the controllers observe besides the readings, ``(n, width)`` each."""
        return self._controllers.observed

    def _command(self, step: int) -> None:
        """Sends the motors the commands that reach them at a step, by the delay of each run."""
        rows = (step - self._delays) % len(self._sent)
        self._motors[:] = self._sent[rows, np.arange(len(rows))]

    def end(self, ended: BoolArray) -> int:
        """Ends some rollouts, by their mask, ``(n,)``; returns how many go on.

        The state of a rollout that has ended does not change.
        """
        self._batch.end(ended)
        running = self._batch.running
        self._controllers.end(running)
        return len(running)

    def diverged(self) -> BoolArray:
        """Returns a mask of the rollouts that have diverged or had a MuJoCo warning, ``(n,)``."""
        return self._batch.diverged()


MAX_BATCH = 512 * 2**20
"""Largest memory of a batch, bytes; a larger one is not faster."""

_FREE_SHARE = 0.25
"""Share of the available memory that a batch may take: other processes may run studies beside."""

_NUMBER_BYTES, _BODY_NUMBERS, _COPIES = 8, 16, 3
"""Bytes of a number; numbers of the pose and the velocity of a body that a batch reads; arrays of a
recorded signal at one time: during the run, its result, and a comparison."""


def batch_bytes() -> int:
    """Returns the memory that the models, simulations and signals of a batch may take, bytes."""
    return min(MAX_BATCH, int(_FREE_SHARE * available_memory()))


def largest_batch(robot: Robot, request: Request, steps: int) -> int:
    """Returns the largest number of hypotheses to simulate together; at least one."""
    return max(1, batch_bytes() // hypothesis_bytes(robot, request, steps))


def hypothesis_bytes(robot: Robot, request: Request, steps: int) -> int:
    """Returns the memory of the simulations of one hypothesis, bytes.

    Each variant has its own model, with all height fields, meshes and textures.
    """
    match request:
        case ClosedLoop():
            models, simulations, rows = 1, 1, steps
        case Segments():  # a fault may adapt the model to a trial's ground contacts
            count = len(request.starts)
            models, simulations, rows = 2, count, count * (request.horizon + 1)
        case Ensemble():
            models, simulations, rows = request.members, request.members, request.members * steps
    model = robot.model
    state = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION)
    numbers = state + model.nsensordata + _BODY_NUMBERS * model.nbody
    widths = sum(robot.anatomy.names.width(signal) for signal in request.record)
    return models * int(model.nbuffer) + _NUMBER_BYTES * (
        simulations * int(numbers) + _COPIES * rows * widths
    )
