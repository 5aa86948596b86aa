"""Reads a trial from its log, and believes nothing that it has not checked."""

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
from selfmodel.logs.signals import read_behaviour
from selfmodel.logs.timing import Timing, read_timing
from selfmodel.settings import Settings
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.trial import Trial, TrialPlan


@dataclass(frozen=True, eq=False)
class TrialLog:
    """Everything that a log says of a trial, but what the robot hides.

    Attributes:
        trial: What was to be done and what was observed.
        mjcf: The robot's model with nothing wrong, as XML: whoever wrote the log may have put
            anything there, and ``selfmodel.logs.robots.robot_of`` is how it is loaded.
        assets: The files that the model may name.
        root: The body whose motion was logged as the base's.
        control_timestep: Seconds between two commands.
        settings: The paper's numbers, as they were.
        software: Versions, by the name of what they are of.
        status: ``finished``, ``interrupted`` where the steps that were salvaged are all, or
            ``stopped`` where a robot with a clock of its own was.
        reason: Why it was stopped, or "".
        timing: When each step really happened, on a robot with a clock of its own.
        imported: Whether it is a recording that was resampled, and rounded by that.
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
    """Returns the trial in a log.

    The file's checksums, its counts, the digests of its records, of the model and the controller,
    the layout of every message and its time, the names, and the displacement are checked. What the
    robot hides is not looked at.

    Raises:
        LogError: Something does not hold; the sentence names the file.
        InputError: There is no such file.
    """
    path = Path(path)
    return interpret(path, read_contents(path, unread=(HIDDEN,)))


def interpret(path: Path, contents: Contents) -> TrialLog:
    """Returns the trial that the contents of a file tell of.

    Args:
        path: The file, for errors and as the trial's name for itself.
        contents: What stands in it; known to be sound.

    Raises:
        LogError: They do not fit the format of a trial log, or each other.
    """
    record = read_record(path, contents)
    result = _result(path, contents, record)
    mjcf = read_attachment(path, contents, MODEL_FILE, record.model_sha256)
    controller = read_controller(path, contents, record)
    behaviour = read_behaviour(path, contents, record, result.steps, controller)
    timing = read_timing(path, contents, record, result.steps)
    if timing is not None:
        behaviour = replace(behaviour, late=timing.late)
    driver = controller or _playback(path, behaviour)
    plan = TrialPlan(record.name, record.stage, driver, record.steps, record.seed)
    trial = Trial(plan, record.robot, behaviour, str(path))
    # As texts, for a robot that was lost to sight: nan is nan.
    if repr(result.displacement) != repr(trial.displacement):
        raise CorruptError(
            path,
            f"its result says {result.displacement!r} m of displacement, its messages say "
            f"{trial.displacement!r} m",
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
    """Returns what was wrong with a simulated physical robot, in notation; None if unknown.

    This is for scoring. Nothing that diagnoses may call it.

    Raises:
        LogError: The file is damaged.
        InputError: There is no such file.
    """
    return read_contents(Path(path)).metadata.get(HIDDEN, {}).get(TRUTH)


def read_gap(path: str | Path) -> dict[str, Any] | None:
    """Returns how a simulated physical robot differed from its model, beside what was wrong.

    This is for scoring. Nothing that diagnoses may call it.

    Returns:
        The numbers of a ``selfmodel.physical.reality_gap.Gap``, and under ``structure`` those of a
        ``selfmodel.physical.structural_mismatch.Structure`` or None; None where no gap is told.

    Raises:
        LogError: The file is damaged, or what it says is no gap.
        InputError: There is no such file.
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
    """Returns what was known of the trial before it started.

    Raises:
        LogError: It is missing, of another format, or wrong.
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
    """Returns a file within the file.

    Args:
        path: The file, for errors.
        contents: What stands in it.
        name: The attachment's.
        expected: Its SHA-256, if it is known.

    Raises:
        LogError: It is missing, or another one.
    """
    data = contents.attachments.get(name)
    if data is None:
        raise SchemaMismatchError(path, f"it has no attachment {name}", good=contents.good)
    if expected and sha256(data) != expected:
        raise CorruptError(
            path,
            f"{name} is not the one that the trial was made with (SHA-256)",
            good=contents.good,
        )
    return data


def read_controller(path: Path, contents: Contents, record: TrialRecord) -> Controller | None:
    """Returns what drove the robot; None if that is not known.

    Raises:
        LogError: It is missing, another one, or none at all.
    """
    if not record.controller_sha256:
        return None
    data = read_attachment(path, contents, CONTROLLER_FILE, record.controller_sha256)
    try:
        return parse_controller(data, CONTROLLER_FILE)
    except InputError as error:
        raise SchemaMismatchError(path, str(error), good=contents.good) from error


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
