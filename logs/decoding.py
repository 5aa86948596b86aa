"""Decoding of a log's messages into a behaviour and the timing of its steps."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, frozen
from selfmodel.controllers.controller import Controller
from selfmodel.logs.cdr import decode_names
from selfmodel.logs.contents import Contents, Messages
from selfmodel.logs.errors import CorruptError, SchemaMismatchError
from selfmodel.logs.records import TIMED_FORMAT, TrialRecord
from selfmodel.logs.topics import TIMING, Part, Topic, topics
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.signals import SIGNALS, Names, Signal


@dataclass(frozen=True, eq=False)
class Timing:
    """Timing of a trial's steps; see ``selfmodel.trials.behaviour.StepTiming``.

    Attributes:
        elapsed: Time since the first step, ``(steps,)`` s; NaN if unknown.
        late: Flags of late steps, ``(steps,)``; a step lost from a damaged log is late.
        missing: Flags of steps without an observation, ``(steps,)``; a step lost from a damaged log
            is missing.
    """

    elapsed: FloatArray
    late: BoolArray
    missing: BoolArray


def read_behaviour(
    path: Path, contents: Contents, record: TrialRecord, steps: int, controller: Controller | None
) -> Behaviour:
    """Returns the behaviour in the messages of a log.

    Args:
        path: The log, for errors.
        contents: Contents of the log.
        record: Record of the trial.
        steps: Number of steps in the log's result.
        controller: Controller of the robot, if known; the messages must have its names.

    Raises:
        LogError: The messages do not fit the record, the controller or their types.
    """
    names = read_names(path, contents)
    ends = controller.design if controller else names
    if (names.sensors, names.motors) != (ends.sensors, ends.motors):
        raise SchemaMismatchError(
            path,
            f"its controller is for the sensors {ends.sensors} and motors {ends.motors}, "
            f"its messages have {names.sensors} and {names.motors}",
            good=contents.good,
        )
    held = len(_messages(path, contents, "/joint_states").payloads)
    if held != steps:
        raise CorruptError(
            path, f"{held} messages on /joint_states for {steps} steps", good=contents.good
        )
    time = times_of(record, steps)
    parts: dict[Part, FloatArray] = {}
    for topic in topics(names, record.root):
        parts |= read_rows(path, contents, topic, time)
    signals: dict[Signal, FloatArray] = {signal: frozen(parts[signal]) for signal in SIGNALS}
    return Behaviour(names, frozen(time), signals)


def times_of(record: TrialRecord, steps: int) -> FloatArray:
    """Returns the nominal times of the first steps of a trial, ``(steps,)`` s."""
    return np.arange(steps, dtype=np.float64) * record.control_timestep


def read_names(path: Path, contents: Contents) -> Names:
    """Returns the column names of the signals, from the first message of each topic.

    Raises:
        LogError: A topic has no message, or the message has no names.
    """
    return Names(
        sensors=_names(path, contents, "/sensors"),
        motors=_names(path, contents, "/joint_commands"),
        hinges=_names(path, contents, "/joint_states"),
    )


def _messages(path: Path, contents: Contents, topic: str) -> Messages:
    messages = contents.topics.get(topic)
    if messages is None or not messages.payloads:
        raise SchemaMismatchError(path, f"it has no messages on {topic}", good=contents.good)
    return messages


def _names(path: Path, contents: Contents, topic: str) -> tuple[str, ...]:
    try:
        return decode_names(_messages(path, contents, topic).payloads[0])
    except ValueError as error:
        raise SchemaMismatchError(path, f"on {topic}: {error}", good=contents.good) from error


def read_rows(
    path: Path, contents: Contents, topic: Topic, time: FloatArray
) -> dict[Part, FloatArray]:
    """Returns the numbers in the messages of a topic, ``(steps, width)`` per part.

    Args:
        path: The log, for errors.
        contents: Contents of the log.
        topic: Expected type and layout of the messages.
        time: Nominal times of the steps, ``(steps,)`` s.

    Raises:
        LogError: The messages have other times, or another type.
    """
    messages, good = _messages(path, contents, topic.name), contents.good
    if (messages.type, messages.encoding) != (topic.type, "cdr"):
        raise SchemaMismatchError(
            path,
            f"expected {topic.type} in cdr on {topic.name}, "
            f"got {messages.type!r} in {messages.encoding!r}",
            good=good,
        )
    if len(messages.payloads) != len(time):
        raise CorruptError(
            path,
            f"{len(messages.payloads)} messages on {topic.name} for {len(time)} steps",
            good=good,
        )
    try:
        stamps, values = topic.template.decode(messages.payloads)
    except ValueError as error:
        raise SchemaMismatchError(path, f"on {topic.name}: {error}", good=good) from error
    expected = np.rint(time * 1e9)
    times = np.array(messages.times, dtype=np.float64)  # exact for the first hundred days
    if np.any(stamps != expected) or np.any(times != expected[:, np.newaxis]):
        raise SchemaMismatchError(
            path,
            f"the times on {topic.name} are not the multiples of the control time step",
            good=good,
        )
    return topic.unpack(values)


def read_timing(path: Path, contents: Contents, record: TrialRecord, steps: int) -> Timing | None:
    """Returns the measured timing of the steps; None for a robot without its own clock.

    Args:
        path: The log, for errors.
        contents: Contents of the log.
        record: Record of the trial.
        steps: Number of steps in the log's result.

    Raises:
        LogError: The messages are missing, or their values are invalid.
    """
    if record.format != TIMED_FORMAT:
        return None
    rows = read_rows(path, contents, TIMING, times_of(record, steps))["timing"]
    elapsed, marks = rows[:, 0], rows[:, 1:]
    known = elapsed[~np.isnan(elapsed)]
    if not np.all(np.isfinite(known)) or np.any(np.diff(known) < 0):
        what = f"on {TIMING.name}: expected seconds that never go back"
        raise SchemaMismatchError(path, what, good=contents.good)
    if not np.all(np.isin(marks, (0.0, 1.0)) | np.isnan(marks)):
        what = f"on {TIMING.name}: expected 0 or 1 for late and for missing"
        raise SchemaMismatchError(path, what, good=contents.good)
    # NaN, unknown, counts as late and missing: such steps are not compared with predictions.
    return Timing(frozen(elapsed), marks[:, 0] != 0, marks[:, 1] != 0)
