"""Reads and writes the signals of a trajectory in MuJoCo's state of a robot.

The base of a robot moves freely, or along slide joints and about one hinge, such as the planar
walkers of the dm_control suite; or it is fixed to the world, such as that of an arm.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray, columns
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.anatomy_reader import joints_of_body, reference_pose
from selfmodel.robot.model_variant import ModelVariant
from selfmodel.robot.robot import Robot
from selfmodel.rotation import product, rotated
from selfmodel.trials.estimation import with_joint_velocities
from selfmodel.trials.signals import Signal
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial

Bind = Callable[[str], FloatArray]
"""Returns the array of a field of MuJoCo's state of many robots, ``(n, width)``, by name; to be
read, also that at several steps, ``(steps, n, width)``."""

Reader = Callable[[], FloatArray]
"""Returns the current value of a signal, ``(..., n, width)``; it may be a view of the state."""

SignalSource = Callable[[Bind], Reader]
"""Returns a function that reads a signal from the bound state."""

StateWriter = Callable[[Mapping[Signal, FloatArray]], None]
"""Writes signals, ``(n, width)`` each, into the state; absent signals, and joints whose value is
NaN, keep their values."""

BASE_SIGNALS: tuple[Signal, ...] = (
    "base_position",
    "base_orientation",
    "base_linear_velocity",
    "base_angular_velocity",
)
"""Signals of the base."""

Columns = slice | list[int]


def _field(name: str, chosen: Columns, shift: FloatArray | None = None) -> SignalSource:
    def bound(bind: Bind) -> Reader:
        values = bind(name)
        if shift is None:
            return lambda: values[..., chosen]
        return lambda: values[..., chosen] + shift

    return bound


def _derived(compute: Callable[[FloatArray, FloatArray], FloatArray]) -> SignalSource:
    """Returns the source of a signal that is computed from ``qpos`` and ``qvel``."""

    def bound(bind: Bind) -> Reader:
        qpos, qvel = bind("qpos"), bind("qvel")
        return lambda: compute(qpos, qvel)

    return bound


class FreeBase:
    """A floating base with a free joint, at an index in ``qpos`` and one in ``qvel``."""

    def __init__(self, position: int, velocity: int) -> None:
        self._places: dict[Signal, tuple[str, slice]] = {
            "base_position": ("qpos", slice(position, position + 3)),
            "base_orientation": ("qpos", slice(position + 3, position + 7)),
            "base_linear_velocity": ("qvel", slice(velocity, velocity + 3)),
            "base_angular_velocity": ("qvel", slice(velocity + 3, velocity + 6)),
        }
        self.fields = {signal: _field(*place) for signal, place in self._places.items()}

    def write(self, qpos: FloatArray, qvel: FloatArray, base: Mapping[Signal, FloatArray]) -> None:
        """Writes signals of the base, ``(n, width)``, into the state; absent ones keep theirs."""
        for signal, (name, chosen) in self._places.items():
            if signal in base:
                (qpos if name == "qpos" else qvel)[:, chosen] = base[signal]


class FixedBase:
    """A base without degrees of freedom: its pose is a constant of the model.

    There is one model for all rows of a state, or one per row; they share one layout. The pose
    differs between them, as on slopes.
    """

    def __init__(self, models: Sequence[mujoco.MjModel], body: int) -> None:
        # One model serves many rows of a batch of segments.
        poses = {key: reference_pose(m, body) for key, m in {id(m): m for m in models}.items()}
        positions, orientations = zip(*(poses[id(model)] for model in models), strict=True)
        constants = np.array(positions), np.array(orientations), *np.zeros((2, 1, 3))
        self.fields = {
            signal: _derived(_constant(rows))
            for signal, rows in zip(BASE_SIGNALS, constants, strict=True)
        }

    def write(self, qpos: FloatArray, qvel: FloatArray, base: Mapping[Signal, FloatArray]) -> None:
        """Leaves the state unchanged: signals of a fixed base are not part of it."""


def _constant(rows: FloatArray) -> Callable[[FloatArray, FloatArray], FloatArray]:
    return lambda qpos, _qvel: np.broadcast_to(rows, (*qpos.shape[:-1], rows.shape[-1]))


class SlidingBase:
    """A floating base with slide joints, then at most one hinge, between the world and the body.

    There is one model for all rows of a state, or one per row, as for a fixed base.
    """

    def __init__(self, models: Sequence[mujoco.MjModel], body: int) -> None:
        model, joints = models[0], joints_of_body(models[0], body)
        turns = model.jnt_type[joints[-1]] == mujoco.mjtJoint.mjJNT_HINGE
        slides = joints[:-1] if turns else joints
        # Position and orientation of the body in the reference configuration, ``(n, ...)``.
        self._position = np.array([each.body_pos[body] for each in models])
        self._orientation = np.array([each.body_quat[body] for each in models])
        self._inverse = self._orientation * (1.0, -1.0, -1.0, -1.0)
        # Indices in ``qpos`` and ``qvel`` and the reference of each joint.
        places = [(int(model.jnt_qposadr[j]), int(model.jnt_dofadr[j])) for j in joints]
        scalars = [(q, v, float(model.qpos0[q])) for q, v in places]
        self._slides = scalars[: len(slides)]
        self._hinge = scalars[-1] if turns else None
        self._axes = model.jnt_axis[slides]
        self._axis = model.jnt_axis[joints[-1]].copy() if turns else np.array([0.0, 0.0, 1.0])
        self._anchor = model.jnt_pos[joints[-1]].copy() if turns else np.zeros(3)
        derived = self._positions, self._orientations, self._velocities, self._rates
        self.fields = dict(zip(BASE_SIGNALS, map(_derived, derived), strict=True))

    def write(self, qpos: FloatArray, qvel: FloatArray, base: Mapping[Signal, FloatArray]) -> None:
        """Writes signals of the base, ``(n, width)``, into the state; absent ones keep theirs.

        The part of a signal outside the degrees of freedom is dropped: a rotation about another
        axis than the hinge's, and a translation across the slide axes.
        """
        # A hinge beside the origin moves the origin: read the position before the hinge turns.
        position = base.get("base_position", self._positions(qpos, qvel))
        velocity = base.get("base_linear_velocity", self._velocities(qpos, qvel))
        if self._hinge is not None:
            q, v, reference = self._hinge
            if "base_orientation" in base:
                rotation = product(self._inverse, base["base_orientation"])
                half = np.arctan2((rotation[:, 1:] * self._axis).sum(axis=1), rotation[:, 0])
                # A quaternion and its negative are the same rotation.
                angle = np.remainder(2 * half + np.pi, 2 * np.pi) - np.pi
                qpos[:, q] = reference + angle
            if "base_angular_velocity" in base:
                qvel[:, v] = (base["base_angular_velocity"] * self._axis).sum(axis=1)
        shift, shift_rate = self._origin_shift(qpos, qvel)
        translation = rotated(position - self._position, self._inverse) - shift
        speed = rotated(velocity, self._inverse) - shift_rate
        for (q, v, reference), along in zip(
            self._slides, np.linalg.pinv(self._axes).T, strict=True
        ):
            qpos[:, q] = reference + (translation * along).sum(axis=1)
            qvel[:, v] = (speed * along).sum(axis=1)

    def _positions(self, qpos: FloatArray, qvel: FloatArray) -> FloatArray:
        translation = self._origin_shift(qpos, qvel)[0]
        for (q, _, reference), axis in zip(self._slides, self._axes, strict=True):
            translation = translation + (qpos[..., q, np.newaxis] - reference) * axis
        return np.asarray(self._position + rotated(translation, self._orientation))

    def _velocities(self, qpos: FloatArray, qvel: FloatArray) -> FloatArray:
        velocity = self._origin_shift(qpos, qvel)[1]
        for (_, v, _), axis in zip(self._slides, self._axes, strict=True):
            velocity = velocity + qvel[..., v, np.newaxis] * axis
        return rotated(velocity, self._orientation)

    def _orientations(self, qpos: FloatArray, qvel: FloatArray) -> FloatArray:
        half = self._turn(qpos, qvel)[0] / 2
        turned = np.concatenate([np.cos(half), np.sin(half) * self._axis], axis=-1)
        return product(self._orientation, turned)

    def _rates(self, qpos: FloatArray, qvel: FloatArray) -> FloatArray:
        return np.asarray(self._turn(qpos, qvel)[1] * self._axis)

    def _turn(self, qpos: FloatArray, qvel: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Returns the angle of the hinge from its reference, rad, and its rate; 0 without it.

        Both are ``(..., n, 1)``.
        """
        if self._hinge is None:
            return np.zeros((*qpos.shape[:-1], 1)), np.zeros((*qvel.shape[:-1], 1))
        q, v, reference = self._hinge
        return qpos[..., q, np.newaxis] - reference, qvel[..., v, np.newaxis]

    def _origin_shift(self, qpos: FloatArray, qvel: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Returns displacement and velocity of the body's origin due to the hinge.

        Both are ``(..., n, 3)``, m and m/s, in the body's reference frame.
        """
        angle, rate = self._turn(qpos, qvel)
        if not self._anchor.any():
            return np.zeros((*angle.shape[:-1], 3)), np.zeros((*angle.shape[:-1], 3))
        outward = self._anchor - self._axis * (self._axis @ self._anchor)
        across = np.cross(self._axis, self._anchor)
        cosine, sine = np.cos(angle), np.sin(angle)
        return (
            outward * (1 - cosine) - across * sine,
            rate * (outward * sine - across * cosine),
        )


Base = FreeBase | SlidingBase | FixedBase


def read_base(models: Sequence[mujoco.MjModel], root: str) -> Base:
    """Returns the base of a robot, with one model for all rows of a state, or one per row."""
    model = models[0]
    body = int(model.body(root).id)
    joints = joints_of_body(model, body)
    if not joints:
        return FixedBase(models, body)
    if model.jnt_type[joints[0]] == mujoco.mjtJoint.mjJNT_FREE:
        return FreeBase(int(model.jnt_qposadr[joints[0]]), int(model.jnt_dofadr[joints[0]]))
    return SlidingBase(models, body)


def signal_fields(robot: Robot, *models: mujoco.MjModel) -> dict[Signal, SignalSource]:
    """Returns the state field of each signal that the physics determines.

    Commands are ``ctrl``. Sensor readings are not included: ``SensorReader`` computes them.

    The robot's parts name the columns of the signals. The models are one for all states, or one per
    state, of one layout, by default the robot's own. They may have more parts than the robot.
    """
    models = models or (robot.model,)
    motors = columns([int(models[0].actuator(name).id) for name in robot.anatomy.motors])
    positions, velocities = _joint_columns(robot, models[0])
    return {
        "commands": _field("ctrl", motors),
        "joint_positions": _field("qpos", positions),
        "joint_velocities": _field("qvel", velocities),
        "joint_efforts": _field("qfrc_actuator", velocities),
        **read_base(models, robot.root).fields,
    }


def observed_fields(robot: Robot, variants: Sequence[ModelVariant]) -> dict[Signal, SignalSource]:
    """Returns ``signal_fields`` as robots log them: joint positions with the encoders' offsets.

    There is one variant of the healthy robot for all states, or one per state.
    """
    fields = signal_fields(robot, *(variant.model for variant in variants))
    offsets = np.array([variant.encoder_offset for variant in variants])
    if offsets.any():
        positions, _ = _joint_columns(robot, variants[0].model)
        fields["joint_positions"] = _field("qpos", positions, offsets)
    return fields


def state_writer(robot: Robot, bind: Bind, *models: mujoco.MjModel) -> StateWriter:
    """Returns a function that writes the joint and base signals into the fields of a state.

    Robot and models are as for ``signal_fields``.
    """
    models = models or (robot.model,)
    qpos, qvel = bind("qpos"), bind("qvel")
    positions, velocities = _joint_columns(robot, models[0])
    base = read_base(models, robot.root)
    joints: dict[Signal, tuple[FloatArray, Columns]] = {
        "joint_positions": (qpos, positions),
        "joint_velocities": (qvel, velocities),
    }

    def write(state: Mapping[Signal, FloatArray]) -> None:
        for signal, (array, hinges) in joints.items():
            if signal in state:
                values = state[signal]
                unknown = np.isnan(values)
                known = np.where(unknown, array[:, hinges], values) if unknown.any() else values
                array[:, hinges] = known
        base.write(qpos, qvel, state)

    return write


def _joint_columns(robot: Robot, model: mujoco.MjModel) -> tuple[Columns, Columns]:
    hinges = [model.joint(name) for name in robot.anatomy.hinges]
    positions = columns([int(hinge.qposadr[0]) for hinge in hinges])
    return positions, columns([int(hinge.dofadr[0]) for hinge in hinges])


def bind_data(data: mujoco.MjData) -> Bind:
    """Returns a function from the name of a field of MjData to the field as ``(1, width)``."""

    def bind(field: str) -> FloatArray:
        values: FloatArray = getattr(data, field)
        return values[np.newaxis]

    return bind


def current_value(field: SignalSource, data: mujoco.MjData) -> FloatArray:
    """Returns a copy of the current value of a signal of a single robot, ``(width,)``."""
    return np.array(field(bind_data(data))()[0])


def with_known_base(robot: Robot, trajectory: Trajectory) -> Trajectory:
    """Returns a trajectory with its robot's physics steps, and a known base if the base is fixed.

    Values that were observed are unchanged.
    """
    if trajectory.substeps != robot.substeps:
        trajectory = dataclasses.replace(trajectory, substeps=robot.substeps)
    if not robot.has_fixed_base:
        return trajectory
    fields, data = signal_fields(robot), mujoco.MjData(robot.model)
    known = dict[Signal, FloatArray]()
    for signal in BASE_SIGNALS:
        constant = current_value(fields[signal], data)
        unknown = np.full((trajectory.steps, len(constant)), np.nan)
        observed = trajectory.signals.get(signal, unknown)
        known[signal] = np.where(np.isnan(observed), constant, observed)
    return dataclasses.replace(trajectory, signals={**trajectory.signals, **known})


def completed_trial(robot: Robot, trial: Trial) -> Trial:
    """Returns a trial whose state is complete if the base is fixed, as far as it was logged.

    The base is known, and joint velocities that were not logged are estimated.
    """
    trajectory = with_known_base(robot, trial.trajectory)
    if robot.has_fixed_base:
        trajectory = with_joint_velocities(trajectory)
    return dataclasses.replace(trial, trajectory=trajectory)


class SensorReader:
    """Computes the readings of many robots: touch 0 or 1, angles from -1 to 1.

    Angles are read from the joint positions: after a step, MuJoCo's sensors are one physics step
    old, and updating them takes a fifth of the time of the physics. The robots share the layout of
    one model. Their sensors have the faults of variants, each with some copies in adjacent rows.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        anatomy: Anatomy,
        variants: Sequence[ModelVariant],
        copies: int = 1,
    ) -> None:
        touches, angles = (
            [sensor for sensor in anatomy.sensors if sensor.kind == kind]
            for kind in ("touch", "angle")
        )
        self._touches = len(touches)
        self._touch = columns([int(model.sensor(sensor.name).adr[0]) for sensor in touches])
        self._angle = columns([int(model.joint(sensor.hinge).qposadr[0]) for sensor in angles])
        self._centre = np.array([sensor.centre for sensor in angles])
        self._scale = np.array([1 / sensor.half_range for sensor in angles])
        gain = np.array([variant.gain for variant in variants])
        offset = np.array([variant.offset + variant.bias for variant in variants])
        self._faulty = bool(np.any(gain != 1) or np.any(offset != 0))
        self._gain = np.repeat(gain, copies, axis=0)
        self._offset = np.repeat(offset, copies, axis=0)
        self._noise = SensorNoise(variants, copies)

    def read(self, sensordata: FloatArray, qpos: FloatArray, readings: FloatArray) -> None:
        """Writes the readings of the next control step, or of several.

        Args:
            sensordata: ``(n, nsensordata)`` or ``(steps, n, nsensordata)``, which contains the
                touch forces, N.
            qpos: ``(..., n, nq)``, which contains the joint angles, rad.
            readings: ``(..., n, sensors)``, written.
        """
        np.greater(
            sensordata[..., self._touch], 0, out=readings[..., : self._touches], casting="unsafe"
        )
        angles = readings[..., self._touches :]
        np.subtract(qpos[..., self._angle], self._centre, out=angles)
        np.multiply(angles, self._scale, out=angles)
        if self._faulty:
            readings *= self._gain
            readings += self._offset
        for step in readings if readings.ndim > 2 else [readings]:
            self._noise.add(step)


class SensorNoise:
    """Adds white noise to the readings of many robots, step by step.

    The noise sequence of a sensor depends on the seed of the variant and the column of the
    sensor only. It is the same in any batch and for all hypotheses of one seed, so that hypotheses
    do not differ by their noise. Each copy of a variant, in adjacent rows, has its own sequence.
    """

    def __init__(self, variants: Sequence[ModelVariant], copies: int = 1) -> None:
        self._copies = copies
        deviations = np.array([variant.noise for variant in variants])
        noisy: dict[tuple[int, int], list[int]] = {}
        for row, column in zip(*np.nonzero(deviations), strict=True):
            noisy.setdefault((variants[row].seed, int(column)), []).append(int(row))
        self._noisy = [
            (np.random.default_rng(key), rows, key[1], deviations[rows, key[1]])
            for key, rows in noisy.items()
        ]

    def add(self, readings: FloatArray) -> None:
        """Adds the noise of the next step to the readings, ``(variants * copies, sensors)``."""
        robots, sensors = readings.shape
        by_copy = readings.reshape(robots // self._copies, self._copies, sensors)
        for rng, rows, column, deviations in self._noisy:
            drawn = rng.standard_normal(self._copies)
            by_copy[rows, :, column] += np.outer(deviations, drawn)
