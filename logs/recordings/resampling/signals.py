"""Signals of a behaviour at the control steps, from tracks."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.logs.recordings.mapping.mapping import Base
from selfmodel.logs.recordings.resampling.clock import Track
from selfmodel.logs.recordings.resampling.resample import (
    angles,
    hold,
    linear,
    reach,
    slerp,
    slerp_or_sample,
)
from selfmodel.logs.recordings.resampling.start_frame import heading_removal, rotate_world
from selfmodel.logs.recordings.resampling.tracks import Tracks
from selfmodel.logs.recordings.series import IntArray
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.robot import Robot
from selfmodel.trials.rotation import rotated
from selfmodel.trials.signals import Signal

Interpolation = Callable[[FloatArray, FloatArray, FloatArray, float], FloatArray]


@dataclass(frozen=True, eq=False)
class Steps:
    """Control steps of a trial.

    Attributes:
        origin: Time of the first step, ns.
        at: Times after the first step, ``(steps,)`` ns.
    """

    origin: int
    at: IntArray


def joint_signals(tracks: Tracks, robot: Robot, steps: Steps) -> dict[Signal, FloatArray]:
    """Returns positions, velocities and efforts of the hinges.

    Only the angle of a hinge without limits can wrap around.
    """
    anatomy, model = robot.anatomy, robot.model
    positions = [
        _at(tracks.positions[name], steps, linear if model.joint(name).limited[0] else angles)
        for name in anatomy.hinges
    ]
    return {
        "joint_positions": np.concatenate(positions, axis=1),
        "joint_velocities": _columns(tracks.velocities, anatomy.hinges, steps, linear),
        "joint_efforts": _columns(tracks.efforts, anatomy.hinges, steps, linear),
    }


def command_signals(tracks: Tracks, anatomy: Anatomy, steps: Steps) -> dict[Signal, FloatArray]:
    """Returns the commands; each is held until the next."""
    return {"commands": _columns(tracks.commands, anatomy.motors, steps, _standing)}


def sensor_signals(
    tracks: Tracks, anatomy: Anatomy, steps: Steps, joint_positions: FloatArray
) -> dict[Signal, FloatArray]:
    """Returns the readings of the robot's sensors.

    Args:
        tracks: Tracks, of which those of sensors are read.
        anatomy: Parts of the robot.
        steps: Control steps.
        joint_positions: Joint angles, the readings of angle sensors, ``(steps, hinges)`` rad.
    """
    readings = np.full((len(steps.at), len(anatomy.sensors)), np.nan)
    for column, sensor in enumerate(anatomy.sensors):
        if sensor.name in tracks.sensors:
            readings[:, column] = _at(tracks.sensors[sensor.name], steps, _held)[:, 0]
        elif sensor.kind == "angle":
            angle = joint_positions[:, anatomy.hinges.index(sensor.hinge)]
            readings[:, column] = (angle - sensor.centre) / sensor.half_range
        elif sensor.name in tracks.touch:
            readings[:, column] = _at(tracks.touch[sensor.name], steps, hold)[:, 0]
    return {"sensors": readings}


def base_signals(tracks: Tracks, steps: Steps, base: Base | None) -> dict[Signal, FloatArray]:
    """Returns the pose and velocities of the root body.

    Args:
        tracks: Tracks, of which those of the base are read.
        steps: Control steps.
        base: Frames of the tracks; without a base, an IMU's orientation is turned to head along +x.

    Raises:
        ValueError: The initial pose, which the transform needs, is unknown.
    """
    position = _wide(_at(tracks.base_position, steps, linear), 3)
    # The orientations of a bag keep the bits that earlier versions imported.
    method = slerp_or_sample if base is not None and base.columns else slerp
    orientation = _wide(_at(tracks.base_orientation, steps, method), 4)
    velocity = _wide(_at(tracks.base_linear_velocity, steps, linear), 3)
    in_world = base is not None and base.velocity_frame == "world"
    if base is None or base.frame == "start":
        required = [(tracks.base_position, position), (tracks.base_orientation, orientation)]
        if any(len(track.times) and np.isnan(rows[0]).any() for track, rows in required):
            raise ValueError("the pose of the base at the start of the trial is unknown")
        if len(tracks.base_orientation.times):
            rotation = heading_removal(orientation[0])
            orientation = rotate_world(orientation, rotation)
            position = rotated(position - position[0] * [1, 1, 0], rotation[np.newaxis])
            velocity = rotated(velocity, rotation[np.newaxis]) if in_world else velocity
        else:
            position = position - position[0] * [1, 1, 0]
    return {
        "base_position": position,
        "base_orientation": orientation,
        "base_linear_velocity": velocity if in_world else rotated(velocity, orientation),
        "base_angular_velocity": _wide(_at(tracks.base_angular_velocity, steps, linear), 3),
    }


def _columns(
    tracks: Mapping[str, Track], names: tuple[str, ...], steps: Steps, method: Interpolation
) -> FloatArray:
    return np.concatenate([_at(tracks[name], steps, method) for name in names], axis=1)


def _at(track: Track, steps: Steps, method: Interpolation) -> FloatArray:
    # float64 represents nanoseconds exactly for a hundred days.
    times = (track.times - steps.origin).astype(np.float64)
    at = steps.at.astype(np.float64)
    if not len(times):
        return np.full((len(at), track.values.shape[1]), np.nan)
    return method(times, track.values, at, reach(times))


def _standing(times: FloatArray, values: FloatArray, at: FloatArray, limit: float) -> FloatArray:
    del limit
    return hold(times, values, at)


def _held(times: FloatArray, values: FloatArray, at: FloatArray, limit: float) -> FloatArray:
    """Last samples, outside of gaps."""
    return np.where(np.isnan(linear(times, values, at, limit)), np.nan, hold(times, values, at))


def _wide(values: FloatArray, width: int) -> FloatArray:
    """Values with ``width`` columns; a track without samples has one column."""
    return values if values.shape[1] == width else np.full((len(values), width), np.nan)
