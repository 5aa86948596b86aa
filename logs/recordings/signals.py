"""Signals of a robot at its control steps, of the tracks of a recording."""

from dataclasses import dataclass, replace

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.logs.recordings import resample
from selfmodel.logs.recordings.mapping import Trial
from selfmodel.logs.recordings.mapping_file import RecordingMapping
from selfmodel.logs.recordings.resample import NOTHING, ControlSteps, Method, at_steps
from selfmodel.logs.recordings.tracks import Tracks, keeps_samples
from selfmodel.robot.robot import Robot
from selfmodel.rotation import rotated


@dataclass(frozen=True, eq=False)
class Frame:
    """Frame of the base that begins with a trial, in the frame of its recording.

    Attributes:
        origin: Its origin, ``(3,)`` m.
        rotation: Rotation about the vertical to it, w x y z, ``(4,)``; None without orientations.
    """

    origin: FloatArray
    rotation: FloatArray | None


def start_frame(mapping: RecordingMapping, tracks: Tracks, steps: ControlSteps) -> Frame | None:
    """Returns the frame in which the base begins at the first of some steps.

    It is None where the mapping has the frame as recorded.

    Raises:
        InputError: The pose of the base at this step is unknown.
    """
    trial = mapping.trial
    if trial.base is not None and trial.base.frame == "recorded":
        return None
    first = replace(steps, numbers=steps.numbers[:1])
    position, orientation, _ = (rows[0] for rows in _pose(trial, tracks, first))
    is_placed, is_turned = (
        len(tracks.get((quantity, ""), NOTHING)) > 0
        for quantity in ("base_position", f"{_body(trial)}_orientation")
    )
    if (is_placed and np.isnan(position).any()) or (is_turned and np.isnan(orientation).any()):
        raise mapping.error(
            ("start",),
            "the pose of the base at the start of the trial is unknown, because of a gap in its "
            "topic: set another start",
        )
    return Frame(position * [1, 1, 0], _heading_removal(orientation) if is_turned else None)


def signals_of(
    trial: Trial, tracks: Tracks, robot: Robot, steps: ControlSteps, frame: Frame | None
) -> dict[str, FloatArray]:
    """Returns signals and acceleration at control steps; NaN where not observed or left out."""
    anatomy = robot.anatomy

    def at(quantity: str, part: str, method: Method, width: int = 1) -> FloatArray:
        return at_steps(tracks.get((quantity, part), NOTHING), steps, method, width)

    def all_of(quantity: str, parts: tuple[str, ...], method: Method) -> FloatArray:
        return np.concatenate([at(quantity, part, method) for part in parts], axis=1)

    def angle(hinge: str) -> FloatArray:
        method = resample.angles if wraps_around(robot, hinge) else resample.linear
        return at("joint_positions", hinge, method)

    positions = np.concatenate([angle(hinge) for hinge in anatomy.hinges], axis=1)
    readings = np.full((len(positions), len(anatomy.sensors)), np.nan)
    for column, sensor in enumerate(anatomy.sensors):
        if ("sensors", sensor.name) in tracks:
            readings[:, column] = at("sensors", sensor.name, resample.hold_outside_gaps)[:, 0]
        elif sensor.kind == "angle":
            hinge = positions[:, anatomy.hinges.index(sensor.hinge)]
            readings[:, column] = (hinge - sensor.centre) / sensor.half_range
        elif ("touch", sensor.name) in tracks:
            readings[:, column] = at("touch", sensor.name, resample.hold)[:, 0]
    # A gyroscope measures the angular velocity; odometry derives it.
    turning = "imu" if len(tracks.get(("imu_angular_velocity", ""), NOTHING)) else "base"
    position, orientation, velocity = _in_frame(trial, _pose(trial, tracks, steps), frame)
    signals = {
        "joint_positions": positions,
        "joint_velocities": all_of("joint_velocities", anatomy.hinges, resample.linear),
        "joint_efforts": all_of("joint_efforts", anatomy.hinges, resample.linear),
        "commands": all_of("commands", anatomy.motors, resample.hold_forever),
        "sensors": readings,
        "base_position": position,
        "base_orientation": orientation,
        "base_linear_velocity": velocity,
        "base_angular_velocity": at(f"{turning}_angular_velocity", "", resample.linear, 3),
        "acceleration": at("imu_linear_acceleration", "", resample.linear, 3),
    }
    for begin, end in trial.leave_out:
        out = (steps.seconds >= begin) & (steps.seconds <= end)
        for name in signals.keys() - {"commands"}:
            signals[name][out] = np.nan
    return signals


def wraps_around(robot: Robot, hinge: str) -> bool:
    """Returns whether an angle may wrap around: only that of a hinge without limits."""
    return not robot.model.joint(hinge).limited[0]


Pose = tuple[FloatArray, FloatArray, FloatArray]
"""Position, orientation and linear velocity of the base, ``(steps, width)``."""


def _body(trial: Trial) -> str:
    """Returns the table of the mapping that has the orientation of the base."""
    return "imu" if trial.base is None else "base"


def _pose(trial: Trial, tracks: Tracks, steps: ControlSteps) -> Pose:
    body = _body(trial)
    turned = resample.slerp_or_sample if keeps_samples(trial, body) else resample.slerp
    orientation = tracks.get((f"{body}_orientation", ""), NOTHING)
    position, velocity = (
        at_steps(tracks.get((quantity, ""), NOTHING), steps, resample.linear, 3)
        for quantity in ("base_position", "base_linear_velocity")
    )
    return position, at_steps(orientation, steps, turned, 4), velocity


def _in_frame(trial: Trial, pose: Pose, frame: Frame | None) -> Pose:
    """Returns a pose in a frame; the velocity is that in the world."""
    position, orientation, velocity = pose
    in_world = trial.base is not None and trial.base.velocity_frame == "world"
    if frame is not None:
        position = position - frame.origin
        if frame.rotation is not None:
            orientation = _rotated_world(orientation, frame.rotation)
            position = rotated(position, frame.rotation[np.newaxis])
            velocity = rotated(velocity, frame.rotation[np.newaxis]) if in_world else velocity
    return position, orientation, velocity if in_world else rotated(velocity, orientation)


def _rotated_world(quaternions: FloatArray, rotation: FloatArray) -> FloatArray:
    """Orientations ``(steps, 4)`` after a rotation of the world ``(4,)``, w x y z.

    A matrix product, which rounds differently from ``selfmodel.rotation.product``.
    """
    w, x, y, z = rotation
    matrix = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
    result: FloatArray = quaternions @ matrix.T
    return result


def _heading_removal(quaternion: FloatArray) -> FloatArray:
    """Rotation about the vertical that turns the heading of an orientation to +x, w x y z."""
    w, x, y, z = quaternion
    half = -np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) / 2
    return np.array([np.cos(half), 0.0, 0.0, np.sin(half)])
