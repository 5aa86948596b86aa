"""Signals of a trial at the control steps, from the series of a recording."""

from collections.abc import Mapping

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.logs.recordings.mapping import BagMapping, Base, TableMapping
from selfmodel.logs.recordings.mapping_file import RecordingMapping
from selfmodel.logs.recordings.recording import IntArray, Recording
from selfmodel.logs.recordings.resample import (
    NOTHING,
    Clocked,
    Method,
    Track,
    angles,
    at_steps,
    hold,
    hold_forever,
    hold_outside_gaps,
    linear,
    slerp,
    slerp_or_sample,
    track,
)
from selfmodel.robot.robot import Robot
from selfmodel.trials.rotation import rotated

Tracks = dict[tuple[str, str], Track]
"""Tracks by quantity and part, in the units and signs of the model; see ``mapping.Places``."""


def tracks_of(
    mapping: RecordingMapping, recording: Recording, clocks: Mapping[str, Clocked]
) -> Tracks:
    """Returns the tracks of a recording, whose topics have the times of the clocks."""
    tracks: Tracks = {}
    for key, place in mapping.places.items():
        columns = recording.series[place.topic].columns
        found = [columns[name] for name in place.columns if name in columns]
        raw = track(clocks[place.topic], found, slice(*place.numbers)) if found else NOTHING
        tracks[key] = raw.scaled(place.scale, place.offset)
    for name, touch in mapping.trial.touch.items():
        force = tracks["touch", name]
        tracks["touch", name] = Track(force.times, (force.values > touch.threshold).astype(float))
    for body in ("base", "imu"):
        if (orientation := tracks.get((f"{body}_orientation", ""))) is not None:
            # The orientations of a bag keep the bits that earlier versions imported.
            kept = body == "base" and isinstance(mapping.trial, TableMapping)
            tracks[f"{body}_orientation", ""] = _unit(orientation, _ROUNDING if kept else 0.0)
    return tracks


_ROUNDING = 1e-14
"""Difference from 1 of the length of a normalised quaternion in float64."""


def _unit(track: Track, rounding: float) -> Track:
    """Normalised quaternions; unset ones, of length 0, are left out."""
    lengths: FloatArray = np.linalg.norm(track.values, axis=1)
    known = np.abs(lengths - 1) < 0.1
    # A quaternion that is normalised already keeps its bits.
    divisors = np.where(np.abs(lengths - 1) < rounding, 1.0, lengths)
    return Track(track.times[known], track.values[known] / divisors[known, np.newaxis])


def signals(
    trial: BagMapping | TableMapping, tracks: Tracks, robot: Robot, origin: int, steps: IntArray
) -> dict[str, FloatArray]:
    """Returns the signals of a trial; NaN where nothing was observed.

    Args:
        trial: Mapping of the recording.
        tracks: Tracks of the recording.
        robot: The robot.
        origin: Time of the first control step, ns.
        steps: Times after the first step, ``(steps,)`` ns.

    Raises:
        ValueError: The initial pose of the base, which the start frame needs, is unknown.
    """
    anatomy = robot.anatomy

    def at(quantity: str, part: str, method: Method, width: int = 1) -> FloatArray:
        return at_steps(tracks.get((quantity, part), NOTHING), origin, steps, method, width)

    def all_of(quantity: str, parts: tuple[str, ...], method: Method) -> FloatArray:
        return np.concatenate([at(quantity, part, method) for part in parts], axis=1)

    def angle(hinge: str) -> FloatArray:
        # Only the angle of a hinge without limits can wrap around.
        limited = robot.model.joint(hinge).limited[0]
        return at("joint_positions", hinge, linear if limited else angles)

    positions = np.concatenate([angle(hinge) for hinge in anatomy.hinges], axis=1)
    readings = np.full((len(steps), len(anatomy.sensors)), np.nan)
    for column, sensor in enumerate(anatomy.sensors):
        if ("sensors", sensor.name) in tracks:
            readings[:, column] = at("sensors", sensor.name, hold_outside_gaps)[:, 0]
        elif sensor.kind == "angle":
            hinge = positions[:, anatomy.hinges.index(sensor.hinge)]
            readings[:, column] = (hinge - sensor.centre) / sensor.half_range
        elif ("touch", sensor.name) in tracks:
            readings[:, column] = at("touch", sensor.name, hold)[:, 0]
    # A gyroscope measures the angular velocity; odometry derives it.
    turning = "imu" if len(tracks.get(("imu_angular_velocity", ""), NOTHING)) else "base"
    body = "imu" if trial.base is None else "base"
    # The orientations of a bag keep the bits that earlier versions imported.
    exact = body == "base" and isinstance(trial, TableMapping)
    pose = {
        "base_position": at("base_position", "", linear, 3),
        "base_orientation": at(f"{body}_orientation", "", slerp_or_sample if exact else slerp, 4),
        "base_linear_velocity": at("base_linear_velocity", "", linear, 3),
    }
    observed = [
        key
        for key, quantity in (
            ("base_position", "base_position"),
            ("base_orientation", f"{body}_orientation"),
        )
        if len(tracks.get((quantity, ""), NOTHING))
    ]
    return {
        "joint_positions": positions,
        "joint_velocities": all_of("joint_velocities", anatomy.hinges, linear),
        "joint_efforts": all_of("joint_efforts", anatomy.hinges, linear),
        "commands": all_of("commands", anatomy.motors, hold_forever),
        "sensors": readings,
        **_in_frame(trial.base, pose, observed),
        "base_angular_velocity": at(f"{turning}_angular_velocity", "", linear, 3),
    }


def _in_frame(
    base: Base | None, pose: dict[str, FloatArray], observed: list[str]
) -> dict[str, FloatArray]:
    """Pose and linear velocity of the base in the frame of a mapping; the velocity in the world.

    Raises:
        ValueError: The initial pose, which the start frame needs, is unknown.
    """
    position, orientation, velocity = pose.values()
    in_world = getattr(base, "velocity_frame", "base") == "world"
    if base is None or base.frame == "start":
        if any(np.isnan(pose[signal][0]).any() for signal in observed):
            raise ValueError(
                "the pose of the base at the start of the trial is unknown, because of a gap in "
                "its topic"
            )
        position = position - position[0] * [1, 1, 0]
        if "base_orientation" in observed:
            rotation = _heading_removal(orientation[0])
            orientation = _rotated_world(orientation, rotation)
            position = rotated(position, rotation[np.newaxis])
            velocity = rotated(velocity, rotation[np.newaxis]) if in_world else velocity
    velocity = velocity if in_world else rotated(velocity, orientation)
    return dict(zip(pose, (position, orientation, velocity), strict=True))


def _rotated_world(quaternions: FloatArray, rotation: FloatArray) -> FloatArray:
    """Orientations ``(steps, 4)`` after a rotation of the world ``(4,)``, w x y z.

    A matrix product, which rounds differently from ``trials.rotation.product``.
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
