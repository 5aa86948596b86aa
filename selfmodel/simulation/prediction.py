"""Short predictions from logged states under logged commands."""

from collections.abc import Mapping, Sequence
from time import perf_counter

import mujoco
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.errors import InputError
from selfmodel.robot.control_delay import MAX_CONTROL_DELAY, added_steps, split_delay
from selfmodel.robot.embodiment import Embodiment
from selfmodel.robot.mujoco_errors import uncounted_warnings
from selfmodel.robot.robot import Robot
from selfmodel.robot.sensing import SensorReader
from selfmodel.robot.state import state_writer
from selfmodel.simulation.activations import initial_activations
from selfmodel.simulation.batch import (
    LiveBatch,
    SimulationResult,
    SimulationStats,
    live_signals,
    new_batch,
)
from selfmodel.simulation.requests import Segments
from selfmodel.trials.behaviour import Behaviour


@uncounted_warnings()
def predict(
    robot: Robot,
    embodiments: Sequence[Embodiment],
    segments: Segments,
    *,
    same_dynamics_as: Sequence[int] | None = None,
    threads: int,
    stats: SimulationStats,
    delay: float | None = None,
) -> SimulationResult:
    """Predicts segments of a trial with several models of a robot.

    Segments with the whole state are simulated in parallel. Segments without the position and the
    linear velocity of the base, or with an unknown hinge, are simulated in sequence: each begins
    with the base, or the hinge, in the predicted state at the end of the segment before. The first
    begins in the initial pose.

    Welded joints begin at their welded angle. The hinges of a detached limb have no logged motion:
    if the segments include joint positions, these hinges begin at rest, at their median angle over
    all segments; a hinge without a known angle in its initial pose.

    Args:
        robot: The healthy robot.
        embodiments: At least one model, with the layout of the robot.
        segments: Initial states and commands.
        same_dynamics_as: For each embodiment the index of the first embodiment with the same
            dynamics, whatever its sensors: only that embodiment is simulated. By default all are.
        threads: Threads of MuJoCo's steps, including the caller's.
        stats: Statistics that are updated.
        delay: Control delay, control steps; the robot's by default.

    Returns:
        Signals of ``(n, segments, horizon + 1, width)``; a run has diverged if any of its segments
        has.

    Raises:
        InputError: The segments do not include all commands that are in the delay line.
    """
    lag, substeps = robot.control_delay if delay is None else delay, robot.substeps
    delay_steps, part = split_delay(lag, substeps)
    n, count, horizon = len(embodiments), len(segments.commands), segments.horizon
    simulated, source_of = np.unique(
        np.arange(n) if same_dynamics_as is None else np.asarray(same_dynamics_as),
        return_inverse=True,
    )
    moving = [embodiments[i] for i in simulated]
    added = _added_steps(moving, segments, lag)
    stages: list[IndexArray] = np.split(np.arange(count), 1 if segments.independent else count)
    together = len(stages[0])
    bodies = _repeated(moving, together)
    batch = new_batch(robot.model, bodies, threads)
    current = _CurrentFields(batch)
    qpos, sensordata = current.bind("qpos"), current.bind("sensordata")
    # Independent noise per segment: a segment alone is too short to estimate a noise level.
    reader = SensorReader(robot.model, robot.anatomy, embodiments, together)
    readings = np.empty((n * together, len(robot.anatomy.sensors)))
    # Row of the batch for each row of the result.
    batch_rows = (source_of[:, np.newaxis] * together + np.arange(together)).ravel()
    live = live_signals(robot, current.bind, bodies, segments.record)
    kept = {
        signal: np.empty((n, count, horizon + 1, robot.anatomy.names.width(signal)))
        for signal in segments.record
    }
    inputs = _BatchInputs(robot, batch, moving, segments, delay_steps + added)
    # After all bindings: a field that is bound later remains zero until the next step.
    alive = LiveBatch(batch)
    alive.reset(mujoco.mjtStage.mjSTAGE_POS)

    def keep(stage: IndexArray, k: int) -> None:
        if "sensors" in kept:
            reader.read(sensordata[batch_rows], qpos[batch_rows], readings)
            kept["sensors"][:, stage, k] = readings.reshape(n, together, -1)
        for signal, read in live.items():
            kept[signal][:, stage, k] = read()[batch_rows].reshape(n, together, -1)

    chunk = max(1, CHUNK_BYTES // (substeps * current.bytes))
    for stage in stages:
        inputs.write_states(stage)
        clock = perf_counter()
        alive.forward()
        stats.physics_seconds += perf_counter() - clock
        current.read()
        keep(stage, 0)
        for first in range(0, horizon, chunk):
            steps = range(first, min(first + chunk, horizon))
            commands = inputs.commands(stage, steps, part, substeps)
            clock = perf_counter()
            recorded = alive.rollout(commands, current.names)
            stats.physics_seconds += perf_counter() - clock
            for number, k in enumerate(steps, 1):
                current.set({name: own[:, number * substeps - 1] for name, own in recorded.items()})
                keep(stage, k + 1)
    diverged: BoolArray = np.any(alive.diverged()[batch_rows].reshape(n, together), axis=1)
    stats.runs += n
    stats.steps += len(moving) * count * horizon
    stats.diverged += int(diverged.sum())
    time = np.arange(horizon + 1, dtype=np.float64) * robot.control_timestep
    addresses = [int(robot.model.joint(name).qposadr[0]) for name in robot.anatomy.hinges]
    welded = [np.isin(addresses, [address for address, _, _ in own.welded]) for own in embodiments]
    detached = [[name in own.detached for name in robot.anatomy.hinges] for own in embodiments]
    predicted = Behaviour(
        robot.anatomy.names, time, kept, welded=np.array(welded), detached=np.array(detached)
    )
    return SimulationResult(predicted, diverged)


def _added_steps(moving: Sequence[Embodiment], segments: Segments, lag: float) -> IndexArray:
    """Returns the control delay that the faults of each embodiment add, control steps.

    Raises:
        InputError: The segments do not include all commands that are in the delay line.
    """
    added = [added_steps(lag, float(embodiment.added_delay[0])) for embodiment in moving]
    longest = lag + max(added)
    if segments.lead < longest:
        raise InputError(
            f"the robot's commands take effect {longest} steps late, and segments have a lead "
            f"of {segments.lead}: a comparator needs a lead of {MAX_CONTROL_DELAY}"
        )
    return np.array(added, dtype=np.intp)


CHUNK_BYTES = 2**25
"""Memory of the fields that are recorded in every physics step before they are read, bytes."""


class _CurrentFields:
    """Values of some fields of a batch at one step, ``(simulations, width)`` each.

    Args:
        batch: The batch.
    """

    def __init__(self, batch: mujoco.batch.Batch) -> None:
        self._batch = batch
        self._live: dict[str, FloatArray] = {}
        self._values: dict[str, FloatArray] = {}

    @property
    def names(self) -> list[str]:
        """Names of the fields."""
        return list(self._values)

    @property
    def bytes(self) -> int:
        """Size of the values."""
        return sum(values.nbytes for values in self._values.values())

    def bind(self, name: str) -> FloatArray:
        """Returns the array of the values of a field."""
        self._live[name] = self._batch.bind(name)
        return self._values.setdefault(name, np.zeros_like(self._live[name]))

    def read(self) -> None:
        """Sets all values to those of the batch."""
        self.set(self._live)

    def set(self, values: Mapping[str, FloatArray]) -> None:
        """Sets all values, by name."""
        for name, own in values.items():
            self._values[name][:] = own


def _repeated(embodiments: Sequence[Embodiment], times: int) -> list[Embodiment]:
    return [embodiment for embodiment in embodiments for _ in range(times)]


class _BatchInputs:
    """Writes logged states and commands into a batch, for every embodiment by its delay.

    Args:
        robot: The healthy robot.
        batch: The batch; its state is written.
        embodiments: Embodiments of the batch, each in adjacent rows.
        segments: Initial states and commands.
        delays: Control delay of each embodiment, whole control steps, ``(embodiments,)``.
    """

    def __init__(
        self,
        robot: Robot,
        batch: mujoco.batch.Batch,
        embodiments: Sequence[Embodiment],
        segments: Segments,
        delays: IndexArray,
    ) -> None:
        self._segments = segments
        self._first = segments.lead - delays
        by_delay = {
            delay: initial_activations(robot, segments, delay) for delay in set(delays.tolist())
        }
        self._activations = np.array([by_delay[delay] for delay in delays.tolist()])
        self._n = len(embodiments)
        models = [own.model for own in embodiments for _ in range(batch.nsim // len(embodiments))]
        self._write = state_writer(robot, batch.bind, *models)
        self._act = batch.bind("act")
        self._qpos, self._qvel = batch.bind("qpos"), batch.bind("qvel")
        self._offsets = np.array([own.encoder_offset for own in embodiments])
        median = _median_angles(robot, segments)
        self._constant_angles = [
            (number, *constant)
            for number, own in enumerate(embodiments)
            for constant in (*own.welded, *(median[name] for name in own.detached & median.keys()))
        ]

    def write_states(self, stage: IndexArray) -> None:
        """Writes the initial states of some segments, given by their indices."""
        states = self._segments.states
        logged = {signal: self._for_all(values[stage]) for signal, values in states.items()}
        if "joint_positions" in logged and self._offsets.any():
            logged["joint_positions"] -= np.repeat(self._offsets, len(stage), axis=0)
        self._write(logged)
        self._act[:] = self._activations[:, stage].reshape(self._act.shape)
        for number, position, velocity, angle in self._constant_angles:
            rows = slice(number * len(stage), (number + 1) * len(stage))
            self._qpos[rows, position] = angle
            self._qvel[rows, velocity] = 0.0

    def commands(self, stage: IndexArray, steps: range, part: int, substeps: int) -> FloatArray:
        """Returns the commands of each physics step, ``(simulations, physics steps, motors)``.

        Args:
            stage: Indices of the segments.
            steps: Control steps of the segments.
            part: Physics steps of a control step at which the command before it still holds.
            substeps: Physics steps of a control step.
        """
        arriving = [
            self._segments.commands[stage, (self._first + k)[:, np.newaxis]].reshape(
                len(self._qpos), -1
            )
            for k in range(steps.start - 1, steps.stop)
        ]
        rows = np.stack(arriving, axis=1)[:, :, np.newaxis]
        before = np.repeat(rows[:, :-1], part, axis=2)
        after = np.repeat(rows[:, 1:], substeps - part, axis=2)
        return np.concatenate([before, after], axis=2).reshape(len(rows), -1, rows.shape[-1])

    def _for_all(self, values: FloatArray) -> FloatArray:
        return np.tile(values, (self._n, 1))


def _median_angles(robot: Robot, segments: Segments) -> dict[str, tuple[int, int, float]]:
    """Returns the ``qpos`` and ``qvel`` index and the median angle of each hinge, by name.

    A hinge without a known angle has that of the initial pose. The result is empty for segments
    without joint positions.
    """
    angles = segments.resting_angles
    if angles is None:
        return {}
    hinges = [robot.model.joint(name) for name in robot.anatomy.hinges]
    return {
        hinge.name: (
            int(hinge.qposadr[0]),
            int(hinge.dofadr[0]),
            float(hinge.qpos0[0]) if np.isnan(angle) else angle,
        )
        for hinge, angle in zip(hinges, angles.tolist(), strict=True)
    }
