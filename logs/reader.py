"""Strict reader of trial logs: every checksum, digest, count and name is verified."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from selfmodel.controllers.controller import Controller
from selfmodel.controllers.playback import Playback, played_back
from selfmodel.errors import InputError
from selfmodel.logs.contents import Contents, read_contents
from selfmodel.logs.controllers import parse_controller
from selfmodel.logs.decoding import Timing, read_behaviour, read_timing
from selfmodel.logs.errors import (
    ANOTHER,
    IMPORT_IT,
    OTHER_VERSION,
    CorruptError,
    IncompleteError,
    SchemaMismatchError,
    UnsupportedError,
    salvage_it,
)
from selfmodel.logs.records import (
    CONTROLLER_FILE,
    FINISHED,
    FORMATS,
    GAP,
    HIDDEN,
    IMPORT,
    INTERRUPTED,
    MAPPING_FILE,
    MODEL_FILE,
    RESULT,
    SETTINGS_FILE,
    SOFTWARE,
    STOPPED,
    TRIAL,
    TRUTH,
    Result,
    TrialRecord,
    parse_settings,
    result_record,
    sha256,
    trial_record,
)
from selfmodel.logs.topics import is_known, schema_text
from selfmodel.settings import Settings
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.trial import Trial, TrialPlan


@dataclass(frozen=True, eq=False)
class TrialLog:
    """Content of a trial log, without the hidden faults of a simulated robot.

    Attributes:
        trial: Plan and observed behaviour.
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


def read_log(path: str | Path) -> TrialLog:
    """Returns the content of a log.

    Verified are the checksums and counts of the file, the digests of its records, of the model and
    of the controller, the layout and time of every message, the names, and the displacement. The
    hidden faults of a simulated robot are not read.

    Example:
        >>> import selfmodel
        >>> log = selfmodel.read_log("before.mcap")
        >>> print(log.trial.plan.stage, log.trial.behaviour.steps, log.status)
        before 60 finished

    Args:
        path: The log.

    Raises:
        LogError: A check failed.
        InputError: The file does not exist.
    """
    path = Path(path)
    return interpret(path, read_contents(path, (HIDDEN,)))


def interpret(path: Path, contents: Contents) -> TrialLog:
    """Returns the trial log in the contents of a file.

    Args:
        path: The file, for errors and as the path of the trial.
        contents: Contents of the file, with verified checksums.

    Raises:
        LogError: The contents do not fit the format of a trial log, or contradict each other.
    """
    record = read_record(path, contents)
    result = _result(path, contents, record)
    _check_definitions(path, contents)
    mjcf = read_attachment(path, contents, MODEL_FILE, record.model_sha256)
    controller = read_controller(path, contents, record)
    behaviour = read_behaviour(path, contents, record, result.steps, controller)
    timing = read_timing(path, contents, record, result.steps)
    if timing is not None:
        behaviour = replace(behaviour, late=timing.late)
    driver = controller or _playback(path, behaviour)
    plan = TrialPlan(record.name, record.stage, driver, record.steps, record.seed)
    trial = Trial(plan, record.robot, behaviour, str(path))
    # Compared as text: the displacement is NaN if the base was not observed.
    if repr(result.displacement) != repr(trial.displacement):
        raise CorruptError(
            path,
            f"the displacement is {result.displacement!r} m in its result, and "
            f"{trial.displacement!r} m in its messages",
            good=contents.good,
        )
    try:
        settings = parse_settings(read_attachment(path, contents, SETTINGS_FILE))
        text = mjcf.decode()
    except (ValueError, TypeError, RecursionError) as error:
        raise SchemaMismatchError(
            path, f"an attachment cannot be read: {error}", good=contents.good
        ) from error
    return TrialLog(
        trial=trial,
        mjcf=text,
        assets=MappingProxyType(
            {name: data for name, data in contents.attachments.items() if name not in _OWN_FILES}
        ),
        root=record.root,
        control_timestep=record.control_timestep,
        settings=settings,
        software=MappingProxyType(dict(contents.metadata.get(SOFTWARE, {}))),
        status=result.status,
        reason=result.reason,
        timing=timing,
        imported=IMPORT in contents.metadata,
    )


def read_truth(path: str | Path) -> str | None:
    """Returns the hidden faults of a simulated physical robot, in notation; None if unknown.

    For scoring only: no code of a diagnosis may call this function.

    Raises:
        LogError: The file is damaged.
        InputError: The file does not exist.
    """
    return read_contents(Path(path)).metadata.get(HIDDEN, {}).get(TRUTH)


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
    text = contents.metadata.get(HIDDEN, {}).get(GAP)
    if text is None:
        return None
    try:
        values: Any = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise SchemaMismatchError(
            path, f"its gap cannot be read: {error}", good=contents.good
        ) from error
    if not isinstance(values, dict):
        raise SchemaMismatchError(
            path, f"expected its gap as an object, got {type(values).__name__}", good=contents.good
        )
    return values


_OWN_FILES = (MODEL_FILE, CONTROLLER_FILE, SETTINGS_FILE, MAPPING_FILE)


def read_record(path: Path, contents: Contents) -> TrialRecord:
    """Returns the record ``selfmodel.trial``, which precedes the first step.

    Raises:
        LogError: The record is missing, of another format, or invalid.
    """
    texts = contents.metadata.get(TRIAL)
    if texts is None:
        advice = f"{ANOTHER}; {IMPORT_IT}"
        raise SchemaMismatchError(
            path, f"it has no record {TRIAL}", good=contents.good, advice=advice
        )
    if texts.get("format") not in FORMATS:
        what = f"expected format {' or '.join(FORMATS)}, got {texts.get('format')!r}"
        raise UnsupportedError(path, what, advice=OTHER_VERSION)
    try:
        return trial_record(texts)
    except ValueError as error:
        raise SchemaMismatchError(
            path, f"its record {TRIAL} is wrong: {error}", good=contents.good
        ) from error


def read_attachment(path: Path, contents: Contents, name: str, expected: str = "") -> bytes:
    """Returns an attachment of a log.

    Args:
        path: The log, for errors.
        contents: Contents of the log.
        name: Name of the attachment.
        expected: SHA-256 of the attachment, if known.

    Raises:
        LogError: The attachment is missing, or its SHA-256 is wrong.
    """
    data = contents.attachments.get(name)
    if data is None:
        raise SchemaMismatchError(path, f"it has no attachment {name}", good=contents.good)
    if expected and sha256(data) != expected:
        raise CorruptError(
            path,
            f"{name} is not the file of the trial: its SHA-256 differs",
            good=contents.good,
        )
    return data


def read_controller(path: Path, contents: Contents, record: TrialRecord) -> Controller | None:
    """Returns the controller of the robot; None if unknown.

    Raises:
        LogError: The attached controller is missing, invalid, or its SHA-256 is wrong.
    """
    if not record.controller_sha256:
        return None
    data = read_attachment(path, contents, CONTROLLER_FILE, record.controller_sha256)
    try:
        return parse_controller(data, CONTROLLER_FILE)
    except InputError as error:
        raise SchemaMismatchError(path, str(error), good=contents.good) from error


def _check_definitions(path: Path, contents: Contents) -> None:
    for topic, messages in contents.topics.items():
        if is_known(messages.type) and messages.schema != schema_text(messages.type).encode():
            what = f"on {topic}: its definition of {messages.type} is not that of selfmodel"
            raise SchemaMismatchError(path, what, good=contents.good)


def _result(path: Path, contents: Contents, record: TrialRecord) -> Result:
    texts = contents.metadata.get(RESULT)
    if texts is None:
        raise IncompleteError(
            path,
            f"it has no record {RESULT}, so the trial did not finish",
            good=contents.good,
            advice=salvage_it(path),
        )
    try:
        result = result_record(texts)
    except ValueError as error:
        raise SchemaMismatchError(
            path, f"its record {RESULT} is wrong: {error}", good=contents.good
        ) from error
    if result.status not in (FINISHED, INTERRUPTED, STOPPED):
        raise UnsupportedError(
            path, f"the trial is {result.status!r}", good=contents.good, advice=OTHER_VERSION
        )
    if result.steps > record.steps or (result.status == FINISHED and result.steps < record.steps):
        raise IncompleteError(
            path,
            f"the trial is {result.status!r} after {result.steps} of {record.steps} steps",
            good=contents.good,
        )
    return result


def _playback(path: Path, behaviour: Behaviour) -> Playback:
    try:
        return played_back(behaviour.names.motors, behaviour["commands"])
    except ValueError as error:
        raise SchemaMismatchError(
            path, f"it has no controller, and cannot be played back: {error}"
        ) from error
