"""Tracks of a bag, from the messages of its topics."""

from collections.abc import Mapping

from selfmodel.logs.recordings.mapping.mapping import RecordingMapping
from selfmodel.logs.recordings.resampling.clock import Clocked, Track, track
from selfmodel.logs.recordings.resampling.tracks import NOTHING, RawTracks
from selfmodel.logs.recordings.series import Series

_POSITION, _VELOCITY, _EFFORT = slice(0, 1), slice(1, 2), slice(2, 3)
_BASE = {
    "position": slice(0, 3),
    "orientation": slice(3, 7),
    "linear_velocity": slice(7, 10),
    "angular_velocity": slice(10, 13),
}
_IMU = {"orientation": slice(0, 4), "angular_velocity": slice(4, 7)}


def bag_tracks(
    mapping: RecordingMapping, series: Mapping[str, Series], clocks: Mapping[str, Clocked]
) -> RawTracks:
    """Returns the tracks of a bag.

    Args:
        mapping: Mapping, checked against the series.
        series: Messages by topic.
        clocks: Times by topic.
    """

    def of(topic: str, name: str, wanted: slice) -> Track:
        column = series[topic].columns.get(name)
        return NOTHING if column is None else track(clocks[topic], column, wanted)

    joints, commands, base, imu = mapping.joints, mapping.commands, mapping.base, mapping.imu

    def of_joints(wanted: slice) -> dict[str, Track]:
        return {hinge: of(joints.topic, link.name, wanted) for hinge, link in joints.links.items()}

    def column_of(name: str) -> str:
        return str(commands.order.index(name)) if commands.order else name

    return RawTracks(
        positions=of_joints(_POSITION),
        velocities=of_joints(_VELOCITY),
        efforts=of_joints(_EFFORT),
        commands={
            motor: of(commands.topic, column_of(link.name), _POSITION)
            for motor, link in commands.links.items()
        },
        touch={
            name: of(touch.topic, touch.column, _POSITION) for name, touch in mapping.touch.items()
        },
        sensors={},
        base={} if base is None else {key: of(base.topic, "", part) for key, part in _BASE.items()},
        imu={} if imu is None else {key: of(imu.topic, "", part) for key, part in _IMU.items()},
    )
