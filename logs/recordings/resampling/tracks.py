"""Time series of each part of the robot, in the model's units and signs."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from selfmodel.logs.recordings.mapping.mapping import NONE, Link, RecordingMapping, Role
from selfmodel.logs.recordings.resampling.clock import Track
from selfmodel.logs.recordings.resampling.resample import reach

if TYPE_CHECKING:
    from selfmodel.arrays import FloatArray

NOTHING = Track(np.zeros(0, dtype=np.int64), np.zeros((0, 1)))
"""Track of a quantity that was not recorded."""


@dataclass(frozen=True, eq=False)
class Tracks:
    """Tracks of a recording; a missing quantity is a track without samples.

    Attributes:
        positions: Joint angles by hinge, rad.
        velocities: Joint velocities by hinge, rad/s.
        efforts: Joint torques by hinge, N m.
        commands: Commanded angles by motor, rad.
        touch: Readings by touch sensor, 0 or 1.
        sensors: Readings by sensor, as the controller received them.
        base_position: Position in the recorded frame, m.
        base_orientation: Unit quaternions, w x y z, in the recorded frame.
        base_linear_velocity: Linear velocity in the frame that the mapping names, m/s.
        base_angular_velocity: Angular velocity in the frame of the base, rad/s.
    """

    positions: Mapping[str, Track]
    velocities: Mapping[str, Track]
    efforts: Mapping[str, Track]
    commands: Mapping[str, Track]
    touch: Mapping[str, Track]
    sensors: Mapping[str, Track]
    base_position: Track
    base_orientation: Track
    base_linear_velocity: Track
    base_angular_velocity: Track


@dataclass(frozen=True, eq=False)
class RawTracks:
    """Tracks of a recording in its own units and signs; see ``Tracks``.

    Attributes:
        positions: Joint angles by hinge.
        velocities: Joint velocities by hinge.
        efforts: Joint torques by hinge.
        commands: Commands by motor.
        touch: Values by touch sensor, which the mapping's threshold divides.
        sensors: Readings by sensor.
        base: Tracks of the root body, by the names in ``VECTORS``.
        imu: Tracks of an IMU: ``orientation`` and ``angular_velocity``.
    """

    positions: Mapping[str, Track]
    velocities: Mapping[str, Track]
    efforts: Mapping[str, Track]
    commands: Mapping[str, Track]
    touch: Mapping[str, Track]
    sensors: Mapping[str, Track]
    base: Mapping[str, Track]
    imu: Mapping[str, Track]


def converted(mapping: RecordingMapping, raw: RawTracks) -> Tracks:
    """Returns the tracks of a recording in the units and signs of the model.

    Args:
        mapping: Mapping, checked against the recording.
        raw: Tracks of the recording.
    """
    joints, commands = mapping.joints, mapping.commands
    positions, velocities, efforts = {}, {}, {}
    for hinge in (*joints.links, *joints.absent):
        link = joints.links.get(hinge, Link(NONE))
        scale = link.sign * joints.scale
        positions[hinge] = _scaled(raw.positions.get(hinge, NOTHING), scale, link.offset)
        velocities[hinge] = _scaled(raw.velocities.get(hinge, NOTHING), scale)
        efforts[hinge] = _scaled(raw.efforts.get(hinge, NOTHING), link.sign)
    touch = {
        name: Track(found.times, (found.values > mapping.touch[name].threshold).astype(np.float64))
        for name, found in raw.touch.items()
    }
    length = 1.0 if mapping.base is None else mapping.base.scale
    # The orientations of a bag keep the bits that earlier versions imported.
    rounding = _ROUNDING if mapping.base is not None and mapping.base.columns else 0.0
    orientation = _unit(raw.base.get("orientation", NOTHING), rounding)
    angular = raw.base.get("angular_velocity", NOTHING)
    if mapping.base is None:
        orientation = _unit(raw.imu.get("orientation", NOTHING))
    # A gyroscope measures the angular velocity; odometry derives it.
    measured = raw.imu.get("angular_velocity", NOTHING)
    return Tracks(
        positions=positions,
        velocities=velocities,
        efforts=efforts,
        commands={
            motor: _scaled(raw.commands[motor], link.sign * commands.scale, link.offset)
            for motor, link in commands.links.items()
        },
        touch=touch,
        sensors=raw.sensors,
        base_position=_scaled(raw.base.get("position", NOTHING), length),
        base_orientation=orientation,
        base_linear_velocity=_scaled(raw.base.get("linear_velocity", NOTHING), length),
        base_angular_velocity=measured if len(measured.times) else angular,
    )


def required(mapping: RecordingMapping, tracks: Tracks) -> list[tuple[Role, str, Track]]:
    """Returns the tracks that a trial requires, each with its role and part.

    A hinge without a number is not required if another hinge has some: its encoder was lost.
    """
    roles = {role.path: role for role in mapping.roles}
    hinges = {name: track for name, track in tracks.positions.items() if len(track.times)}
    found = [(roles["joints",], *hinge) for hinge in (hinges or tracks.positions).items()]
    found += [(roles["commands",], motor, track) for motor, track in tracks.commands.items()]
    if mapping.base is not None:
        pose = tracks.base_position if len(tracks.base_position.times) else tracks.base_orientation
        found.append((roles["base",], "the base", pose))
    if mapping.imu is not None:
        angular, orientation = tracks.base_angular_velocity, tracks.base_orientation
        found.append((roles["imu",], "the base", angular if len(angular.times) else orientation))
    found += [(roles["touch", name], name, track) for name, track in tracks.touch.items()]
    return found


def lasting(tracks: Mapping[str, Track]) -> list[Track]:
    """Returns the tracks without those that end early, such as those of encoders that were lost.

    A track ends early if another has a sample more than a gap (``reach``) after its last one.

    Args:
        tracks: Tracks of hinges, with samples.
    """
    end = max(int(track.times[-1]) for track in tracks.values())
    return [
        track
        for track in tracks.values()
        if end - int(track.times[-1]) <= reach(track.times.astype(np.float64))
    ]


def _scaled(track: Track, scale: float, offset: float = 0.0) -> Track:
    if scale == 1 and offset == 0:
        return track  # 0 would change the sign of a zero
    return Track(track.times, track.values * scale + offset)


def _unit(track: Track, rounding: float = 0.0) -> Track:
    """Normalised quaternions; unset ones, of length 0, are left out."""
    lengths: FloatArray = np.linalg.norm(track.values, axis=1)
    known = np.abs(lengths - 1) < 0.1
    # A quaternion that is normalised already keeps its bits.
    divisors = np.where(np.abs(lengths - 1) < rounding, 1.0, lengths)
    return Track(track.times[known], track.values[known] / divisors[known, np.newaxis])


_ROUNDING = 1e-14
"""Difference from 1 of the length of a normalised quaternion in float64."""
