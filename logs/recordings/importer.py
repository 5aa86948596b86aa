"""Import of a recording: behaviour and quality from a bag or table, a mapping and a robot."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from selfmodel.arrays import FloatArray, frozen
from selfmodel.controllers.controller import Controller
from selfmodel.controllers.playback import Playback
from selfmodel.logs.recordings.mapping.checks import (
    check_columns,
    check_names,
    check_table,
    check_topics,
)
from selfmodel.logs.recordings.mapping.mapping import TABLE, RecordingMapping
from selfmodel.logs.recordings.notes import notes
from selfmodel.logs.recordings.quality import Quality, quality
from selfmodel.logs.recordings.resampling.clock import Clocked, ClocksApartError, clocked
from selfmodel.logs.recordings.resampling.signals import (
    Steps,
    base_signals,
    command_signals,
    joint_signals,
    sensor_signals,
)
from selfmodel.logs.recordings.resampling.tracks import (
    RawTracks,
    Tracks,
    converted,
    lasting,
    required,
)
from selfmodel.logs.recordings.rosbag.bag import read_bag
from selfmodel.logs.recordings.rosbag.tracks import bag_tracks
from selfmodel.logs.recordings.series import Series, Source
from selfmodel.logs.recordings.tables.table import FORMATS, is_table, read_table
from selfmodel.logs.recordings.tables.tracks import rows_of, table_tracks
from selfmodel.logs.records import Imported, TrialHeader
from selfmodel.logs.writing.writer import write_trial
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.behaviour import Behaviour, samples_of
from selfmodel.trials.signals import SIGNALS, Signal
from selfmodel.trials.trial import TrialPlan

MAX_STEPS = 100_000
"""Largest number of control steps of a trial: its log has up to ten messages a step."""


@dataclass(frozen=True, eq=False)
class Recording:
    """Trial in a recording, resampled at the control steps.

    Attributes:
        behaviour: Behaviour at the control steps; NaN where not observed.
        qualities: Recording quality by topic.
        sources: Files of the recording.
        clock: Clock of the times: ``header``, ``log`` or ``column``.
        origin: Start of the trial, ns since 1970 or since the start of a table's time.
        notes: Warnings for the user, one sentence each.
    """

    behaviour: Behaviour
    qualities: Mapping[str, Quality]
    sources: tuple[Source, ...]
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
        sources = {source.name: source.sha256 for source in self.sources}
        return {
            "sources_sha256": json.dumps(sources),
            "clock": self.clock,
            "start": str(self.origin),
            "valid": json.dumps(self.valid),
            "topics": json.dumps(topics, allow_nan=False),
            "notes": json.dumps(self.notes, ensure_ascii=False),
        }


@dataclass(frozen=True, eq=False)
class Found:
    """Data of a recording, before they are resampled.

    Attributes:
        tracks: Tracks in the recording's own units and signs.
        series: Messages by topic, or the rows of a table.
        clocks: Times by topic.
        sources: Files of the recording.
    """

    tracks: RawTracks
    series: Mapping[str, Series]
    clocks: Mapping[str, Clocked]
    sources: tuple[Source, ...]


def import_recording(path: Path, mapping: RecordingMapping, robot: Robot) -> Recording:
    """Returns the trial in a recording.

    Args:
        path: Folder or file of a bag, or a table; see ``is_table``.
        mapping: Mapping from topics or columns to roles.
        robot: Robot that the mapping names.

    Raises:
        LogError: The recording is damaged.
        InputError: The recording cannot be read, or the mapping does not fit it or the robot.
    """
    anatomy = robot.anatomy
    touches = [sensor.name for sensor in anatomy.sensors if sensor.kind == "touch"]
    check_names(mapping, anatomy.hinges, anatomy.motors, touches, anatomy.names.sensors)
    found = (_table if is_table(path) else _bag)(path, mapping)
    tracks = converted(mapping, found.tracks)
    steps = _steps(mapping, tracks, robot.control_timestep)
    behaviour = _behaviour(mapping, tracks, robot, steps)
    qualities = _qualities(mapping, found, steps.origin)
    return Recording(
        behaviour=behaviour,
        qualities=qualities,
        sources=found.sources,
        clock=mapping.clock,
        origin=steps.origin,
        notes=notes(mapping, behaviour, qualities, robot),
    )


def _bag(path: Path, mapping: RecordingMapping) -> Found:
    if mapping.time is not None:
        raise mapping.document.error(
            ("time",),
            f"[time] is for tables ({', '.join(FORMATS)}), got the bag {path}: make a mapping of "
            f"it with --suggest",
        )
    bag = read_bag(path, {role.topic for role in mapping.roles})
    check_topics(mapping, bag)
    check_columns(mapping, bag.series)
    clocks = _clocks(mapping, bag.series)
    return Found(bag_tracks(mapping, bag.series, clocks), bag.series, clocks, bag.sources)


def _table(path: Path, mapping: RecordingMapping) -> Found:
    if mapping.time is None:
        raise mapping.document.error(
            (),
            f"the mapping of a table needs [time] and the names of columns, and has none for "
            f"{path}: make one with --suggest",
        )
    table = read_table(path, {name for _, name in mapping.columns}, exact=mapping.time.column)
    check_table(mapping, table.names)
    rows = rows_of(table, mapping.time)
    return Found(
        table_tracks(mapping, table, rows), {TABLE: rows.series}, {TABLE: rows.clock}, table.sources
    )


def write_recording(
    path: Path,
    robot: Robot,
    recording: Recording,
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
        TrialPlan("imported", mapping.stage, driver, behaviour.steps, seed=0),
        samples_of(behaviour),
        TrialHeader(Settings(), imported=Imported(recording.facts(), mapping.document.text)),
    )


def _clocks(mapping: RecordingMapping, series: Mapping[str, Series]) -> dict[str, Clocked]:
    found = {}
    for role in mapping.roles:
        try:
            found[role.topic] = clocked(series[role.topic], mapping.clock)
        except ClocksApartError as error:
            raise mapping.document.error(
                (*role.path, "topic"), f'{error}: set clock = "log" to use the log times'
            ) from error
    return found


def _steps(mapping: RecordingMapping, tracks: Tracks, timestep: float) -> Steps:
    """Control steps at which every role has data."""
    needed = required(mapping, tracks)
    for role, part, track in needed:
        if not len(track.times):
            where = "column" if mapping.time else "topic"
            raise mapping.document.error(
                role.path if mapping.time else (*role.path, "topic"),
                f"{role.topic} has no number for {part}: name another {where}",
            )
    first = max(int(track.times[0]) for _, _, track in needed)
    # The last command is held, so the end of the commands does not end the trial; nor does that of
    # single encoders.
    lasts = [track for role, _, track in needed if role.kind not in ("commands", "joints")]
    lasts += lasting({part: track for role, part, track in needed if role.kind == "joints"})
    last = min(int(track.times[-1]) for track in lasts)
    origin = first + round(mapping.start * 1e9)
    period = timestep * 1e9
    available = int((last - origin + 0.5) // period) + 1
    steps = available if mapping.duration is None else round(mapping.duration / timestep)
    if available < 2 or steps > available:
        raise mapping.document.error(
            ("duration" if mapping.duration is not None else "start",),
            f"every role has data for {max(0, last - first) / 1e9:.3f} s in all, got a start "
            f"{mapping.start:g} s after the first of these data and {max(steps, 2)} steps of "
            f"{timestep:g} s: reduce start or duration, or omit the role with the least data",
        )
    if not 2 <= steps <= MAX_STEPS:
        raise mapping.document.error(
            ("duration",),
            f"a trial has 2 to {MAX_STEPS} steps, got {steps}: set another duration",
        )
    return Steps(origin, np.rint(np.arange(steps) * period).astype(np.int64))


def _behaviour(mapping: RecordingMapping, tracks: Tracks, robot: Robot, steps: Steps) -> Behaviour:
    anatomy = robot.anatomy
    joints = joint_signals(tracks, robot, steps)
    try:
        base = base_signals(tracks, steps, mapping.base)
    except ValueError as error:
        raise mapping.document.error(
            ("start",), f"{error}, because of a gap in its topic: set another start"
        ) from error
    found: dict[Signal, FloatArray] = {
        **joints,
        **command_signals(tracks, anatomy, steps),
        **sensor_signals(tracks, anatomy, steps, joints["joint_positions"]),
        **base,
    }
    time = np.arange(len(steps.at), dtype=np.float64) * robot.control_timestep
    return Behaviour(
        anatomy.names, frozen(time), {signal: frozen(found[signal]) for signal in SIGNALS}
    )


def _qualities(mapping: RecordingMapping, found: Found, origin: int) -> dict[str, Quality]:
    roles: dict[str, tuple[str, ...]] = {}
    for role in mapping.roles:
        roles[role.topic] = (*roles.get(role.topic, ()), role.name)
    return {
        topic: quality(found.series[topic], found.clocks[topic], origin, played)
        for topic, played in roles.items()
    }
