"""Short predictions from logged states under logged commands."""

import copy
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache, partial

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray, IndexArray, held, median_of_known
from selfmodel.robot.actuators import holding_commands
from selfmodel.robot.anatomy import added_steps, split_delay
from selfmodel.robot.model_variant import ModelVariant
from selfmodel.robot.mujoco_errors import uncounted_warnings
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import SensorReader, state_writer
from selfmodel.simulation.requests import END, Segments
from selfmodel.simulation.rollout import RobotBatch, SimulationResult, SimulationStats, live_signals
from selfmodel.trials.trajectory import Trajectory

CHUNK_BYTES = 2**25
"""Memory of the fields that are recorded in every physics step before they are read, bytes."""


@uncounted_warnings()
def predict(
    robot: Robot,
    variants: Sequence[ModelVariant],
    segments: Segments,
    *,
    same_dynamics_as: Sequence[int] | None = None,
    threads: int,
    stats: SimulationStats,
    delay: float | None = None,
) -> SimulationResult:
    """Predicts segments of a trial with several models of a robot.

    Segments with the whole state are simulated in parallel. Segments without the position and the
    linear velocity of the base, or with an unknown hinge, are simulated in chains: each begins with
    the base, or the hinge, in the predicted state at the end of the segment before. The first of a
    chain begins in the initial pose.

    Welded joints begin at their welded angle. The hinges of a detached limb have no logged motion:
    if the segments include joint positions, they begin at rest, at their median angle over the last
    third of the segments, or, without a known angle, in the initial pose.

    Args:
        robot: The healthy robot.
        variants: At least one model, with the layout of the robot.
        segments: Initial states and commands.
        same_dynamics_as: For each variant the index of the first variant with the same
            dynamics, whatever its sensors: only that variant is simulated. By default all are.
        threads: Threads of MuJoCo's steps, including the caller's.
        stats: Statistics that are updated.
        delay: Control delay, control steps; the robot's by default.

    Returns:
        Signals of ``(n, segments, horizon + 1, width)``; a run has diverged if any of its segments
        has.
    """
    n, count, horizon = len(variants), len(segments.starts), segments.horizon
    same = range(n) if same_dynamics_as is None else same_dynamics_as
    simulated, source_of = np.unique(np.asarray(same), return_inverse=True)
    moving = [variants[i] for i in simulated]
    lag = robot.control_delay if delay is None else delay
    loop = _OpenLoop(robot, moving, segments, lag, threads, stats)
    together = loop.together
    qpos, sensordata = loop.bind("qpos"), loop.bind("sensordata")
    read = [_with_encoders(own, robot) for own in variants] if segments.reads_encoders else variants
    # Independent noise per segment: a segment alone is too short to estimate a noise level.
    reader = SensorReader(robot.model, robot.anatomy, read, together)
    # Row of the batch for each row of the result.
    batch_rows = (source_of[:, np.newaxis] * together + np.arange(together)).ravel()
    live = live_signals(robot, loop.bind, loop.models, segments.record)
    names, hinges = robot.anatomy.names, robot.anatomy.hinges
    kept = {
        signal: np.empty((n, count, horizon + 1, names.width(signal))) for signal in segments.record
    }
    for stage, steps, rows in loop.steps():
        read_now = {signal: read()[rows][:, batch_rows] for signal, read in live.items()}
        if "sensors" in kept:
            readings = np.empty((rows.stop - rows.start, n * together, kept["sensors"].shape[-1]))
            reader.read(sensordata[rows][:, batch_rows], qpos[rows][:, batch_rows], readings)
            read_now["sensors"] = readings
        for signal, values in read_now.items():
            by_variant = values.reshape(len(values), n, together, -1)
            kept[signal][:, stage, steps] = by_variant.transpose(1, 2, 0, 3)
    diverged = np.any(loop.batch.diverged()[batch_rows].reshape(n, together), axis=1)
    stats.count(n, len(moving) * count * horizon, diverged)
    addresses = [int(robot.model.joint(name).qposadr[0]) for name in hinges]
    predicted = Trajectory(
        names,
        np.arange(horizon + 1, dtype=np.float64) * robot.control_timestep,
        kept,
        welded=np.array(
            [np.isin(addresses, [address for address, _, _ in own.welded]) for own in variants]
        ),
        detached=np.array([[name in own.detached for name in hinges] for own in variants]),
    )
    return SimulationResult(predicted, diverged)


class _OpenLoop:
    """A batch that follows the commands of segments, for every variant by its control delay.

    Each variant of ``moving`` is in adjacent rows, one per segment that is simulated together. The
    control delay without faults is ``lag``.
    """

    def __init__(  # noqa: PLR0917  # as ``predict``
        self,
        robot: Robot,
        moving: Sequence[ModelVariant],
        segments: Segments,
        lag: float,
        threads: int,
        stats: SimulationStats,
    ) -> None:
        self._segments, self._stats, self._substeps = segments, stats, robot.substeps
        count = len(segments.starts)
        self.together = count if segments.independent else segments.chains
        self._stages: list[IndexArray] = [*np.arange(count).reshape(self.together, -1).T]
        self.models = [own for own in moving for _ in range(self.together)]
        model = robot.model
        step_numbers = self._substeps * (model.nq + 2 * model.nv + model.nsensordata)
        chunk = CHUNK_BYTES // (8 * len(self.models) * step_numbers)
        self._chunk = min(max(1, chunk), segments.horizon)
        self.batch = RobotBatch(robot.model, self.models, threads)
        # Before the first step, after which a field that is bound remains zero.
        self._live = {name: self.batch.bind(name) for name in ("qpos", "qvel", "act")}
        self._fields: dict[str, FloatArray] = {}
        whole, self._part = split_delay(lag, robot.substeps)
        added = [added_steps(lag, float(own.added_delay[0])) for own in moving]
        self._delays = whole + np.array(added, dtype=np.intp)
        # The last row, at -1, is that of every step before the trial.
        self._commands = np.vstack([segments.commands, holding_commands(robot.model)])
        self._write = state_writer(robot, self.batch.bind, *(own.model for own in self.models))
        since_rest = cache(partial(activations, robot, segments.commands))
        self._activations = np.array(
            [since_rest(delay)[segments.starts] for delay in self._delays.tolist()]
        )
        self._offsets = np.array([own.encoder_offset for own in self.models])
        resting = _resting_hinges(robot, segments)
        self._constant_angles = [
            (number, *constant)
            for number, own in enumerate(moving)
            for constant in own.welded + [resting[name] for name in own.detached & resting.keys()]
        ]

    def bind(self, name: str) -> FloatArray:
        """Returns the array of a field at the steps that ``steps`` yields, in its rows."""
        self._live[name] = live = self.batch.bind(name)
        return self._fields.setdefault(name, np.zeros((1 + self._chunk, *live.shape)))

    def steps(self) -> Iterator[tuple[IndexArray, slice, slice]]:
        """Yields segments, the steps within them at which the bound fields are, and their rows."""
        self.batch.reset(mujoco.mjtStage.mjSTAGE_POS)
        for stage in self._stages:
            self._write_states(stage)
            with self._stats.physics():
                self.batch.forward()
            for name, values in self._fields.items():
                values[0] = self._live[name]
            begin = 0  # row 0, the state before the first step, is of the first chunk
            for first in range(0, self._segments.horizon, self._chunk):
                steps = np.arange(first, min(first + self._chunk, self._segments.horizon))
                commands, running = self._arriving(stage, steps), self.batch.running
                with self._stats.physics():
                    recorded = self.batch.rollout(commands, list(self._fields))
                for name, values in recorded.items():
                    after = values[:, self._substeps - 1 :: self._substeps].swapaxes(0, 1)
                    rows = self._fields[name]
                    rows[1:] = rows[-1 if begin else 0]  # of those that are stepped no longer
                    rows[1 : 1 + len(steps), running] = after
                yield stage, slice(first + begin, int(steps[-1]) + 2), slice(begin, 1 + len(steps))
                begin = 1

    def _write_states(self, stage: IndexArray) -> None:
        copies = len(self._delays)
        states = {
            signal: np.tile(values[stage], (copies, 1))
            for signal, values in self._segments.states.items()
        }
        if "joint_positions" in states and self._offsets.any():
            states["joint_positions"] -= self._offsets
        self._write(states)
        qpos, qvel, act = (self._live[name] for name in ("qpos", "qvel", "act"))
        act[:] = self._activations[:, stage].reshape(act.shape)
        for number, position, velocity, angle in self._constant_angles:
            rows = slice(number * self.together, (number + 1) * self.together)
            qpos[rows, position] = angle
            qvel[rows, velocity] = 0.0

    def _arriving(self, stage: IndexArray, steps: IndexArray) -> FloatArray:
        """Returns the commands at each physics step, ``(simulations, physics steps, motors)``."""
        # Of a delay of a part of a step, the command before holds in the first physics steps.
        before = np.arange(self._substeps) < self._part
        sent = (steps[:, np.newaxis] - before).ravel() - self._delays[:, np.newaxis, np.newaxis]
        rows = np.maximum(self._segments.starts[stage][:, np.newaxis] + sent, -1)
        return self._commands[rows].reshape(len(self.models), len(steps) * self._substeps, -1)


def _resting_hinges(robot: Robot, segments: Segments) -> dict[str, tuple[int, int, float]]:
    """Returns the ``qpos`` and ``qvel`` index and the resting angle of each hinge, by name.

    The angle is that at the end, because a limb may be lost during a trial. The result is empty
    without joint positions.
    """
    angles = segments.states.get("joint_positions")
    if angles is None:
        return {}
    hinges = [robot.model.joint(name) for name in robot.anatomy.hinges]
    medians = median_of_known(angles[round((1 - END) * len(angles)) :])
    initial = np.array([hinge.qpos0[0] for hinge in hinges])
    return {
        hinge.name: (int(hinge.qposadr[0]), int(hinge.dofadr[0]), float(angle))
        for hinge, angle in zip(hinges, np.where(np.isnan(medians), initial, medians), strict=True)
    }


def _with_encoders(variant: ModelVariant, robot: Robot) -> ModelVariant:
    """Returns a variant in which the angles of detached hinges are read, too."""
    lost = np.array([sensor.hinge in variant.detached for sensor in robot.anatomy.sensors])
    gain, offset = np.where(lost, 1.0, variant.gain), np.where(lost, 0.0, variant.offset)
    return replace(variant, gain=gain, offset=offset)


def activations(robot: Robot, commands: FloatArray, delay: int = 0) -> FloatArray:
    """Returns the activations of the motors (MuJoCo's ``act``) before each command of a trial.

    Activations, ``(steps, na)``, are not logged. That of a motor with the ``dyntype`` filter
    follows its command with a time constant, and that of an integrator is the sum of its commands.
    Both are zero at the start of a trial, so they follow from the commands since. MuJoCo computes
    them, on a copy of the model whose motors move nothing, so that they are those of the robot to
    the bit: where a solver switches its active constraints, a rounding error has visible effects.

    Args:
        robot: The healthy robot: no fault changes the activation dynamics.
        commands: Commands since the start of the trial, ``(steps, motors)``; an unknown one (NaN)
            is taken as the one before it.
        delay: Control delay, control steps.
    """
    states = np.zeros((len(commands), robot.model.na))
    if robot.model.na:
        model, nothing = copy.copy(robot.model), mujoco.mjtDisableBit
        model.opt.disableflags |= (
            nothing.mjDSBL_CONSTRAINT | nothing.mjDSBL_GRAVITY | nothing.mjDSBL_SPRING
        )
        model.actuator_gaintype[:], model.actuator_biastype[:] = 0, 0  # fixed, and none
        model.actuator_gainprm[:] = 0.0
        data = mujoco.MjData(model)
        arriving = held(np.concatenate([np.zeros((delay + 1, model.nu)), commands]))[1:]
        for after, command in zip(states[1:], arriving[: len(commands) - 1], strict=True):
            data.ctrl[:] = command
            mujoco.mj_step(model, data, robot.substeps)
            after[:] = data.act
    return states
