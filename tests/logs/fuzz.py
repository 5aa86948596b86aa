"""Damages logs at random and checks that nothing of it goes unnoticed: ``make fuzz``.

Each damaged log must be refused with a ``LogError``, or read exactly as it did before; what is
salvaged of it must be what was written, or marked as not observed. Run as a process of its own, so
that its memory can be measured.
"""

import argparse
import io
import json
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from time import perf_counter
from typing import cast

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.writer import CompressionType, Writer

from selfmodel.errors import InputError
from selfmodel.logs import LogError, TrialLog, read_log
from selfmodel.logs.checksums import verified_records
from selfmodel.logs.framing import Frame, frames, parse, unpack
from selfmodel.logs.meter import Meter
from selfmodel.logs.provenance import PROVENANCE
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.salvage import salvage
from selfmodel.logs.writer import write_trial
from selfmodel.robot.robot import Robot
from selfmodel.sandbox.budget import DEFAULT_BUDGET
from selfmodel.settings import Settings
from selfmodel.trials.behaviour import Sample
from selfmodel.trials.signals import SIGNALS
from tests.logs.conftest import MJCF, made_up, plan_of, timed

STEPS = 120
SALVAGED = 5
"""One damaged log in so many is also salvaged, which writes a file and waits for the disk."""

Damage = Callable[[bytes, np.random.Generator], bytes]


def flipped(data: bytes, rng: np.random.Generator) -> bytes:
    damaged = bytearray(data)
    damaged[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
    return bytes(damaged)


def cut(data: bytes, rng: np.random.Generator) -> bytes:
    return data[: rng.integers(len(data))]


def garbage(data: bytes, rng: np.random.Generator) -> bytes:
    size = int(rng.integers(1, 513))
    start = int(rng.integers(len(data) - size))
    return data[:start] + rng.bytes(size) + data[start + size :]


def zeroed(data: bytes, rng: np.random.Generator) -> bytes:
    """What a disk leaves of a block that it never wrote."""
    start = int(rng.integers(len(data) - 4096))
    return data[:start] + bytes(4096) + data[start + 4096 :]


def record_dropped(data: bytes, rng: np.random.Generator) -> bytes:
    frame = _some_record(data, rng)
    return data[: frame.offset] + data[frame.end :]


def record_doubled(data: bytes, rng: np.random.Generator) -> bytes:
    frame = _some_record(data, rng)
    return data[: frame.end] + data[frame.offset :]


def _some_record(data: bytes, rng: np.random.Generator) -> Frame:
    """A chunk; in a file without any, a message."""
    every = list(frames(data))
    chunks = [frame for frame in every if frame.opcode == Opcode.CHUNK]
    found = chunks or [frame for frame in every if frame.opcode == Opcode.MESSAGE]
    return found[rng.integers(len(found))]


DAMAGES: tuple[Damage, ...] = (flipped, cut, garbage, zeroed, record_dropped, record_doubled)


def packed(data: bytes, compression: CompressionType, chunk_size: int | None) -> bytes:
    """Writes a log anew in other packing; without a chunk size, without chunks."""
    return written(verified_records(data), compression, chunk_size)


def written(
    records: Iterable[McapRecord], compression: CompressionType, chunk_size: int | None
) -> bytes:
    """Writes records as a file; without a chunk size, without chunks."""
    output = io.BytesIO()
    writer = Writer(
        output,
        chunk_size=chunk_size or 1,
        compression=compression,
        use_chunking=chunk_size is not None,
        enable_data_crcs=True,
    )
    writer.start("ros2")
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    for record in records:
        match record:
            case Schema(id=number) if number not in schemas:
                schemas[number] = writer.register_schema(record.name, record.encoding, record.data)
            case Channel(id=number) if number not in channels:
                channels[number] = writer.register_channel(
                    record.topic, record.message_encoding, schemas[record.schema_id]
                )
            case Message():
                writer.add_message(
                    channels[record.channel_id], record.log_time, record.data, record.publish_time
                )
            case Metadata():
                writer.add_metadata(record.name, record.metadata)
            case Attachment():
                writer.add_attachment(0, 0, record.name, record.media_type, record.data)
    writer.finish()
    return output.getvalue()


def check(path: Path, damaged: bytes, whole: TrialLog) -> str:
    """Returns how a damaged log was refused, or "same"; raises where it read as something else."""
    path.write_bytes(damaged)
    try:
        read = read_log(path)
    except LogError as error:
        if path.name not in str(error):
            raise AssertionError(f"the file is not named: {error}") from error
        return type(error).__name__
    _same(read, whole, allow_unobserved=False)
    return "same"


def check_salvage(path: Path, form: "Form") -> str:
    """Returns how salvage ended; raises where it saved what was not written, or less than it could.

    Args:
        path: The damaged log.
        form: The log as it was.
    """
    out = path.with_name("saved.mcap")
    expected = form.surviving_steps(path.read_bytes())
    try:
        told = salvage(path, out)
    except LogError as error:
        if expected:
            raise AssertionError(f"{expected} whole steps were not saved: {error}") from error
        return type(error).__name__
    except InputError:
        return "sound"
    saved = read_log(out)
    out.unlink()
    if saved.status != "interrupted" or told.steps < expected:
        raise AssertionError(f"{expected} steps are whole, saved: {saved.status} {told}")
    _same(saved, form.whole, allow_unobserved=True)
    return "saved"


class Form:
    """A log in one packing, and the steps and chunks of each of its batches.

    Args:
        data: The file.
        whole: What it says.
    """

    def __init__(self, data: bytes, whole: TrialLog) -> None:
        self.data, self.whole = data, whole
        every = [(frame, data[frame.offset : frame.end]) for frame in frames(data)]
        first = [text for frame, text in every if frame.opcode in (Opcode.METADATA, Opcode.CHUNK)]
        models = [text for frame, text in every if frame.opcode == Opcode.ATTACHMENT]
        chunks = [(frame, text) for frame, text in every if frame.opcode == Opcode.CHUNK]
        # The trial's record, its model, and the chunks that announce the topics.
        self._needed = [first[0], *models]
        self._batches: list[tuple[set[bytes], Counter[int]]] = []
        texts: set[bytes] = set()
        times: Counter[int] = Counter()
        seals = -1
        for frame, text in chunks:
            for record in unpack(cast("Chunk", parse(frame)), Meter(DEFAULT_BUDGET)):
                if isinstance(record, Channel):
                    self._needed.append(text)
                    seals = record.id if record.topic == PROVENANCE else seals
                elif isinstance(record, Message):
                    texts.add(text)
                    times[record.log_time] += 1
                    if record.channel_id == seals:
                        self._batches.append((texts, times))
                        texts, times = set(), Counter()

    def surviving_steps(self, damaged: bytes) -> int:
        """Returns how many steps have all their messages in batches that are still there."""
        if not self._batches or any(text not in damaged for text in self._needed):
            return 0
        full: Counter[int] = Counter()
        left: Counter[int] = Counter()
        for texts, times in self._batches:
            full += times
            if all(text in damaged for text in texts):
                left += times
        return sum(left[time] == count for time, count in full.items())


def packings(log: Path) -> list[Form]:
    """Returns a log in each packing."""
    whole, data = read_log(log), log.read_bytes()
    return [
        Form(data, whole),
        Form(packed(data, CompressionType.ZSTD, 8 * 2**10), whole),
        Form(packed(data, CompressionType.LZ4, 64 * 2**10), whole),
        Form(packed(data, CompressionType.NONE, 64 * 2**10), whole),
        Form(packed(data, CompressionType.NONE, None), whole),
    ]


def _with_a_clock(robot: Robot) -> Iterator[Sample]:
    return timed(made_up(robot, STEPS))


def _same(read: TrialLog, whole: TrialLog, *, allow_unobserved: bool) -> None:
    told = (read.mjcf, read.control_timestep, read.settings, read.trial.robot, read.root)
    expected = (whole.mjcf, whole.control_timestep, whole.settings, whole.trial.robot, whole.root)
    if told != expected or read.trial.plan.seed != whole.trial.plan.seed:
        raise AssertionError("what the log says of its trial has changed")
    if not allow_unobserved and read.trial.plan != whole.trial.plan:
        raise AssertionError("the plan has changed")
    steps = read.trial.behaviour.steps
    for signal in SIGNALS:
        row, true = read.trial.behaviour[signal], whole.trial.behaviour[signal][:steps]
        equal = row.view(np.int64) == true.view(np.int64)
        if allow_unobserved:
            equal |= np.isnan(row)
        if not np.all(equal):
            raise AssertionError(f"{signal} has changed")
    _same_timing(read, whole, allow_unobserved=allow_unobserved)


def _same_timing(read: TrialLog, whole: TrialLog, *, allow_unobserved: bool) -> None:
    if read.timing is None or whole.timing is None:
        if read.timing is not whole.timing:
            raise AssertionError("whether the robot has a clock has changed")
        return
    steps = len(read.timing.elapsed)
    lost = np.isnan(read.timing.elapsed) if allow_unobserved else np.zeros(steps, dtype=bool)
    for name in ("elapsed", "late", "missing"):
        if not np.all((getattr(read.timing, name) == getattr(whole.timing, name)[:steps]) | lost):
            raise AssertionError(f"{name} has changed")
    if not np.all((read.timing.late & read.timing.missing)[lost]):
        raise AssertionError("a step that was lost is not marked")


def main() -> None:
    """Damages so many logs, and prints what became of them as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=30_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    robot = Robot("biped", MJCF, 0.01)
    outcomes: Counter[str] = Counter()
    salvages: Counter[str] = Counter()
    slowest = 0.0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "damaged.mcap"
        forms = [
            form
            for samples, clock in ((made_up(robot, STEPS), False), (_with_a_clock(robot), True))
            for form in packings(
                write_trial(
                    Path(folder) / f"whole-{clock}.mcap",
                    robot,
                    plan_of(robot, STEPS),
                    samples,
                    TrialHeader(Settings(), timed=clock, hidden="intact"),
                )
            )
        ]
        for number in range(options.count):
            rng = np.random.default_rng([options.seed, number])
            damage = DAMAGES[number % len(DAMAGES)]
            form = forms[number // len(DAMAGES) % len(forms)]
            damaged = damage(form.data, rng)
            start = perf_counter()
            try:
                outcomes[check(path, damaged, form.whole)] += 1
                if number // (len(DAMAGES) * len(forms)) % SALVAGED == 0:
                    salvages[check_salvage(path, form)] += 1
            except Exception:
                print(f"case {number} of seed {options.seed}: {damage.__name__}", file=sys.stderr)
                raise
            slowest = max(slowest, perf_counter() - start)
    # The peak of this program: ru_maxrss also counts the process that started it.
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    kilobytes = int(status.partition("VmHWM:")[2].split()[0])
    print(
        json.dumps(
            {
                "cases": options.count,
                "outcomes": outcomes,
                "salvages": salvages,
                "slowest_seconds": slowest,
                "memory_megabytes": kilobytes / 1000,
            }
        )
    )


if __name__ == "__main__":
    main()
