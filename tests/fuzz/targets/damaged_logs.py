"""Damaged trial logs: bytes are changed, and no checksum is corrected.

Each log must be refused with a ``LogError`` that names the file, or read exactly as it was written;
what is salvaged of it must be what was written, or marked as not observed.
"""

from collections import Counter
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Message
from mcap.stream_reader import breakup_chunk
from mcap.writer import CompressionType

from selfmodel.errors import InputError
from selfmodel.logs import LogError, TrialLog, read_log
from selfmodel.logs.mcap.framing import Frame, frames, parse
from selfmodel.logs.mcap.provenance import PROVENANCE
from selfmodel.logs.records import SETTINGS_FILE
from selfmodel.logs.salvage import salvage
from tests.fuzz.mcap_file import read_file, written
from tests.fuzz.mutate import data as raw
from tests.fuzz.same import check_same
from tests.fuzz.seeds import biped, trial_log
from tests.fuzz.target import Case, Make, Target

STEPS = 120
SALVAGED = 0.2
"""Share of the logs that are also salvaged, which writes a file and waits for the disk."""

NAME = "damaged.mcap"


def record_dropped(data: bytes, rng: np.random.Generator) -> bytes:
    """Removes a chunk; in a file without chunks, a message."""
    frame = _some_record(data, rng)
    return data[: frame.offset] + data[frame.end :]


def record_doubled(data: bytes, rng: np.random.Generator) -> bytes:
    """Doubles a chunk; in a file without chunks, a message."""
    frame = _some_record(data, rng)
    return data[: frame.end] + data[frame.offset :]


def _some_record(data: bytes, rng: np.random.Generator) -> Frame:
    every = list(frames(data))
    chunks = [frame for frame in every if frame.opcode == Opcode.CHUNK]
    found = chunks or [frame for frame in every if frame.opcode == Opcode.MESSAGE]
    return found[rng.integers(len(found))]


DAMAGES = (*raw.OPERATORS, record_dropped, record_doubled)


class Form:
    """A log in one packing, and the steps and chunks of each of its batches.

    Args:
        data: The file.
        whole: Its content.
    """

    def __init__(self, data: bytes, whole: TrialLog) -> None:
        self.data, self.whole = data, whole
        every = [(frame, data[frame.offset : frame.end]) for frame in frames(data)]
        first = [text for frame, text in every if frame.opcode in (Opcode.METADATA, Opcode.CHUNK)]
        models = [text for frame, text in every if frame.opcode == Opcode.ATTACHMENT]
        # The trial's record, its model, and the chunks that announce the topics.
        self._needed = [first[0], *models]
        self._batches: list[tuple[set[bytes], Counter[int]]] = []
        texts: set[bytes] = set()
        times: Counter[int] = Counter()
        seals = -1
        for frame, text in every:
            if frame.opcode != Opcode.CHUNK:
                continue
            for record in breakup_chunk(parse(frame), validate_crc=True):
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
        """Returns the number of steps that have all their messages in undamaged batches."""
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
    file = read_file(data)
    return [
        Form(data, whole),
        Form(written(file, CompressionType.ZSTD, 8 * 2**10), whole),
        Form(written(file, CompressionType.LZ4, 64 * 2**10), whole),
        Form(written(file, CompressionType.NONE, 64 * 2**10), whole),
        Form(written(file, CompressionType.NONE, None), whole),
    ]


def prepare(folder: Path) -> Make:
    """Returns the maker of damaged logs."""
    robot = biped()
    forms = [
        form
        for clock in (False, True)
        for form in packings(trial_log(folder / f"{clock}.mcap", robot, STEPS, clock=clock))
    ]

    def make(rng: np.random.Generator) -> Case:
        number = int(rng.integers(len(forms)))
        damage = DAMAGES[rng.integers(len(DAMAGES))]
        form = forms[number]
        damaged = damage(form.data, rng)
        salvaged = rng.random() < SALVAGED
        return Case(
            f"form {number}: {damage.__name__}",
            {NAME: damaged},
            partial(_check, form, salvaged=salvaged),
        )

    return make


def _check(form: Form, *, salvaged: bool) -> str:
    try:
        read = read_log(NAME)
    except LogError as error:
        if NAME not in str(error):
            raise AssertionError(f"the file is not named: {error}") from error
        outcome = type(error).__name__
    else:
        check_same(read, form.whole, allow_unobserved=False)
        outcome = "same"
    return f"{outcome}, {_check_salvage(form)}" if salvaged else outcome


def _check_salvage(form: Form) -> str:
    """Checks that salvage saves nothing but what was written, and all that is complete."""
    out = Path("saved.mcap")
    expected = form.surviving_steps(Path(NAME).read_bytes())
    try:
        result = salvage(Path(NAME), out)
    except LogError as error:
        if expected:
            raise AssertionError(f"{expected} whole steps were not saved: {error}") from error
        return "nothing saved"
    except InputError:
        return "sound"
    saved = read_log(out)
    out.unlink()
    if saved.status != "interrupted" or result.steps < expected:
        raise AssertionError(f"{expected} steps are whole, saved: {saved.status} {result}")
    if SETTINGS_FILE in result.lost:  # replaced by those of the paper
        saved = replace(saved, settings=form.whole.settings)
    check_same(saved, form.whole, allow_unobserved=True)
    return "saved"


TARGET = Target("damaged-logs", 25, prepare)
