"""Import of a recording: trajectory and quality from a bag or table, a mapping and a robot."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from selfmodel.arrays import FloatArray, frozen
from selfmodel.controllers.controller import Controller
from selfmodel.controllers.playback import Playback
from selfmodel.logs.recordings.bags import read_bag
from selfmodel.logs.recordings.mapping import TIMES
from selfmodel.logs.recordings.mapping_file import RecordingMapping, check_recording, check_robot
from selfmodel.logs.recordings.quality import Quality, no_measurements, notes, quality
from selfmodel.logs.recordings.recording import TABLE, Recording
from selfmodel.logs.recordings.resample import ControlSteps
from selfmodel.logs.recordings.runs import chosen_run
from selfmodel.logs.recordings.signals import signals_of, start_frame
from selfmodel.logs.recordings.tables import FORMATS, is_table, read_table
from selfmodel.logs.recordings.tracks import Tracks, clocks_of, extent, tracks_of
from selfmodel.logs.records import Imported, TrialHeader
from selfmodel.logs.writer import write_trial
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import Trajectory, samples_of
from selfmodel.trials.trial import TrialPlan

MAX_STEPS = 100_000
"""Largest number of control steps of a trial: its log has up to ten messages a step."""


@dataclass(frozen=True, eq=False)
class ImportedTrial:
    """Trial in a recording, resampled at the control steps.

    Attributes:
        trajectory: Trajectory at the control steps; NaN where not observed.
        qualities: Recording quality by topic.
        digests: SHA-256 of the recording's files by name.
        clock: Clock of the times: ``header``, ``log`` or ``column``.
        origin: Start of the trial, ns since 1970 or since the start of a table's time.
        acceleration: Acceleration that the IMU measured; see ``records.Imported``.
    """

    trajectory: Trajectory
    qualities: Mapping[str, Quality]
    digests: Mapping[str, str]
    clock: str
    origin: int
    acceleration: FloatArray | None
    notes: tuple[str, ...]

    @property
    def valid(self) -> dict[str, float]:
        """Fraction of observed values by signal, and of the acceleration of an IMU."""
        values = dict[str, FloatArray](self.trajectory.signals.items())
        if self.acceleration is not None:
            values["imu_linear_acceleration"] = self.acceleration
        return {name: float(np.mean(np.isfinite(each))) for name, each in values.items()}

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


def import_recording(
    path: Path, mapping: RecordingMapping, robot: Robot, run: int | None = None
) -> ImportedTrial:
    """Returns the trial in a bag or a table of the robot that a mapping names.

    Written as a log (``write_recording``), it is read as any other trial is.

    Raises:
        InputError: The recording cannot be read, does not fit the mapping, or has no such run.
    """
    check_robot(mapping, robot.anatomy)
    recording = _read(path, mapping)
    check_recording(mapping, recording)
    recording = chosen_run(path, recording, clocks_of(mapping, recording), run)
    clocks = clocks_of(mapping, recording)
    tracks = tracks_of(mapping, recording, clocks)
    steps = _steps(mapping, tracks, robot.control_timestep)
    signals = signals_of(mapping.trial, tracks, robot, steps, start_frame(mapping, tracks, steps))
    trajectory = Trajectory(
        robot.anatomy.names,
        frozen(steps.seconds),
        {signal: frozen(signals[signal]) for signal in SIGNALS},
    )
    roles: dict[str, dict[str, None]] = {}
    for place in mapping.places.values():
        if place.role != ("sensors",):
            roles.setdefault(place.topic, {})[".".join(place.role)] = None
    step, series = robot.control_timestep, recording.series
    qualities = {
        topic: quality(series[topic], clocks[topic], steps.origin, step, tuple(names))
        for topic, names in roles.items()
    }
    warnings = (
        *recording.notes,
        *no_measurements(recording, mapping.places.values()),
        *notes(mapping.trial, trajectory, qualities, robot),
    )
    felt = frozen(signals["acceleration"]) if np.isfinite(signals["acceleration"]).any() else None
    clock = "column" if mapping.trial.time else mapping.trial.clock
    return ImportedTrial(
        trajectory, qualities, recording.digests, clock, steps.origin, felt, warnings
    )


def write_recording(
    path: Path,
    robot: Robot,
    recording: ImportedTrial,
    mapping: RecordingMapping,
    controller: Controller | None,
) -> Path:
    """Writes a recording as the log of a trial, with the text of its mapping.

    Without a controller, its plan is a playback of the recorded commands.
    """
    trajectory = recording.trajectory
    driver = controller or Playback(robot.anatomy.motors, trajectory["commands"])
    return write_trial(
        path,
        robot,
        TrialPlan("imported", mapping.trial.stage, driver, trajectory.steps, seed=0),
        samples_of(trajectory),
        TrialHeader(
            Settings(), imported=Imported(recording.facts(), mapping.text, recording.acceleration)
        ),
    )


def _read(path: Path, mapping: RecordingMapping) -> Recording:
    time, places = mapping.trial.time, mapping.places.values()
    if time is None:
        if is_table(path):
            raise mapping.error(
                (),
                f"the mapping of a table needs [time] and the names of columns, and has none for "
                f"{path}: make one with --suggest",
            )
        return read_bag(path, mapping.topics)
    if not is_table(path):
        raise mapping.error(
            ("time",),
            f"[time] is for tables ({', '.join(FORMATS)}), got the bag {path}: make a mapping of "
            f"it with --suggest",
        )
    listed = {name for place in places for name in place.columns}
    table = read_table(path, listed, time=time.column, unit=TIMES[time.unit])
    names = table.series[TABLE].names
    if time.column not in names:
        raise mapping.unknown(("time", "column"), "column of the table", time.column, names)
    return table


def _steps(mapping: RecordingMapping, tracks: Tracks, timestep: float) -> ControlSteps:
    """Returns the control steps of a trial, from the first one at which every role has data."""
    first, last = extent(mapping, tracks, timestep)
    trial = mapping.trial
    origin = first + round(trial.start * 1e9)
    available = int((last - origin + 0.5) // (timestep * 1e9)) + 1
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
            ("duration",), f"a trial has 2 to {MAX_STEPS} steps, got {steps}: set another duration"
        )
    found = ControlSteps(origin, timestep, np.arange(steps))
    for begin, end in trial.leave_out:
        if not ((found.seconds >= begin) & (found.seconds <= end)).any():
            span = f"[{begin:g}, {end:g}] is not [first, last], s, of the {found.seconds[-1]:g} s"
            raise mapping.error(("leave_out",), f"no step is left out: {span} of the trial")
    return found
