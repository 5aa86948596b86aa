"""Splices logs of several trials at random and salvages them: ``python -m tests.logs.splice``.

Salvage must never mix trials: all salvaged numbers must be those of one trial, or be marked as not
observed.
"""

import argparse
import json
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode

from selfmodel.errors import InputError
from selfmodel.logs import LogError, TrialLog, read_log
from selfmodel.logs.mcap.framing import Frame, frames
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.salvage import salvage
from selfmodel.logs.writing.writer import write_trial
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.signals import SIGNALS
from tests.logs.conftest import MJCF, made_up, plan_of, timed

STEPS = 130


@dataclass(frozen=True)
class Source:
    """A whole log and its parts.

    Attributes:
        data: Bytes of the file.
        frames: Records of the file.
        log: Content of the log.
    """

    data: bytes
    frames: tuple[Frame, ...]
    log: TrialLog

    def bytes_of(self, frame: Frame) -> bytes:
        """Returns the bytes of a record."""
        return self.data[frame.offset : frame.end]

    @property
    def chunks(self) -> list[Frame]:
        """Chunks of the file."""
        return [frame for frame in self.frames if frame.opcode == Opcode.CHUNK]


Splice = Callable[[Source, Source, np.random.Generator], bytes]


def halves(one: Source, other: Source, rng: np.random.Generator) -> bytes:
    """First part of one file, last part of another."""
    share = rng.uniform(0.1, 0.9)
    return one.data[: int(share * len(one.data))] + other.data[int(share * len(other.data)) :]


def halves_between_records(one: Source, other: Source, rng: np.random.Generator) -> bytes:
    """The same, cut between two chunks."""
    number = int(rng.integers(min(len(one.chunks), len(other.chunks))))
    return one.data[: one.chunks[number].offset] + other.data[other.chunks[number].offset :]


def swapped(one: Source, other: Source, rng: np.random.Generator) -> bytes:
    """Some chunks are those of another trial."""
    chunks = one.chunks
    pieces = dict.fromkeys(rng.integers(len(chunks), size=int(rng.integers(1, 4))).tolist())
    for number in pieces:
        pieces[number] = other.bytes_of(other.chunks[number % len(other.chunks)])
    return _assembled(
        one, [pieces.get(number) or one.bytes_of(chunk) for number, chunk in enumerate(chunks)]
    )


def reordered(one: Source, other: Source, rng: np.random.Generator) -> bytes:
    """The chunks of one trial, or of two, in another order."""
    pieces = [one.bytes_of(chunk) for chunk in one.chunks]
    if rng.random() < 0.5:
        pieces += [other.bytes_of(chunk) for chunk in other.chunks]
    order = rng.permutation(len(pieces))
    return _assembled(one, [pieces[number] for number in order])


def doubled(one: Source, other: Source, rng: np.random.Generator) -> bytes:
    """A chunk twice, or two whole files one after the other."""
    if rng.random() < 0.5:
        return one.data + other.data
    chunk = one.chunks[rng.integers(len(one.chunks))]
    return one.data[: chunk.end] + one.data[chunk.offset :]


def with_holes(one: Source, other: Source, rng: np.random.Generator) -> bytes:
    """Chunks of another trial in the holes of one."""
    pieces = [one.bytes_of(chunk) for chunk in one.chunks]
    for number in rng.integers(len(pieces), size=2):
        pieces[number] = b""
    pieces += [other.bytes_of(chunk) for chunk in other.chunks]
    return _assembled(one, pieces)


def other_preamble(one: Source, other: Source, rng: np.random.Generator) -> bytes:
    """The messages of one trial after one or all records and files of another's preamble."""
    kinds = (Opcode.METADATA, Opcode.ATTACHMENT)
    own = [frame for frame in one.frames if frame.opcode in kinds]
    foreign = [frame for frame in other.frames if frame.opcode in kinds]
    if rng.random() < 0.5:
        first = other.data[: other.chunks[0].offset]
        return first + one.data[one.chunks[0].offset :]
    number = int(rng.integers(min(len(own), len(foreign))))
    at = own[number]
    return one.data[: at.offset] + other.bytes_of(foreign[number]) + one.data[at.end :]


SPLICES: tuple[Splice, ...] = (
    halves,
    halves_between_records,
    swapped,
    reordered,
    doubled,
    with_holes,
    other_preamble,
)


def _assembled(one: Source, chunks: Sequence[bytes]) -> bytes:
    """A file with these chunks in the place of its own."""
    found = one.chunks
    return b"".join([one.data[: found[0].offset], *chunks, one.data[found[-1].end :]])


def sources(folder: Path) -> list[Source]:
    """Writes logs of one robot with other seeds and faults, of another robot, and salvaged ones."""
    biped = Robot("biped", MJCF, 0.01)
    light = Robot("biped", MJCF.replace('kp="10"', 'kp="9"'), 0.01)
    cases = [
        (biped, 0, TrialHeader(Settings(), hidden="intact")),
        (biped, 1, TrialHeader(Settings(), hidden="sensor:left_touch")),
        (biped, 2, TrialHeader(Settings())),
        (biped, 3, TrialHeader(Settings())),
        (light, 4, TrialHeader(Settings(), hidden="intact")),
        (biped, 5, TrialHeader(Settings(), timed=True)),
        (biped, 6, TrialHeader(Settings(), timed=True)),
    ]
    found = []
    for number, (robot, seed, header) in enumerate(cases):
        samples = made_up(robot, STEPS, seed)
        path = folder / f"{number}.mcap"
        plan = plan_of(robot, STEPS)
        write_trial(path, robot, plan, timed(samples) if header.timed else samples, header)
        found.append(source(path))
    for number in (0, 2, 5):
        whole = found[number]
        cut, saved = folder / f"{number}-cut.mcap", folder / f"{number}-saved.mcap"
        cut.write_bytes(whole.data[: whole.chunks[-2].end])
        salvage(cut, saved)
        found.append(source(saved))
    return found


def source(path: Path) -> Source:
    """Returns a whole log with its parts."""
    data = path.read_bytes()
    return Source(data, tuple(frames(data)), read_log(path))


def check(path: Path, spliced: bytes, trials: Sequence[Source]) -> str:
    """Returns what became of a spliced file; raises if it was read or salvaged as a mixture.

    Args:
        path: Name for the spliced file.
        spliced: Its bytes.
        trials: The two trials in it.
    """
    path.write_bytes(spliced)
    out = path.with_name("out.mcap")
    try:
        salvage(path, out)
    except LogError as error:
        return f"refused: {type(error).__name__}"
    except InputError:  # it is a whole log
        _pure(read_log(path), trials)
        return "whole"
    salvaged = read_log(out)
    out.unlink()
    _pure(salvaged, trials)
    return "salvaged"


def _pure(read: TrialLog, trials: Sequence[Source]) -> None:
    """Checks that all numbers are those of one trial, or not observed."""
    if not any(_is_of(read, trial.log) for trial in trials):
        raise AssertionError("a mixture of two trials")


def _is_of(read: TrialLog, trial: TrialLog) -> bool:
    steps = read.trial.behaviour.steps
    if steps > trial.trial.behaviour.steps or read.mjcf != trial.mjcf:
        return False
    for signal in SIGNALS:
        row, true = read.trial.behaviour[signal], trial.trial.behaviour[signal][:steps]
        if not np.all(np.isnan(row) | (row == true)):
            return False
    if read.timing is None or trial.timing is None:
        return read.timing is trial.timing
    elapsed = read.timing.elapsed
    return bool(np.all(np.isnan(elapsed) | (elapsed == trial.timing.elapsed[:steps])))


def run(count: int, seed: int) -> dict[str, Counter[str]]:
    """Splices and salvages so many files; returns the outcomes by kind of splice."""
    outcomes: dict[str, Counter[str]] = {splice.__name__: Counter() for splice in SPLICES}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        every = sources(folder)
        for number in range(count):
            rng = np.random.default_rng([seed, number])
            splice = SPLICES[number % len(SPLICES)]
            one, other = (every[k] for k in rng.choice(len(every), 2, replace=False))
            try:
                outcome = check(folder / "spliced.mcap", splice(one, other, rng), (one, other))
            except Exception:  # raised again, after the number that repeats the case
                print(f"case {number} of seed {seed}: {splice.__name__}", file=sys.stderr)
                raise
            outcomes[splice.__name__][outcome] += 1
    return outcomes


def main() -> None:
    """Splices so many files, and prints what became of them as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    outcomes = run(options.count, options.seed)
    total = sum(outcomes.values(), Counter())
    print(json.dumps({"cases": options.count, "total": total, "splices": outcomes}, indent=1))


if __name__ == "__main__":
    main()
