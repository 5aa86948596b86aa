"""New log with the complete steps of a damaged or unfinished log."""

import dataclasses
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from selfmodel.errors import InputError
from selfmodel.files import encodable
from selfmodel.logs.errors import LogError
from selfmodel.logs.files import refuse_existing
from selfmodel.logs.mcap.contents import Contents, Messages, read_bytes
from selfmodel.logs.messages.signals import read_behaviour
from selfmodel.logs.messages.topics import DESCRIPTION, TRANSFORMS
from selfmodel.logs.reader import interpret, read_controller, read_log, read_record
from selfmodel.logs.records import (
    CONTROLLER_FILE,
    INTERRUPTED,
    MANIFEST,
    NONCE,
    RESULT,
    SALVAGE,
    SETTINGS_FILE,
    TIED,
    TRIAL,
    Result,
    TrialRecord,
    result_record,
    settings_json,
    sha256,
)
from selfmodel.logs.salvage.belonging import Discarded
from selfmodel.logs.salvage.rescue import rescue
from selfmodel.logs.salvage.steps import (
    complete_steps,
    cut,
    drop_foreign_displays,
    fill,
    missing_frames,
)
from selfmodel.logs.writing.logfile import LogFile
from selfmodel.settings import Settings
from selfmodel.trials.behaviour import forward_displacement


@dataclass(frozen=True)
class Salvaged:
    """Result of a salvage.

    Attributes:
        log: New file.
        steps: Number of complete steps.
        span: Number of steps in the new log, up to the last complete step.
        planned: Planned number of steps.
        missing: Number of lost messages by topic; they are replaced by NaN (not observed), except
            on ``/tf``, where they are left out.
        lost: Other lost parts. A lost controller is replaced by a playback of the commands, lost
            settings by those of the paper. Other records and files are known to be lost only if the
            trial is tied.
        tied: Whether every saved message is proven to be of this trial. False for a log of an
            earlier version, in which a mixture of two trials cannot be noticed.
        discarded: Intact messages that are of other trials or lack that proof; they are left out.
    """

    log: str
    steps: int
    span: int
    planned: int
    missing: dict[str, int]
    lost: tuple[str, ...]
    tied: bool
    discarded: tuple[Discarded, ...]


def salvage(path: Path, out: Path) -> Salvaged:
    """Writes all complete data of a damaged or unfinished log into a new, valid one.

    Args:
        path: The log; it is only read.
        out: The new log, whose status is ``interrupted``.

    Raises:
        LogError: The first records, the model, or every step is lost.
        InputError: The log is valid, ``out`` exists, or ``path`` does not.
        LogWriteError: The disk is full, or failed.
    """
    refuse_existing(out)
    _refuse_sound(path)
    contents, saved = _saved(path)
    _write(out, contents, result_record(contents.metadata[RESULT]))
    return dataclasses.replace(saved, log=str(out))


def salvageable_steps(path: Path) -> int:
    """Returns the number of complete steps that ``salvage`` would write.

    Args:
        path: The log; it is only read.

    Raises:
        InputError: The file does not exist.
    """
    try:
        return _saved(path)[1].steps
    except LogError:
        return 0


def _saved(path: Path) -> tuple[Contents, Salvaged]:
    """Contents of the new log, checked as a reader would check them."""
    rescued = rescue(path)
    contents = rescued.contents
    drop_foreign_displays(contents)
    record, replaced = _with_what_is_left(path, contents)
    lost = (*replaced, *(name for name in rescued.absent if name not in replaced))
    controller = read_controller(path, contents, record)
    every, whole = complete_steps(path, contents, record, rescued.discarded)
    span = max(whole) + 1
    missing = {topic.name: fill(contents, topic, span, record) for topic in every}
    cut(contents, {topic.name for topic in every}, span, record)
    missing[TRANSFORMS] = missing_frames(contents, span, record)
    behaviour = read_behaviour(path, contents, record, span, controller)
    earlier = contents.metadata.get(SALVAGE, {})
    tied = bool(rescued.identity) and earlier.get(TIED) != "no"
    result = Result(INTERRUPTED, span, float(forward_displacement(behaviour)))
    contents.metadata[RESULT] = result.texts()
    contents.metadata[SALVAGE] = {
        "source": encodable(path.name),
        "source_sha256": sha256(read_bytes(path)),
        "complete_steps": str(len(whole)),
        TIED: "yes" if tied else "no",
    }
    interpret(path, contents)
    lost_messages = {name: count for name, count in missing.items() if count}
    saved = Salvaged(
        log="",
        steps=len(whole),
        span=span,
        planned=record.steps,
        missing=lost_messages,
        lost=lost,
        tied=tied,
        discarded=rescued.discarded,
    )
    return contents, saved


def _refuse_sound(path: Path) -> None:
    try:
        status = read_log(path).status
    except LogError:
        return
    raise InputError(
        f"{path} is valid, and the trial in it is {status}: there is nothing to salvage"
    )


def _with_what_is_left(path: Path, contents: Contents) -> tuple[TrialRecord, tuple[str, ...]]:
    """Record of the trial, without lost attachments, and the names of the lost parts."""
    record = read_record(path, contents)
    lost = []
    attached = contents.attachments.get(CONTROLLER_FILE, b"")
    if record.controller_sha256 not in ("", sha256(attached)):
        record = dataclasses.replace(record, controller_sha256="")
        contents.attachments.pop(CONTROLLER_FILE, None)
        contents.metadata[TRIAL] = record.texts()
        lost.append(CONTROLLER_FILE)
    contents.metadata[TRIAL] = {NONCE: "", **contents.metadata[TRIAL]}
    if SETTINGS_FILE not in contents.attachments:
        contents.attachments[SETTINGS_FILE] = settings_json(Settings())
        lost.append(SETTINGS_FILE)
    if DESCRIPTION not in contents.topics or not contents.topics[DESCRIPTION].payloads:
        lost.append(DESCRIPTION)
    return record, tuple(lost)


def _write(out: Path, contents: Contents, result: Result) -> None:
    log = LogFile(out)
    with ExitStack() as undo:
        undo.callback(log.abandon)  # on any error; the damaged file is unchanged
        for name, texts in contents.metadata.items():
            if name not in (RESULT, MANIFEST):
                log.metadata(name, texts)
        for name, data in contents.attachments.items():
            log.attach(name, data)
        log.begin(contents.metadata[TRIAL]["name"])
        _write_messages(log, contents.topics)
        log.finish(result)
        undo.pop_all()


def _write_messages(log: LogFile, every: dict[str, Messages]) -> None:
    channels = [log.channel(topic, messages.type) for topic, messages in every.items()]
    rows = [
        (0, index, time, payload)
        for index, messages in enumerate(every.values())
        for payload, (time, _) in zip(messages.payloads, messages.times, strict=True)
    ]
    rows.sort(key=lambda row: (row[2], row[1]))
    log.messages(channels, rows)
