"""From tracks to the signals of a behaviour at the control steps."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.logs.rosbag.clock import Track
from selfmodel.logs.rosbag.resample import angles, hold, linear, reach, slerp
from selfmodel.logs.rosbag.series import IntArray
from selfmodel.logs.rosbag.tracks import Tracks
from selfmodel.logs.rosbag.turning import rotated, turned, unyaw
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import Signal

Interpolation = Callable[[FloatArray, FloatArray, FloatArray, float], FloatArray]


@dataclass(frozen=True, eq=False)
class Steps:
    """The control steps of a trial.

    Attributes:
        origin: When the first one is, ns.
        at: ``(steps,)`` ns after that.
    """

    origin: int
    at: IntArray


def joint_signals(tracks: Tracks, robot: Robot, steps: Steps) -> dict[Signal, FloatArray]:
    """Returns what is known of the hinges.

    Only one without limits can go round: what jumps elsewhere did not turn a whole turn.
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
    """Returns the commands: one stands until the next, however long that takes."""
    return {"commands": _columns(tracks.commands, anatomy.motors, steps, _standing)}


def sensor_signals(
    tracks: Tracks, anatomy: Anatomy, steps: Steps, joint_positions: FloatArray
) -> dict[Signal, FloatArray]:
    """Returns what the robot's sensors would have read.

    Args:
        tracks: Those of touch are read.
        anatomy: The robot's sensors.
        steps: The control steps.
        joint_positions: ``(steps, hinges)`` rad: what the angle sensors measure.
    """
    readings = np.full((len(steps.at), len(anatomy.sensors)), np.nan)
    for column, sensor in enumerate(anatomy.sensors):
        if sensor.kind == "angle":
            angle = joint_positions[:, anatomy.hinges.index(sensor.hinge)]
            readings[:, column] = (angle - sensor.centre) / sensor.half_range
        elif sensor.name in tracks.touch:
            readings[:, column] = _at(tracks.touch[sensor.name], steps, hold)[:, 0]
    return {"sensors": readings}


def base_signals(tracks: Tracks, steps: Steps, *, from_start: bool) -> dict[Signal, FloatArray]:
    """Returns what is known of the root body.

    Args:
        tracks: Those of the base are read.
        steps: The control steps.
        from_start: Whether the trial begins at x = y = 0 heading along +x.

    Raises:
        ValueError: It should, but where it begins or heads is not known.
    """
    position = _wide(_at(tracks.base_position, steps, linear), 3)
    orientation = _wide(_at(tracks.base_orientation, steps, slerp), 4)
    velocity = _wide(_at(tracks.base_linear_velocity, steps, linear), 3)
    if from_start:
        told = [(tracks.base_position, position), (tracks.base_orientation, orientation)]
        if any(len(track.times) and np.isnan(rows[0]).any() for track, rows in told):
            raise ValueError("where the base is at the start of the trial is not known")
        if len(tracks.base_orientation.times):
            by = unyaw(orientation[0])
            orientation = turned(orientation, by)
            position = rotated(position - position[0] * [1, 1, 0], by[np.newaxis])
        else:
            position = position - position[0] * [1, 1, 0]
    return {
        "base_position": position,
        "base_orientation": orientation,
        "base_linear_velocity": rotated(velocity, orientation),
        "base_angular_velocity": _wide(_at(tracks.base_angular_velocity, steps, linear), 3),
    }


def _columns(
    tracks: Mapping[str, Track], names: tuple[str, ...], steps: Steps, method: Interpolation
) -> FloatArray:
    return np.concatenate([_at(tracks[name], steps, method) for name in names], axis=1)


def _at(track: Track, steps: Steps, method: Interpolation) -> FloatArray:
    # Nanoseconds since the start are whole numbers to float64 too, for a hundred days.
    times = (track.times - steps.origin).astype(np.float64)
    at = steps.at.astype(np.float64)
    if not len(times):
        return np.full((len(at), track.values.shape[1]), np.nan)
    return method(times, track.values, at, reach(times))


def _standing(times: FloatArray, values: FloatArray, at: FloatArray, limit: float) -> FloatArray:
    del limit
    return hold(times, values, at)


def _wide(values: FloatArray, width: int) -> FloatArray:
    """A track without samples has one column, whatever it would have told."""
    return values if values.shape[1] == width else np.full((len(values), width), np.nan)
