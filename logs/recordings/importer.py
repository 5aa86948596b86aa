"""Import of a recording: trajectory and quality from a bag or table, a mapping and a robot."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from selfmodel.arrays import frozen
from selfmodel.controllers.controller import Controller
from selfmodel.controllers.playback import Playback
from selfmodel.logs.recordings.bags import read_bag
from selfmodel.logs.recordings.checks import check_recording, check_robot
from selfmodel.logs.recordings.mapping import TIMES, TableMapping
from selfmodel.logs.recordings.mapping_file import RecordingMapping
from selfmodel.logs.recordings.quality import Quality, notes, quality
from selfmodel.logs.recordings.recording import IntArray, Recording
from selfmodel.logs.recordings.resample import Clocked, ClocksApartError, Track, clocked, reach
from selfmodel.logs.recordings.signals import Tracks, signals, tracks_of
from selfmodel.logs.recordings.tables import FORMATS, is_table, read_table, recording_of
from selfmodel.logs.records import Imported, TrialHeader
from selfmodel.logs.writer import write_trial
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.behaviour import Behaviour, samples_of
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trial import TrialPlan

MAX_STEPS = 100_000
"""Largest number of control steps of a trial: its log has up to ten messages a step."""


@dataclass(frozen=True, eq=False)
class ImportedTrial:
    """Trial in a recording, resampled at the control steps.

    Attributes:
        behaviour: Behaviour at the control steps; NaN where not observed.
        qualities: Recording quality by topic.
        digests: SHA-256 of the recording's files by name.
        clock: Clock of the times: ``header``, ``log`` or ``column``.
        origin: Start of the trial, ns since 1970 or since the start of a table's time.
        notes: Warnings for the user, one sentence each.
    """

    behaviour: Behaviour
    qualities: Mapping[str, Quality]
    digests: Mapping[str, str]
    clock: str
    origin: int
    notes: tuple[str, ...]

    @property
    def valid(self) -> dict[str, float]:
        """Fraction of observed values by signal."""
        return {
            signal: float(np.mean(np.isfinite(values)))
            for signal, values in self.behaviour.signals.items()
        }

    def facts(self) -> dict[str, str]:
        """Returns the origin of the trial as texts for its log; lists and records are JSON."""
        topics = {topic: found.facts() for topic, found in self.qualities.items()}
        return {
            "sources_sha256": json.dumps(self.digests),
            "clock": self.clock,
            "start": str(self.origin),
            "valid": json.dumps(self.valid),
            "topics": json.dumps(topics, allow_nan=False),
            "notes": json.dumps(self.notes, ensure_ascii=False),
        }


def import_recording(path: Path, mapping: RecordingMapping, robot: Robot) -> ImportedTrial:
    """Returns the trial in a recording.

    Args:
        path: Folder or file of a bag, or a table; see ``is_table``.
        mapping: Mapping from topics or columns to the parts of the robot.
        robot: Robot that the mapping names.

    Raises:
        InputError: The recording is damaged or cannot be read, or the mapping does not fit it or
            the robot.
    """
    check_robot(mapping, robot.anatomy)
    recording = _read(path, mapping)
    check_recording(mapping, recording)
    clocks = _clocks(mapping, recording)
    tracks = tracks_of(mapping, recording, clocks)
    origin, steps = _steps(mapping, tracks, robot.control_timestep)
    try:
        found = signals(mapping.trial, tracks, robot, origin, steps)
    except ValueError as error:
        raise mapping.error(("start",), f"{error}: set another start") from error
    time = np.arange(len(steps), dtype=np.float64) * robot.control_timestep
    behaviour = Behaviour(
        robot.anatomy.names, frozen(time), {signal: frozen(found[signal]) for signal in SIGNALS}
    )
    roles: dict[str, dict[str, None]] = {}
    for place in mapping.places.values():
        if place.role != ("sensors",):
            roles.setdefault(place.topic, {})[".".join(place.role)] = None
    qualities = {
        topic: quality(recording.series[topic], clocks[topic], origin, tuple(names))
        for topic, names in roles.items()
    }
    clock = mapping.trial.clock
    warnings = notes(mapping, behaviour, qualities, robot)
    return ImportedTrial(behaviour, qualities, recording.digests, clock, origin, warnings)


def write_recording(
    path: Path,
    robot: Robot,
    recording: ImportedTrial,
    mapping: RecordingMapping,
    controller: Controller | None,
) -> Path:
    """Writes a recording as the log of a trial.

    Args:
        path: Name of the log; it must not exist.
        robot: Robot as its model describes it.
        recording: Trial in the recording.
        mapping: Mapping of the import; the log contains its text.
        controller: Controller of the robot; if not given, a playback of the recorded commands.

    Raises:
        InputError: The file exists, or the controller does not fit the robot.
        LogWriteError: The disk is full, or failed.
    """
    behaviour = recording.behaviour
    driver = controller or Playback(robot.anatomy.motors, behaviour["commands"])
    return write_trial(
        path,
        robot,
        TrialPlan("imported", mapping.trial.stage, driver, behaviour.steps, seed=0),
        samples_of(behaviour),
        TrialHeader(Settings(), imported=Imported(recording.facts(), mapping.text)),
    )


def _read(path: Path, mapping: RecordingMapping) -> Recording:
    """The topics or the columns of a mapping."""
    trial = mapping.trial
    places = mapping.places.values()
    if not isinstance(trial, TableMapping):
        if is_table(path):
            raise mapping.error(
                (),
                f"the mapping of a table needs [time] and the names of columns, and has none for "
                f"{path}: make one with --suggest",
            )
        return read_bag(path, {place.topic for place in places})
    if not is_table(path):
        raise mapping.error(
            ("time",),
            f"[time] is for tables ({', '.join(FORMATS)}), got the bag {path}: make a mapping of "
            f"it with --suggest",
        )
    time = trial.time.column
    wanted = {time, *(name for place in places for name in place.columns)}
    table = read_table(path, wanted, exact=time)
    if time not in table.columns:
        raise mapping.unknown(("time", "column"), "column of the table", time, table.names)
    return recording_of(path, table, time, TIMES[trial.time.unit])


def _clocks(mapping: RecordingMapping, recording: Recording) -> dict[str, Clocked]:
    clocks = {}
    for place in mapping.places.values():
        try:
            clocks[place.topic] = clocked(recording.series[place.topic], mapping.trial.clock)
        except ClocksApartError as error:
            raise mapping.error(
                (*place.role, "topic"),
                f'{place.topic}: {error}: set clock = "log" to use the log times',
            ) from error
    return clocks


def _steps(mapping: RecordingMapping, tracks: Tracks, timestep: float) -> tuple[int, IntArray]:
    """Time of the first control step at which every role has data, and times after it, ns."""
    needed = _required(tracks)
    for (quantity, part), track in needed.items():
        place = mapping.places[quantity, part]
        if not len(track):
            raise mapping.error(
                (*place.role, "topic"),
                f"{place.topic} has no number for {part or 'the base'}: name another one",
            )
    first = max(int(track.times[0]) for track in needed.values())
    # The last command is held, so the end of the commands does not end the trial; nor does that of
    # single encoders.
    lasting = [
        t for (quantity, _), t in needed.items() if quantity not in ("commands", "joint_positions")
    ]
    lasting += _lasting([t for (quantity, _), t in needed.items() if quantity == "joint_positions"])
    last = min(int(track.times[-1]) for track in lasting)
    trial = mapping.trial
    origin = first + round(trial.start * 1e9)
    period = timestep * 1e9
    available = int((last - origin + 0.5) // period) + 1
    steps = available if trial.duration is None else round(trial.duration / timestep)
    if available < 2 or steps > available:
        raise mapping.error(
            ("duration" if trial.duration is not None else "start",),
            f"every role has data for {max(0, last - first) / 1e9:.3f} s in all, got a start "
            f"{trial.start:g} s after the first of these data and {max(steps, 2)} steps of "
            f"{timestep:g} s: reduce start or duration, or omit the role with the least data",
        )
    if not 2 <= steps <= MAX_STEPS:
        raise mapping.error(
            ("duration",),
            f"a trial has 2 to {MAX_STEPS} steps, got {steps}: set another duration",
        )
    return origin, np.rint(np.arange(steps) * period).astype(np.int64)


def _required(tracks: Tracks) -> Tracks:
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
        found = [(quantity, "") for quantity in pair if (quantity, "") in tracks]
        if found:
            key = next((key for key in found if len(tracks[key])), found[-1])
            needed[key] = tracks[key]
    return needed | {key: track for key, track in tracks.items() if key[0] == "touch"}


def _lasting(hinges: list[Track]) -> list[Track]:
    """Tracks without those that end early, such as those of encoders that were lost.

    A track ends early if another has a sample more than a gap (``reach``) after its last one.
    """
    end = max(int(track.times[-1]) for track in hinges)
    return [track for track in hinges if end - int(track.times[-1]) <= reach(track.times)]
