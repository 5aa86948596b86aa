"""Reads a trial from its log, and believes nothing that it has not checked."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from selfmodel.controller import Controller
from selfmodel.errors import InputError
from selfmodel.logs.contents import Contents, read_contents
from selfmodel.logs.controllers import parse_controller
from selfmodel.logs.errors import (
    FROM_PART,
    CorruptError,
    IncompleteError,
    SchemaMismatchError,
    UnsupportedError,
)
from selfmodel.logs.records import (
    CONTROLLER_FILE,
    FINISHED,
    FORMAT,
    HIDDEN,
    MODEL_FILE,
    RESULT,
    SETTINGS_FILE,
    SOFTWARE,
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
from selfmodel.playback import Playback
from selfmodel.settings import Settings
from selfmodel.trial import Plan, Trial


@dataclass(frozen=True, eq=False)
class TrialLog:
    """Everything that a log says of a trial, but what the robot hides.

    Attributes:
        trial: What was to be done and what was observed.
        mjcf: The robot's model with nothing wrong, as XML.
        control_timestep: Seconds between two commands.
        settings: The paper's numbers, as they were.
        software: Versions, by the name of what they are of.
        status: ``finished``.
    """

    trial: Trial
    mjcf: str
    control_timestep: float
    settings: Settings
    software: Mapping[str, str]
    status: str


def read_log(path: str | Path) -> TrialLog:
    """Returns the trial in a log.

    The file's checksums, its counts, the hashes of the model and the controller, the layout of
    every message and its time, the names, and the displacement are checked. What the robot hides
    is not looked at.

    Raises:
        LogError: Something does not hold; the sentence names the file.
        InputError: There is no such file.
    """
    path = Path(path)
    contents = read_contents(path, unread=(HIDDEN,))
    record = _trial(path, contents)
    result = _result(path, contents)
    mjcf = _attachment(path, contents, MODEL_FILE, record.model_sha256)
    controller = _controller(path, contents, record)
    behaviour = read_behaviour(path, contents, record, controller)
    driver = controller or Playback(behaviour.names.motors, behaviour["commands"])
    plan = Plan(record.name, record.stage, driver, record.steps, record.seed)
    trial = Trial(plan, record.robot, behaviour, str(path))
    if (result.status, result.steps) != (FINISHED, record.steps):
        raise IncompleteError(
            path,
            f"the trial is {result.status!r} after {result.steps} of {record.steps} steps",
            advice=FROM_PART,
        )
    # As texts, for a robot that was lost to sight: nan is nan.
    if repr(result.displacement) != repr(trial.displacement):
        raise CorruptError(
            path,
            f"its result says {result.displacement!r} m of displacement, its messages say "
            f"{trial.displacement!r} m",
        )
    try:
        settings = parse_settings(_attachment(path, contents, SETTINGS_FILE))
        text = mjcf.decode()
    except (ValueError, TypeError) as error:
        raise SchemaMismatchError(path, f"an attachment cannot be read: {error}") from error
    return TrialLog(
        trial=trial,
        mjcf=text,
        control_timestep=record.control_timestep,
        settings=settings,
        software=MappingProxyType(dict(contents.metadata.get(SOFTWARE, {}))),
        status=result.status,
    )


def read_truth(path: str | Path) -> str | None:
    """Returns what was wrong with a simulated physical robot, in notation; None if unknown.

    This is for scoring. Nothing that diagnoses may call it.

    Raises:
        LogError: The file is damaged.
        InputError: There is no such file.
    """
    return read_contents(Path(path)).metadata.get(HIDDEN, {}).get(TRUTH)


def _trial(path: Path, contents: Contents) -> TrialRecord:
    texts = contents.metadata.get(TRIAL)
    if texts is None:
        raise SchemaMismatchError(
            path, f"it has no record {TRIAL}", advice="give a log that selfmodel wrote"
        )
    if texts.get("format") != FORMAT:
        raise UnsupportedError(
            path,
            f"expected format {FORMAT}, got {texts.get('format')!r}",
            advice="read it with the version of selfmodel that wrote it",
        )
    try:
        return trial_record(texts)
    except ValueError as error:
        raise SchemaMismatchError(path, f"its record {TRIAL} is wrong: {error}") from error


def _result(path: Path, contents: Contents) -> Result:
    texts = contents.metadata.get(RESULT)
    if texts is None:
        raise IncompleteError(
            path,
            f"it has no record {RESULT}, so the trial did not finish",
            good=contents.good,
            advice=FROM_PART,
        )
    try:
        return result_record(texts)
    except ValueError as error:
        raise SchemaMismatchError(path, f"its record {RESULT} is wrong: {error}") from error


def _attachment(path: Path, contents: Contents, name: str, expected: str = "") -> bytes:
    data = contents.attachments.get(name)
    if data is None:
        raise SchemaMismatchError(path, f"it has no attachment {name}")
    if expected and sha256(data) != expected:
        raise CorruptError(path, f"{name} is not the one that the trial was made with (SHA-256)")
    return data


def _controller(path: Path, contents: Contents, record: TrialRecord) -> Controller | None:
    if not record.controller_sha256:
        return None
    data = _attachment(path, contents, CONTROLLER_FILE, record.controller_sha256)
    try:
        return parse_controller(data, CONTROLLER_FILE)
    except InputError as error:
        raise SchemaMismatchError(path, str(error)) from error
