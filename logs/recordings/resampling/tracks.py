"""Time series of each part of the robot, in the model's units and signs."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from selfmodel.logs.recordings.mapping.mapping import BagMapping, Role
from selfmodel.logs.recordings.resampling.clock import Clocked, Track, track
from selfmodel.logs.recordings.series import Series

if TYPE_CHECKING:
    from selfmodel.arrays import FloatArray

_POSITION, _VELOCITY, _EFFORT = slice(0, 1), slice(1, 2), slice(2, 3)
_NOTHING = Track(np.zeros(0, dtype=np.int64), np.zeros((0, 1)))


@dataclass(frozen=True, eq=False)
class Tracks:
    """Tracks of a recording; a missing quantity is a track without samples.

    Attributes:
        positions: Joint angles by hinge, rad.
        velocities: Joint velocities by hinge, rad/s.
        efforts: Joint torques by hinge, N m.
        commands: Commanded angles by motor, rad.
        touch: Readings by touch sensor, 0 or 1.
        base_position: Position in the recorded frame, m.
        base_orientation: Unit quaternions, w x y z, in the recorded frame.
        base_linear_velocity: Linear velocity in the frame of the base, m/s.
        base_angular_velocity: Angular velocity in the frame of the base, rad/s.
    """

    positions: Mapping[str, Track]
    velocities: Mapping[str, Track]
    efforts: Mapping[str, Track]
    commands: Mapping[str, Track]
    touch: Mapping[str, Track]
    base_position: Track
    base_orientation: Track
    base_linear_velocity: Track
    base_angular_velocity: Track


def read_tracks(
    mapping: BagMapping, series: Mapping[str, Series], clocks: Mapping[str, Clocked]
) -> Tracks:
    """Returns the tracks of a recording.

    Args:
        mapping: Mapping, checked against the series.
        series: Messages by topic.
        clocks: Times by topic.
    """

    def of(topic: str, name: str, wanted: slice) -> Track:
        column = series[topic].columns.get(name)
        return _NOTHING if column is None else track(clocks[topic], column, wanted)

    joints, commands = mapping.joints, mapping.commands
    positions, velocities, efforts = {}, {}, {}
    for hinge, link in joints.links.items():
        scale = link.sign * joints.scale
        positions[hinge] = _scaled(of(joints.topic, link.name, _POSITION), scale, link.offset)
        velocities[hinge] = _scaled(of(joints.topic, link.name, _VELOCITY), scale)
        efforts[hinge] = _scaled(of(joints.topic, link.name, _EFFORT), link.sign)
    targets = {}
    for motor, link in commands.links.items():
        name = str(commands.order.index(link.name)) if commands.order else link.name
        found = of(commands.topic, name, _POSITION)
        targets[motor] = _scaled(found, link.sign * commands.scale, link.offset)
    touches = {}
    for sensor, touch in mapping.touch.items():
        found = of(touch.topic, touch.column, _POSITION)
        touches[sensor] = Track(found.times, (found.values > touch.threshold).astype(np.float64))
    position = orientation = linear = angular = _NOTHING
    if mapping.base is not None:
        topic, scale = mapping.base.topic, mapping.base.scale
        position = _scaled(of(topic, "", slice(0, 3)), scale)
        orientation = _unit(of(topic, "", slice(3, 7)))
        linear = _scaled(of(topic, "", slice(7, 10)), scale)
        angular = of(topic, "", slice(10, 13))
    if mapping.imu is not None:
        if mapping.base is None:
            orientation = _unit(of(mapping.imu, "", slice(0, 4)))
        # A gyroscope measures the angular velocity; odometry derives it.
        measured = of(mapping.imu, "", slice(4, 7))
        angular = measured if len(measured.times) else angular
    return Tracks(
        positions, velocities, efforts, targets, touches, position, orientation, linear, angular
    )


def required(mapping: BagMapping, tracks: Tracks) -> list[tuple[Role, str, Track]]:
    """Returns the tracks that a trial requires, each with its role and part."""
    roles = {role.path: role for role in mapping.roles}
    found = [(roles["joints",], hinge, track) for hinge, track in tracks.positions.items()]
    found += [(roles["commands",], motor, track) for motor, track in tracks.commands.items()]
    if mapping.base is not None:
        found.append((roles["base",], "the base", tracks.base_position))
    if mapping.imu is not None:
        angular, orientation = tracks.base_angular_velocity, tracks.base_orientation
        found.append((roles["imu",], "the base", angular if len(angular.times) else orientation))
    found += [(roles["touch", name], name, track) for name, track in tracks.touch.items()]
    return found


def _scaled(track: Track, scale: float, offset: float = 0.0) -> Track:
    return Track(track.times, track.values * scale + offset)


def _unit(track: Track) -> Track:
    """Normalised quaternions; unset ones, of length 0, are left out."""
    lengths: FloatArray = np.linalg.norm(track.values, axis=1)
    known = np.abs(lengths - 1) < 0.1
    return Track(track.times[known], track.values[known] / lengths[known, np.newaxis])
