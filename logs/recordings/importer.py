"""Import of a recording: trajectory and quality from a bag or table, a mapping and a robot."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from selfmodel.arrays import FloatArray, frozen
from selfmodel.controllers.controller import Controller
from selfmodel.controllers.playback import Playback
from selfmodel.logs.recordings import resample
from selfmodel.logs.recordings.bags import read_bag
from selfmodel.logs.recordings.mapping import TIMES, Trial
from selfmodel.logs.recordings.mapping_file import RecordingMapping, check_recording, check_robot
from selfmodel.logs.recordings.quality import Quality, no_measurements, notes, quality
from selfmodel.logs.recordings.recording import TABLE, IntArray, Recording
from selfmodel.logs.recordings.resample import NOTHING, Clocked, Method, Track, at_steps
from selfmodel.logs.recordings.runs import chosen_run
from selfmodel.logs.recordings.tables import FORMATS, is_table, read_table
from selfmodel.logs.records import Imported, TrialHeader
from selfmodel.logs.writer import write_trial
from selfmodel.robot.robot import Robot
from selfmodel.rotation import rotated
from selfmodel.settings import Settings
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import Trajectory, samples_of
from selfmodel.trials.trial import TrialPlan

MAX_STEPS = 100_000
"""Largest number of control steps of a trial: its log has up to ten messages a step."""

Tracks = dict[tuple[str, str], Track]
"""Tracks by quantity and part, in the units and signs of the model; see ``Trial.places``."""


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
    clock = "column" if mapping.trial.time else mapping.trial.clock
    recording = chosen_run(path, recording, _clocks(mapping, recording, clock), run)
    clocks = _clocks(mapping, recording, clock)
    tracks = _tracks(mapping, recording, clocks)
    origin, steps = _steps(mapping, tracks, robot.control_timestep)
    try:
        signals = _signals(mapping.trial, tracks, robot, origin, steps)
    except ValueError as error:
        raise mapping.error(("start",), f"{error}: set another start") from error
    time = np.arange(len(steps), dtype=np.float64) * robot.control_timestep
    for begin, end in mapping.trial.leave_out:
        out = (time >= begin) & (time <= end)
        if not out.any():
            span = f"[{begin:g}, {end:g}] is not [first, last], s, of the {time[-1]:g} s"
            raise mapping.error(("leave_out",), f"no step is left out: {span} of the trial")
        for name in signals.keys() - {"commands"}:
            signals[name][out] = np.nan
    trajectory = Trajectory(
        robot.anatomy.names, frozen(time), {signal: frozen(signals[signal]) for signal in SIGNALS}
    )
    roles: dict[str, dict[str, None]] = {}
    for place in mapping.places.values():
        if place.role != ("sensors",):
            roles.setdefault(place.topic, {})[".".join(place.role)] = None
    step, series = robot.control_timestep, recording.series
    qualities = {
        topic: quality(series[topic], clocks[topic], origin, step, tuple(names))
        for topic, names in roles.items()
    }
    warnings = (
        *recording.notes,
        *no_measurements(recording, mapping.places.values()),
        *notes(mapping.trial, trajectory, qualities, robot),
    )
    felt = frozen(signals["acceleration"]) if np.isfinite(signals["acceleration"]).any() else None
    return ImportedTrial(trajectory, qualities, recording.digests, clock, origin, felt, warnings)


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
        wanted: dict[str, set[str]] = {}
        for place in places:
            wanted.setdefault(place.topic, set()).update(place.columns)
        return read_bag(path, wanted)
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


def _clocks(mapping: RecordingMapping, recording: Recording, clock: str) -> dict[str, Clocked]:
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


def _tracks(
    mapping: RecordingMapping, recording: Recording, clocks: Mapping[str, Clocked]
) -> Tracks:
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
            rounding = _ROUNDING if _keeps_samples(mapping.trial, body) else 0.0
            tracks[f"{body}_orientation", ""] = _normalised(orientation, rounding)
    return tracks


_ROUNDING = 1e-14
"""Difference from 1 of the length of a normalised quaternion in float64."""


def _keeps_samples(trial: Trial, body: str) -> bool:
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


# ---------------------------------------------------------------- control steps


def _steps(mapping: RecordingMapping, tracks: Tracks, timestep: float) -> tuple[int, IntArray]:
    """Time of the first control step at which every role has data, and times after it, ns."""
    needed = _required(tracks)
    for (quantity, part), needed_track in needed.items():
        place = mapping.places[quantity, part]
        if not len(needed_track):
            raise mapping.error(
                (*place.role, "topic"),
                f"{place.topic} has no number for {part or 'the base'}: name another one",
            )
    first = max(int(track.times[0]) for track in needed.values())
    last = min(int(track.times[-1]) for track in _lasting(needed, timestep * 1e9))
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
            ("duration",), f"a trial has 2 to {MAX_STEPS} steps, got {steps}: set another duration"
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


# ---------------------------------------------------------------- signals


def _signals(
    trial: Trial, tracks: Tracks, robot: Robot, origin: int, steps: IntArray
) -> dict[str, FloatArray]:
    """Signals and acceleration at steps after the origin, the first one; NaN if not observed."""
    anatomy = robot.anatomy

    def at(quantity: str, part: str, method: Method, width: int = 1) -> FloatArray:
        return at_steps(tracks.get((quantity, part), NOTHING), origin, steps, method, width)

    def all_of(quantity: str, parts: tuple[str, ...], method: Method) -> FloatArray:
        return np.concatenate([at(quantity, part, method) for part in parts], axis=1)

    def angle(hinge: str) -> FloatArray:
        # Only the angle of a hinge without limits can wrap around.
        limited = robot.model.joint(hinge).limited[0]
        return at("joint_positions", hinge, resample.linear if limited else resample.angles)

    positions = np.concatenate([angle(hinge) for hinge in anatomy.hinges], axis=1)
    readings = np.full((len(steps), len(anatomy.sensors)), np.nan)
    for column, sensor in enumerate(anatomy.sensors):
        if ("sensors", sensor.name) in tracks:
            readings[:, column] = at("sensors", sensor.name, resample.hold_outside_gaps)[:, 0]
        elif sensor.kind == "angle":
            hinge = positions[:, anatomy.hinges.index(sensor.hinge)]
            readings[:, column] = (hinge - sensor.centre) / sensor.half_range
        elif ("touch", sensor.name) in tracks:
            readings[:, column] = at("touch", sensor.name, resample.hold)[:, 0]
    # A gyroscope measures the angular velocity; odometry derives it.
    turning = "imu" if len(tracks.get(("imu_angular_velocity", ""), NOTHING)) else "base"
    body = "imu" if trial.base is None else "base"
    turned = resample.slerp_or_sample if _keeps_samples(trial, body) else resample.slerp
    pose = {
        "base_position": at("base_position", "", resample.linear, 3),
        "base_orientation": at(f"{body}_orientation", "", turned, 4),
        "base_linear_velocity": at("base_linear_velocity", "", resample.linear, 3),
    }
    quantities = {"base_position": "base_position", "base_orientation": f"{body}_orientation"}
    observed = {
        signal for signal, name in quantities.items() if len(tracks.get((name, ""), NOTHING))
    }
    return {
        "joint_positions": positions,
        "joint_velocities": all_of("joint_velocities", anatomy.hinges, resample.linear),
        "joint_efforts": all_of("joint_efforts", anatomy.hinges, resample.linear),
        "commands": all_of("commands", anatomy.motors, resample.hold_forever),
        "sensors": readings,
        **_in_frame(trial, pose, observed),
        "base_angular_velocity": at(f"{turning}_angular_velocity", "", resample.linear, 3),
        "acceleration": at("imu_linear_acceleration", "", resample.linear, 3),
    }


def _in_frame(
    trial: Trial, pose: dict[str, FloatArray], observed: set[str]
) -> dict[str, FloatArray]:
    """Pose and linear velocity of the base in the frame of a mapping; the velocity in the world."""
    position, orientation, velocity = pose.values()
    in_world = trial.base is not None and trial.base.velocity_frame == "world"
    if trial.base is None or trial.base.frame == "start":
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

    A matrix product, which rounds differently from ``selfmodel.rotation.product``.
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
