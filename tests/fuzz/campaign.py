"""A campaign: cases of all targets, in forked batches on some processes.

A batch is forked after the imports and the seeds, so that a case costs no start. A case that ends
its process (a crash, a limit) is known by the answer that is missing; the rest of the batch goes on
in a new process.
"""

import faulthandler
import os
import resource
import signal
import zlib
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from shutil import copytree, rmtree
from tempfile import TemporaryDirectory
from time import monotonic

import numpy as np

from tests.fuzz.oracle import Verdict, captured, innermost, judge
from tests.fuzz.target import Make, Target

BATCH = 250
"""Cases of one process."""

ADDRESS_SPACE = 2 * 2**30
"""Largest growth of the address space of a batch, bytes: a case that takes more ends with a
MemoryError, or with its process."""

STALLED = 60.0
"""Wall time after which a case without an answer is ended, s."""

KEPT = 3
"""Findings of one cause whose files are kept."""


@dataclass
class Tally:
    """Counts of one target.

    Attributes:
        outcomes: Number of cases by outcome.
        findings: Number of cases by place of the finding.
        seconds: CPU time of all checks, s.
        slowest: Largest CPU time of a case, s.
        megabytes: Largest growth of the memory by a case, 10^6 bytes.
    """

    outcomes: Counter[str] = field(default_factory=Counter)
    findings: Counter[str] = field(default_factory=Counter)
    seconds: float = 0.0
    slowest: float = 0.0
    megabytes: float = 0.0

    @property
    def cases(self) -> int:
        """Number of cases."""
        return self.outcomes.total() + self.findings.total()

    def add(self, verdict: Verdict) -> None:
        """Counts a case."""
        if verdict.problem:
            self.findings[verdict.place] += 1
        else:
            self.outcomes[verdict.outcome] += 1
        self.seconds += verdict.seconds
        self.slowest = max(self.slowest, verdict.seconds)
        self.megabytes = max(self.megabytes, verdict.megabytes)


@dataclass(frozen=True)
class Plan:
    """Extent of a campaign.

    Attributes:
        targets: The targets.
        seed: Seed of all cases.
        first: Number of the first case of each target.
        count: Number of cases of all targets together.
        seconds: Wall time after which no batch begins, s.
        processes: Number of processes at a time.
        failures: Folder of the findings, made with the first one.
    """

    targets: Sequence[Target]
    seed: int
    first: int
    count: int
    seconds: float
    processes: int
    failures: Path


_Block = tuple[Target, deque[int]]
"""Cases of one process: a target and their numbers."""


@dataclass
class _Batch:
    target: Target
    numbers: deque[int]
    process: BaseProcess
    answered: float


@contextmanager
def work_folder() -> Iterator[Path]:
    """Context manager that yields an empty folder, in memory where the system allows.

    The code under test flushes each file to the disk, which would take most of the time.
    """
    memory = Path("/dev/shm")  # noqa: S108  # the folder within it has a name of its own
    place = memory if os.access(memory, os.W_OK) else None
    with TemporaryDirectory(prefix="fuzz-", dir=place) as name:
        yield Path(name).resolve()


def run(plan: Plan, work: Path, on_batch: Callable[[str, int], None]) -> dict[str, Tally]:
    """Runs a campaign and returns the counts by target.

    Args:
        plan: Extent of the campaign.
        work: Empty folder for the cases.
        on_batch: Callback per batch, for the name of the target and its number of cases so far.
    """
    makers = {}
    for target in plan.targets:
        seeds = work / f"seeds-{target.name}"
        seeds.mkdir()
        makers[target.name] = target.prepare(seeds)
    todo = _blocks(plan)
    tallies = {target.name: Tally() for target in plan.targets}
    running: dict[Connection, _Batch] = {}
    end = monotonic() + plan.seconds
    while running or (todo and monotonic() < end):
        while todo and len(running) < plan.processes and monotonic() < end:
            target, numbers = todo.popleft()
            receiver, batch = _start(plan, target, makers[target.name], numbers, work)
            running[receiver] = batch
        for receiver in wait(list(running), timeout=1.0):
            batch = running[receiver]
            try:
                tallies[batch.target.name].add(receiver.recv())
            except EOFError:
                del running[receiver]
                todo.extendleft(_ended(plan, batch, work, tallies[batch.target.name]))
                on_batch(batch.target.name, tallies[batch.target.name].cases)
            else:
                batch.numbers.popleft()
                batch.answered = monotonic()
        for batch in running.values():
            if monotonic() - batch.answered > STALLED:
                batch.process.kill()
    return tallies


def _ended(plan: Plan, batch: _Batch, work: Path, tally: Tally) -> list[_Block]:
    """Counts the case that ended its process, if any, and returns the rest of the batch."""
    batch.process.join()
    if batch.numbers:
        tally.add(_death(plan, batch, work))
        batch.numbers.popleft()
    return [(batch.target, batch.numbers)] if batch.numbers else []


def _blocks(plan: Plan) -> deque[_Block]:
    """Batches of all targets, in turns, so that a time limit reaches every target."""
    shares = sum(target.share for target in plan.targets)
    rows = []
    for target in plan.targets:
        count = -(-plan.count * target.share // shares)
        numbers = range(plan.first, plan.first + count)
        size = min(BATCH, max(1, -(-count // plan.processes)))
        blocks = [numbers[k : k + size] for k in range(0, count, size)]
        rows += [((k + 1) / len(blocks), target, block) for k, block in enumerate(blocks)]
    rows.sort(key=lambda row: row[0])
    return deque((target, deque(block)) for _, target, block in rows)


def _start(
    plan: Plan, target: Target, make: Make, numbers: deque[int], work: Path
) -> tuple[Connection, _Batch]:
    context = get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    player = Player(plan, target, make, work)
    process = context.Process(target=_play, args=(player, list(numbers), sender))
    process.start()
    sender.close()
    return receiver, _Batch(target, numbers, process, monotonic())


def _play(player: "Player", numbers: list[int], sender: Connection) -> None:
    """Runs the cases of a batch, in its process."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    limit = pages * resource.getpagesize() + ADDRESS_SPACE
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGPROF, signal.SIG_DFL)
    output = _output(player.work, os.getpid())
    with captured(output) as file:
        faulthandler.enable(file, all_threads=False)
        faulthandler.register(signal.SIGPROF, file, all_threads=False, chain=True)
        for number in numbers:
            sender.send(player.play(number, output))
    output.unlink()


@dataclass(frozen=True)
class Player:
    """Maker and judge of the cases of one target.

    Attributes:
        plan: Extent of the campaign.
        target: The target.
        make: Maker of its cases.
        work: Folder for the cases.
    """

    plan: Plan
    target: Target
    make: Make
    work: Path

    def play(self, number: int, output: Path) -> Verdict:
        """Makes and judges one case; a finding is kept."""
        entropy = [self.plan.seed, zlib.crc32(self.target.name.encode()), number]
        case = self.make(np.random.default_rng(entropy))
        folder = _folder(self.work, self.target, number)
        folder.mkdir()
        note = _note(folder)
        note.write_text(case.what, encoding="utf-8", errors="backslashreplace")
        verdict = judge(case, folder, output)
        if verdict.problem:
            _keep(self.plan, self.target, number, folder, verdict)
            os.chdir(self.work)
            rmtree(folder)
        note.unlink()
        return verdict


def _folder(work: Path, target: Target, number: int) -> Path:
    return work / f"{target.name}-{number}"


def _note(folder: Path) -> Path:
    """File with the description of the case in a folder."""
    return folder.with_suffix(".txt")


def _output(work: Path, process: int) -> Path:
    return work / f"output-{process}"


def _death(plan: Plan, batch: _Batch, work: Path) -> Verdict:
    """Finding of a case that ended its process."""
    number, status = batch.numbers[0], batch.process.exitcode or 0
    name = signal.Signals(-status).name if status < 0 else f"status {status}"
    output = _output(work, batch.process.pid or 0)
    trace = output.read_text(errors="replace") if output.exists() else ""
    output.unlink(missing_ok=True)
    problem, place = f"its process ended with {name}\n{trace}", f"{name}-{innermost(trace)}"
    verdict = Verdict("", problem, place, 0.0, 0.0)
    folder = _folder(work, batch.target, number)
    folder.mkdir(exist_ok=True)  # it ended before there was one
    _keep(plan, batch.target, number, folder, verdict)
    rmtree(folder)
    return verdict


def _keep(plan: Plan, target: Target, number: int, folder: Path, verdict: Verdict) -> None:
    """Writes the files of a finding, its report and the command that repeats it."""
    place = plan.failures / target.name / verdict.place
    if place.exists() and len(list(place.iterdir())) >= KEPT:
        return
    kept = place / str(number)
    rmtree(kept, ignore_errors=True)
    copytree(folder, kept / "files", symlinks=True)
    note = _note(folder)
    what = note.read_text(encoding="utf-8") if note.exists() else "made"
    (kept / "report.txt").write_text(
        f"python -m tests.fuzz --only {target.name} --seed {plan.seed} --first {number} "
        f"--count 1\n\n{what}\n\n{verdict.problem}\n",
        encoding="utf-8",
        errors="backslashreplace",
    )
