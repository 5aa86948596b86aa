"""A campaign: cases of all targets, in forked batches on some processes.

A batch is forked after the imports and the seeds, so that a case costs no start. A case that ends
its process (a crash, a limit) is known by the answer that is missing; the rest of the batch goes on
in a new process.
"""

import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic

from tests.fuzz.player import Player
from tests.fuzz.tally import Tally
from tests.fuzz.target import Target

BATCH = 1000
"""Largest number of cases of one process: each process starts a server of the sandbox."""

STALLED = 300.0
"""Wall time after which a case without an answer is ended, s."""


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


_Block = tuple[Player, deque[int]]
"""Cases of one process: their maker and their numbers."""


@dataclass
class _Batch:
    player: Player
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
    todo = _blocks(plan, [_player(plan, target, work) for target in plan.targets])
    tallies = {target.name: Tally() for target in plan.targets}
    running: dict[Connection, _Batch] = {}
    end = monotonic() + plan.seconds
    while running or (todo and monotonic() < end):
        while todo and len(running) < plan.processes and monotonic() < end:
            receiver, batch = _start(*todo.popleft())
            running[receiver] = batch
        for receiver in wait(list(running), timeout=1.0):
            batch = running[receiver]
            name = batch.player.target.name
            try:
                tallies[name].add(receiver.recv())
            except EOFError:
                del running[receiver]
                todo.extendleft(_ended(batch, tallies[name]))
                on_batch(name, tallies[name].cases)
            else:
                batch.numbers.popleft()
                batch.answered = monotonic()
        for batch in running.values():
            if monotonic() - batch.answered > STALLED:
                batch.process.kill()
    return tallies


def _ended(batch: _Batch, tally: Tally) -> list[_Block]:
    """Counts the case that ended its process, if any, and returns the rest of the batch."""
    process = batch.process
    process.join()
    if batch.numbers:
        number = batch.numbers.popleft()
        tally.add(batch.player.death(number, process.pid or 0, process.exitcode or 0))
    return [(batch.player, batch.numbers)] if batch.numbers else []


def _player(plan: Plan, target: Target, work: Path) -> Player:
    seeds = work / f"seeds-{target.name}"
    seeds.mkdir()
    return Player(target, target.prepare(seeds), plan.seed, work, plan.failures)


def _blocks(plan: Plan, players: Sequence[Player]) -> deque[_Block]:
    """Batches of all targets, in turns, so that a time limit reaches every target."""
    shares = sum(target.share for target in plan.targets)
    rows = []
    for player in players:
        count = -(-plan.count * player.target.share // shares)
        numbers = range(plan.first, plan.first + count)
        size = min(BATCH, max(1, -(-count // plan.processes)))
        blocks = [numbers[k : k + size] for k in range(0, count, size)]
        rows += [((k + 1) / len(blocks), player, block) for k, block in enumerate(blocks)]
    rows.sort(key=lambda row: row[0])
    return deque((player, deque(block)) for _, player, block in rows)


def _start(player: Player, numbers: deque[int]) -> tuple[Connection, _Batch]:
    context = get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=player.run, args=(list(numbers), sender))
    process.start()
    sender.close()
    return receiver, _Batch(player, numbers, process, monotonic())
