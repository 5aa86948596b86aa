"""Short predictions from logged states under logged commands."""

from collections.abc import Sequence
from time import perf_counter

import mujoco
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.errors import InputError
from selfmodel.robot.control_delay import MAX_CONTROL_DELAY, split_delay
from selfmodel.robot.editing.embodiment import Embodiment
from selfmodel.robot.robot import Robot
from selfmodel.robot.state.access import state_writer
from selfmodel.robot.state.sensing import SensorReader
from selfmodel.simulation.activations import initial_activations
from selfmodel.simulation.batch import LiveBatch, live_signals, new_batch
from selfmodel.simulation.outcome import SimulationResult, SimulationStats
from selfmodel.simulation.requests import Segments
from selfmodel.trials.behaviour import Behaviour


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
    lag = robot.control_delay if delay is None else delay
    delay_steps, part = split_delay(lag, robot.substeps)
    if segments.lead < lag:
        raise InputError(
            f"the robot's commands take effect {lag} steps late, and segments have a lead "
            f"of {segments.lead}: a comparator needs a lead of {MAX_CONTROL_DELAY}"
        )
    n, count, horizon = len(embodiments), len(segments.commands), segments.horizon
    simulated, source_of = np.unique(
        np.arange(n) if same_dynamics_as is None else np.asarray(same_dynamics_as),
        return_inverse=True,
    )
    moving = [embodiments[i] for i in simulated]
    stages: list[IndexArray] = np.split(np.arange(count), 1 if segments.independent else count)
    together = len(stages[0])
    bodies = _repeated(moving, together)
    batch = new_batch(robot.model, bodies, threads)
    qpos, sensordata = batch.bind("qpos"), batch.bind("sensordata")
    # Independent noise per segment: a segment alone is too short to estimate a noise level.
    reader = SensorReader(robot.model, robot.anatomy, embodiments, together)
    readings = np.empty((n * together, len(robot.anatomy.sensors)))
    # Row of the batch for each row of the result.
    batch_rows = (source_of[:, np.newaxis] * together + np.arange(together)).ravel()
    live = live_signals(robot, batch, bodies, segments.record)
    kept = {
        signal: np.empty(
            (n, count, horizon + 1, robot.anatomy.names.width(signal)), dtype=np.float64
        )
        for signal in segments.record
    }
    inputs = _BatchInputs(robot, batch, moving, segments)
    activations = initial_activations(robot, segments, delay_steps)
    alive = LiveBatch(batch)
    alive.reset(mujoco.mjtStage.mjSTAGE_NONE)
    first = segments.lead - delay_steps
    for stage in stages:
        inputs.write_states(activations, stage)
        clock = perf_counter()
        alive.forward()
        stats.physics_seconds += perf_counter() - clock
        for k in range(horizon + 1):
            if "sensors" in kept:
                reader.read(sensordata[batch_rows], qpos[batch_rows], readings)
                kept["sensors"][:, stage, k] = readings.reshape(n, together, -1)
            for signal, read in live.items():
                kept[signal][:, stage, k] = read()[batch_rows].reshape(n, together, -1)
            if k < horizon:
                clock = perf_counter()
                if part:
                    inputs.write_commands(segments.commands[stage, first + k - 1])
                    alive.step(part)
                inputs.write_commands(segments.commands[stage, first + k])
                alive.step(robot.substeps - part)
                stats.physics_seconds += perf_counter() - clock
    diverged: BoolArray = np.any(alive.diverged()[batch_rows].reshape(n, together), axis=1)
    stats.runs += n
    stats.steps += len(moving) * count * horizon
    stats.diverged += int(diverged.sum())
    time = np.arange(horizon + 1, dtype=np.float64) * robot.control_timestep
    return SimulationResult(Behaviour(robot.anatomy.names, time, kept), diverged)


def _repeated(embodiments: Sequence[Embodiment], times: int) -> list[Embodiment]:
    return [embodiment for embodiment in embodiments for _ in range(times)]


class _BatchInputs:
    """Writes logged states and commands into a batch, the same for every embodiment."""

    def __init__(
        self,
        robot: Robot,
        batch: mujoco.batch.Batch,
        embodiments: Sequence[Embodiment],
        segments: Segments,
    ) -> None:
        self._segments = segments
        self._n = len(embodiments)
        models = [own.model for own in embodiments for _ in range(batch.nsim // len(embodiments))]
        self._write = state_writer(robot, batch.bind, *models)
        self._ctrl = batch.bind("ctrl")
        self._act = batch.bind("act")
        self._qpos, self._qvel = batch.bind("qpos"), batch.bind("qvel")
        median = _median_angles(robot, segments)
        self._constant_angles = [
            (number, *constant)
            for number, own in enumerate(embodiments)
            for constant in (*own.welded, *(median[name] for name in own.detached & median.keys()))
        ]

    def write_states(self, activations: FloatArray, stage: IndexArray) -> None:
        """Writes the initial states of some segments.

        Args:
            activations: Initial activations of all segments, ``(segments, na)``.
            stage: Indices of the segments to begin.
        """
        states = self._segments.states
        self._write({signal: self._for_all(values[stage]) for signal, values in states.items()})
        self._act[:] = self._for_all(activations[stage])
        for number, position, velocity, angle in self._constant_angles:
            rows = slice(number * len(stage), (number + 1) * len(stage))
            self._qpos[rows, position] = angle
            self._qvel[rows, velocity] = 0.0

    def write_commands(self, commands: FloatArray) -> None:
        """Writes the commands of one step, ``(segments, motors)``."""
        self._ctrl[:] = self._for_all(commands)

    def _for_all(self, values: FloatArray) -> FloatArray:
        return np.tile(values, (self._n, 1))


def _median_angles(robot: Robot, segments: Segments) -> dict[str, tuple[int, int, float]]:
    """Returns the ``qpos`` and ``qvel`` index and the median angle of each hinge, by name.

    A hinge without a known angle has that of the initial pose. The result is empty for segments
    without joint positions.
    """
    angles = segments.states.get("joint_positions")
    if angles is None:
        return {}
    hinges = [robot.model.joint(name) for name in robot.anatomy.hinges]
    known = [column[~np.isnan(column)] for column in angles.T]
    return {
        hinge.name: (
            int(hinge.qposadr[0]),
            int(hinge.dofadr[0]),
            float(np.median(own) if len(own) else hinge.qpos0[0]),
        )
        for hinge, own in zip(hinges, known, strict=True)
    }
