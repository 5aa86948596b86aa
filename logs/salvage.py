"""Salvage: a new log with the steps of a damaged or unfinished log before its first damage."""

from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from selfmodel.errors import InputError
from selfmodel.files import encodable, file_digest
from selfmodel.logs import reader, records
from selfmodel.logs.errors import CorruptError, LogError
from selfmodel.logs.files import refuse_existing
from selfmodel.logs.log_file import Contents, LogFile, read_undamaged
from selfmodel.logs.messages import DESCRIPTION, IMU, TRANSFORMS, imu, topics
from selfmodel.trials.trajectory import forward_displacement

_SEALED = "selfmodel.manifest"
"""Record of a log that version 0.1 wrote; it is not of the new log."""


@dataclass(frozen=True)
class Salvaged:
    """Result of a salvage: new file, its steps of those planned, first damage of the old file."""

    log: str
    steps: int
    planned: int
    damage: str


def salvage(path: Path, out: Path) -> Salvaged:
    """Writes the steps before the first damage of a log into a new one, of status ``interrupted``.

    Raises:
        LogError: No step is complete before the first damage.
        InputError: The log is valid, ``out`` exists, or ``path`` does not.
        LogWriteError: The disk is full, or failed.
    """
    refuse_existing(out)
    try:
        status = reader.read_log(path).status
    except LogError:
        contents, result, saved = _saved(path)
        _write(out, contents, result)
        return replace(saved, log=str(out))
    raise InputError(
        f"{path} is valid, and the trial in it is {status}: there is nothing to salvage"
    )


def salvageable_steps(path: Path) -> int:
    """Returns the number of steps that ``salvage`` would write, of a log that is only read."""
    try:
        return _saved(path)[2].steps
    except LogError:
        return 0


def _saved(path: Path) -> tuple[Contents, records.ResultRecord, Salvaged]:
    """Contents and result of the new log, checked as a reader would check them."""
    contents, damage = read_undamaged(path)
    reason = damage.what if damage else "the trial did not finish"
    record = reader.read_record(contents)
    controller = reader.read_controller(contents, record)
    steps = _cut(contents, record, reason)
    trajectory = reader.read_trajectory(contents, record, steps, controller)
    result = records.ResultRecord(
        records.INTERRUPTED, steps, float(forward_displacement(trajectory))
    )
    every = contents.metadata.items()
    own = {k: texts for k, texts in every if k.startswith(records.OWN) and k != _SEALED}
    contents.metadata = own | {
        records.TRIAL: records.texts_of(record),
        records.RESULT: records.texts_of(result),
        records.SALVAGE: {
            "source": encodable(path.name),
            "source_sha256": file_digest(path),
            "complete_steps": str(steps),
        },
    }
    reader.interpret(contents)
    return contents, result, Salvaged("", steps, record.steps, reason)


def _cut(contents: Contents, record: records.TrialRecord, reason: str) -> int:
    """Removes what is not of the complete first steps, and returns their number."""
    what = f"nothing can be salvaged before its first damage: {reason}"
    nothing = CorruptError(contents.path, what)
    try:
        names, first = reader.read_names(contents, record), reader.first_stamp(contents)
    except LogError as error:
        raise nothing from error
    every = [*topics(names, record.root, timed=record.format == records.TIMED_FORMAT)]
    if IMU in contents.topics:
        every.append(imu(record.root))

    def time_of(step: int) -> int:
        return first + round(step * record.control_timestep * 1e9)

    def first_steps(topic: str) -> int:
        """Number of messages before the first one that is missing."""
        times = contents.topics[topic].times if topic in contents.topics else []
        missing = (k for k, (time, _) in enumerate(times) if time != time_of(k))
        return next(missing, len(times))

    steps = min(first_steps(topic.name) for topic in every)
    if not steps:
        raise nothing
    kept = {*(topic.name for topic in every), TRANSFORMS, DESCRIPTION}
    contents.topics = {name: held for name, held in contents.topics.items() if name in kept}
    for messages in contents.topics.values():
        count = sum(time < time_of(steps) for time, _ in messages.times)
        del messages.payloads[count:], messages.times[count:]
    return steps


def _write(out: Path, contents: Contents, result: records.ResultRecord) -> None:
    log = LogFile(out)
    with ExitStack() as undo:
        undo.callback(log.abandon)  # on any error; the damaged file is unchanged
        for name, texts in contents.metadata.items():
            if name != records.RESULT:
                log.metadata(name, texts)
        for name, data in contents.attachments.items():
            log.attach(name, data)
        channels = [log.channel(name, held.type) for name, held in contents.topics.items()]
        rows = [
            (0, index, time, payload)
            for index, held in enumerate(contents.topics.values())
            for payload, (time, _) in zip(held.payloads, held.times, strict=True)
        ]
        log.messages(channels, sorted(rows, key=lambda row: (row[2], row[1])))
        log.finish(result)
        undo.pop_all()
