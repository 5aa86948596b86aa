"""Tracks: what a recording has of each part of a robot, in the units and signs of the model."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from selfmodel.logs.recordings import resample
from selfmodel.logs.recordings.mapping import Trial
from selfmodel.logs.recordings.mapping_file import RecordingMapping
from selfmodel.logs.recordings.recording import Recording
from selfmodel.logs.recordings.resample import NOTHING, Clocked, Track

if TYPE_CHECKING:
    from selfmodel.arrays import FloatArray

Tracks = dict[tuple[str, str], Track]
"""Tracks by quantity and part, in the units and signs of the model; see ``Trial.places``."""


def clocks_of(mapping: RecordingMapping, recording: Recording) -> dict[str, Clocked]:
    """Returns the times of the topics of a mapping, by topic."""
    clock = "column" if mapping.trial.time else mapping.trial.clock
    clocks = {}
    for place in mapping.places.values():
        try:
            clocks[place.topic] = resample.clocked(recording.series[place.topic], clock)
        except ValueError as error:
            raise mapping.error(
                (*place.role, "topic"),
                f'{place.topic}: {error}: set clock = "log" to use the log times',
            ) from error
    return clocks


def tracks_of(
    mapping: RecordingMapping, recording: Recording, clocks: Mapping[str, Clocked]
) -> Tracks:
    """Returns the tracks of the quantities and parts of a mapping."""
    tracks: Tracks = {}
    for key, place in mapping.places.items():
        columns = recording.series[place.topic].columns
        known = [columns[name] for name in place.columns if name in columns]
        known = [one for one in known if one.values.shape[1] > place.numbers[0]]
        raw = (
            resample.track(clocks[place.topic], known, slice(*place.numbers)) if known else NOTHING
        )
        tracks[key] = raw.scaled(place.scale, place.offset)
    for name, touch in mapping.trial.touch.items():
        force = tracks["touch", name]
        tracks["touch", name] = Track(force.times, (force.values > touch.threshold).astype(float))
    for body in ("base", "imu"):
        if (orientation := tracks.get((f"{body}_orientation", ""))) is not None:
            rounding = _ROUNDING if keeps_samples(mapping.trial, body) else 0.0
            tracks[f"{body}_orientation", ""] = _normalised(orientation, rounding)
    return tracks


_ROUNDING = 1e-14
"""Difference from 1 of the length of a normalised quaternion in float64."""


def keeps_samples(trial: Trial, body: str) -> bool:
    """Whether orientations at the time of a sample have its bits.

    Those of a bag keep the bits that earlier versions imported.
    """
    return body == "base" and trial.time is not None


def _normalised(track: Track, rounding: float) -> Track:
    """Normalised quaternions; unset ones, of length 0, are left out."""
    lengths: FloatArray = np.linalg.norm(track.values, axis=1)
    known = np.abs(lengths - 1) < 0.1
    # A quaternion that is normalised already keeps its bits.
    divisors = np.where(np.abs(lengths - 1) < rounding, 1.0, lengths)
    return Track(track.times[known], track.values[known] / divisors[known, np.newaxis])


def extent(mapping: RecordingMapping, tracks: Tracks, timestep: float) -> tuple[int, int]:
    """Returns the first and the last time at which every role has data, ns.

    Raises:
        InputError: A role has no data.
    """
    needed = required(tracks)
    for (quantity, part), needed_track in needed.items():
        place = mapping.places[quantity, part]
        if not len(needed_track):
            raise mapping.error(
                (*place.role, "topic"),
                f"{place.topic} has no number for {part or 'the base'}: name another one",
            )
    first = max(int(track.times[0]) for track in needed.values())
    return first, min(int(track.times[-1]) for track in _lasting(needed, timestep * 1e9))


def required(tracks: Tracks) -> Tracks:
    """Tracks that a trial requires: all but velocities, efforts and the controller's sensors.

    A hinge without a number is not required if another hinge has some: its encoder was lost.
    """
    hinges = {key: track for key, track in tracks.items() if key[0] == "joint_positions"}
    needed = {key: track for key, track in hinges.items() if len(track)} or hinges
    needed |= {key: track for key, track in tracks.items() if key[0] == "commands"}
    for pair in (
        ("base_position", "base_orientation"),
        ("imu_angular_velocity", "imu_orientation"),
    ):
        if mapped := [(quantity, "") for quantity in pair if (quantity, "") in tracks]:
            key = next((key for key in mapped if len(tracks[key])), mapped[-1])
            needed[key] = tracks[key]
    return needed | {key: track for key, track in tracks.items() if key[0] == "touch"}


def _lasting(needed: Tracks, step: float) -> list[Track]:
    """Tracks whose end is the end of the trial, of control steps in ns.

    The last command is held, so the end of the commands does not end the trial. Nor does that of
    an encoder that was lost: another one has a sample more than a gap (``reach``) after its last.
    """
    hinges = [track for (quantity, _), track in needed.items() if quantity == "joint_positions"]
    end = max(int(track.times[-1]) for track in hinges)
    return [
        track
        for (quantity, _), track in needed.items()
        if quantity != "commands"
        and (
            quantity != "joint_positions"
            or end - int(track.times[-1]) <= resample.reach(track.times, step)[-1]
        )
    ]
