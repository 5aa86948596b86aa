"""Strict reader of trial logs: every checksum, digest, layout and name is verified."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import msgspec
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, frozen
from selfmodel.controllers.controller import Controller
from selfmodel.controllers.playback import played_back
from selfmodel.errors import InputError
from selfmodel.files import path_of
from selfmodel.logs import errors, records
from selfmodel.logs.controllers import parse_controller
from selfmodel.logs.log_file import Contents, Messages, read_contents
from selfmodel.logs.messages import (
    COMMANDS,
    IMU,
    TIMING,
    Part,
    Topic,
    imu,
    is_known,
    names_in,
    schema_text,
    topics,
)
from selfmodel.settings import Settings
from selfmodel.trials.signals import SIGNALS, Names
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial, TrialPlan


@dataclass(frozen=True, eq=False)
class Timing:
    """Timing of a trial's steps, ``(steps,)`` each; see ``trials.trajectory.StepTiming``.

    Attributes:
        elapsed: Time since the first step, s; NaN if unknown.
        late: Flags of late steps; a step lost from a damaged log is late, and missing.
        missing: Flags of steps without an observation.
    """

    elapsed: FloatArray
    late: BoolArray
    missing: BoolArray


@dataclass(frozen=True, eq=False)
class TrialLog:
    """Content of a trial log, without the hidden faults of a simulated robot.

    Attributes:
        mjcf: Model of the healthy robot, as XML. The text is untrusted: load it with
            ``selfmodel.logs.robots.robot_of``.
        assets: Files that the model may name.
        root: Name of the body that was logged as the base.
        control_timestep: Control time step, s.
        settings: The paper's numbers at the time of the trial.
        software: Versions by the name of the software.
        status: ``finished``; ``interrupted`` for a salvaged trial; or ``stopped`` for a trial that
            its robot could not finish.
        reason: Cause of the stop, or "".
        timing: Measured timing of the steps, on a robot with its own clock.
        imported: Whether the trial is an imported recording, resampled and thereby rounded.
        acceleration: What the IMU of an imported recording measured, gravity included, in the frame
            of the base, ``(steps, 3)`` m/s^2, NaN where not observed; None without an IMU.
    """

    trial: Trial
    mjcf: str
    assets: Mapping[str, bytes]
    root: str
    control_timestep: float
    settings: Settings
    software: Mapping[str, str]
    status: str
    reason: str
    timing: Timing | None
    imported: bool
    acceleration: FloatArray | None


def read_log(path: str | Path) -> TrialLog:
    """Returns the content of a log.

    Verified are the checksums of the file and the counts of its records, the digests of its
    records, of the model and of the controller, the layout and time of every message, the names,
    and the displacement. The hidden faults of a simulated robot are not read.

    Example:
        >>> import selfmodel
        >>> log = selfmodel.read_log("before.mcap")
        >>> print(log.trial.plan.stage, log.trial.trajectory.steps, log.status)
        before 60 finished

    Raises:
        LogError: A check failed.
        InputError: The file does not exist, or the type is another.
    """
    return interpret(read_contents(path_of(path, "a log"), (records.HIDDEN,)))


def interpret(contents: Contents) -> TrialLog:
    """Returns the trial log in the contents of a file."""
    record = read_record(contents)
    result = _result(contents, record)
    for topic, messages in contents.topics.items():
        if is_known(messages.type) and messages.schema != schema_text(messages.type).encode():
            what = f"on {topic}: its definition of {messages.type} is not that of selfmodel"
            raise contents.error(what)
    mjcf = _attachment(contents, records.MODEL_FILE, record.model_sha256)
    controller = read_controller(contents, record)
    trajectory = read_trajectory(contents, record, result.steps, controller)
    timing = _timing(contents, record, result.steps)
    if timing is not None:
        trajectory = replace(trajectory, late=timing.late)
    with contents.mismatch("it has no controller, and cannot be played back"):
        driver = controller or played_back(
            trajectory.names.motors, trajectory["commands"], record.function
        )
    plan = TrialPlan(record.name, record.stage, driver, record.steps, record.seed)
    acceleration = None
    if IMU in contents.topics:
        acceleration = _rows(contents, imu(record.root), record, result.steps)["acceleration"]
    trial = Trial(plan, record.robot, trajectory, str(contents.path))
    # Compared as text: the displacement is NaN if the base was not observed.
    if repr(result.displacement) != repr(trial.displacement):
        what = (
            f"the displacement is {result.displacement!r} m in its result, and "
            f"{trial.displacement!r} m in its messages"
        )
        raise contents.error(what, errors.CorruptError)
    with contents.mismatch("an attachment cannot be read"):
        settings = records.parse_settings(_attachment(contents, records.SETTINGS_FILE))
        text = mjcf.decode()
    assets = {k: v for k, v in contents.attachments.items() if k not in records.OWN_FILES}
    return TrialLog(
        trial=trial,
        mjcf=text,
        assets=MappingProxyType(assets),
        root=record.root,
        control_timestep=record.control_timestep,
        settings=settings,
        software=MappingProxyType(dict(contents.metadata.get(records.SOFTWARE, {}))),
        status=result.status,
        reason=result.reason,
        timing=timing,
        imported=records.IMPORT in contents.metadata,
        acceleration=None if acceleration is None else frozen(acceleration),
    )


def read_truth(path: str | Path) -> str | None:
    """Returns the hidden faults of a simulated physical robot, in notation; None if unknown.

    For scoring only: no code of a diagnosis may call this function.

    Raises:
        LogError: The file is damaged.
        InputError: The file does not exist.
    """
    return read_contents(Path(path)).metadata.get(records.HIDDEN, {}).get(records.TRUTH)


def read_gap(path: str | Path) -> dict[str, Any] | None:
    """Returns the reality gap of a simulated physical robot.

    For scoring only: no code of a diagnosis may call this function.

    Returns:
        Attributes of a ``selfmodel.simulation.reality_gap.RealityGap``, and under ``structure``
        None, or the structural mismatch that version 0.1 could add; None without a gap.

    Raises:
        LogError: The file is damaged, or its gap is invalid.
        InputError: The file does not exist.
    """
    contents = read_contents(Path(path))
    text = contents.metadata.get(records.HIDDEN, {}).get(records.GAP)
    if text is None:
        return None
    with contents.mismatch("its gap cannot be read"):
        return dict(json.loads(text))


# ---------------------------------------------------------------- records and attachments


def read_record(contents: Contents) -> records.TrialRecord:
    """Returns the record ``selfmodel.trial``, which precedes the first step."""
    texts = contents.metadata.get(records.TRIAL)
    known = records.FORMAT, records.TIMED_FORMAT
    if texts is None:
        raise contents.error(f"it has no record {records.TRIAL}", advice=errors.ANOTHER)
    if texts.get("format") not in known:
        what = f"expected format {' or '.join(known)}, got {texts.get('format')!r}"
        raise errors.UnsupportedError(contents.path, what, advice=errors.OTHER_VERSION)
    with contents.mismatch(f"its record {records.TRIAL} is wrong"):
        return records.record_of(records.TrialRecord, texts)


def _result(contents: Contents, record: records.TrialRecord) -> records.ResultRecord:
    texts = contents.metadata.get(records.RESULT)
    if texts is None:
        what = f"it has no record {records.RESULT}, so the trial did not finish"
        raise contents.error(what, errors.IncompleteError, errors.salvage_it(contents.path))
    with contents.mismatch(f"its record {records.RESULT} is wrong"):
        result = records.record_of(records.ResultRecord, texts)
    if result.status not in records.STATUSES:
        what = f"the trial is {result.status!r}"
        raise contents.error(what, errors.UnsupportedError, errors.OTHER_VERSION)
    missing = record.steps - result.steps
    if missing < 0 or (missing > 0 and result.status == records.FINISHED):
        what = f"the trial is {result.status!r} after {result.steps} of {record.steps} steps"
        raise contents.error(what, errors.IncompleteError)
    return result


def _attachment(contents: Contents, name: str, expected: str = "") -> bytes:
    data = contents.attachments.get(name)
    if data is None:
        raise contents.error(f"it has no attachment {name}")
    if expected and records.sha256(data) != expected:
        what = f"{name} is not the file of the trial: its SHA-256 differs"
        raise contents.error(what, errors.CorruptError)
    return data


def read_controller(contents: Contents, record: records.TrialRecord) -> Controller | None:
    """Returns the controller of the robot; None if unknown."""
    if not record.controller_sha256:
        return None
    data = _attachment(contents, records.CONTROLLER_FILE, record.controller_sha256)
    try:
        return parse_controller(data, records.CONTROLLER_FILE)
    except InputError as error:
        raise contents.error(str(error)) from error


# ---------------------------------------------------------------- messages


def read_trajectory(
    contents: Contents, record: records.TrialRecord, steps: int, controller: Controller | None
) -> Trajectory:
    """Returns the trajectory in the messages of a log; they must have the names of a controller."""
    names = read_names(contents, record)
    ends = controller.design if controller else names
    if (names.sensors, names.motors) != (ends.sensors, ends.motors):
        raise contents.error(
            f"its controller is for the sensors {ends.sensors} and motors {ends.motors}, "
            f"its messages have {names.sensors} and {names.motors}"
        )
    parts: dict[Part, FloatArray] = {}
    for topic in topics(names, record.root, driven=names_on(contents, COMMANDS)):
        parts |= _rows(contents, topic, record, steps)
    time = np.arange(steps, dtype=np.float64) * record.control_timestep
    return Trajectory(names, frozen(time), {signal: frozen(parts[signal]) for signal in SIGNALS})


def read_names(contents: Contents, record: records.TrialRecord) -> Names:
    """Returns the column names of the signals, from the first message of each topic.

    A record with the names of the motors precedes those in the commands.
    """
    motors = names_on(contents, COMMANDS)
    if record.motors:
        with contents.mismatch("the motors in its record cannot be read"):
            named = msgspec.json.decode(record.motors, type=tuple[str, ...])
        if len(named) != len(motors):
            what = f"its record has {len(named)} motors, its commands are of {len(motors)}"
            raise contents.error(what)
        motors = named
    return Names(
        sensors=names_on(contents, "/sensors"),
        motors=motors,
        hinges=names_on(contents, "/joint_states"),
    )


def names_on(contents: Contents, topic: str) -> tuple[str, ...]:
    """Returns the names in the first message of a topic."""
    payload = _messages(contents, topic).payloads[0]
    with contents.mismatch(f"on {topic}"):
        return names_in(payload)


def first_stamp(contents: Contents) -> int:
    """Returns the time of the first step, ns: 0, or that of the recording of an import.

    An import by an earlier version begins at 0.
    """
    first = _messages(contents, "/joint_states").times[0][0]
    recorded = contents.metadata.get(records.IMPORT, {}).get("start")
    return first if recorded == str(first) else 0


def _messages(contents: Contents, topic: str) -> Messages:
    messages = contents.topics.get(topic)
    if messages is None or not messages.payloads:
        raise contents.error(f"it has no messages on {topic}")
    return messages


def _rows(
    contents: Contents, topic: Topic, record: records.TrialRecord, steps: int
) -> dict[Part, FloatArray]:
    """Numbers in the messages of a topic, one at each step, ``(steps, width)`` per part."""
    messages = _messages(contents, topic.name)
    if (messages.type, messages.encoding) != (topic.type, "cdr"):
        raise contents.error(
            f"expected {topic.type} in cdr on {topic.name}, "
            f"got {messages.type!r} in {messages.encoding!r}"
        )
    if len(messages.payloads) != steps:
        what = f"{len(messages.payloads)} messages on {topic.name} for {steps} steps"
        raise contents.error(what, errors.CorruptError)
    with contents.mismatch(f"on {topic.name}"):
        stamps, values = topic.template.decode(messages.payloads)
    since = np.rint(np.arange(steps, dtype=np.float64) * record.control_timestep * 1e9)
    expected = since.astype(np.int64) + first_stamp(contents)
    times = np.array(messages.times, dtype=np.uint64).astype(np.int64)
    if np.any(stamps != expected) or np.any(times != expected[:, np.newaxis]):
        what = f"the times on {topic.name} are not the multiples of the control time step"
        raise contents.error(what)
    return topic.unpack(values)


def _timing(contents: Contents, record: records.TrialRecord, steps: int) -> Timing | None:
    """Measured timing of the steps; None for a robot without its own clock."""
    if record.format != records.TIMED_FORMAT:
        return None
    rows = _rows(contents, TIMING, record, steps)["timing"]
    elapsed, marks = rows[:, 0], rows[:, 1:]
    known = elapsed[~np.isnan(elapsed)]
    if not np.all(np.isfinite(known)) or np.any(np.diff(known) < 0):
        raise contents.error(f"on {TIMING.name}: expected seconds that never go back")
    if not np.all(np.isin(marks, (0.0, 1.0)) | np.isnan(marks)):
        raise contents.error(f"on {TIMING.name}: expected 0 or 1 for late and for missing")
    # NaN, unknown, counts as late and missing: such steps are not compared with predictions.
    return Timing(frozen(elapsed), marks[:, 0] != 0, marks[:, 1] != 0)
