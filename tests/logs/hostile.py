"""What the tests of hostile logs share: a child process whose memory and time are measured."""

import multiprocessing
import resource
import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection

from selfmodel.logs import LogError
from selfmodel.sandbox.limits import address_space

MEMORY = 3 * 2**30
"""Bytes of address space beyond those of the test process, which libraries make large."""
SECONDS = 5.0
WALL_SECONDS = 120.0
MEGABYTES = 1000


@dataclass(frozen=True)
class Outcome:
    """How a call in a child ended.

    Attributes:
        error: The sentence of its ``LogError``, or "".
        seconds: How much processor time it took.
        megabytes: By how much the child's memory grew at most.
    """

    error: str
    seconds: float
    megabytes: float


def outcome(call: Callable[[], object]) -> Outcome:
    """Returns how a call ends in a child, which must be well, or with a ``LogError``."""
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    child = context.Process(target=_run, args=(call, sender))
    child.start()
    sender.close()
    try:
        assert receiver.poll(WALL_SECONDS), "it takes for ever"
        found: Outcome = receiver.recv()
    finally:
        child.kill()
        child.join()
    assert found.seconds < SECONDS, found
    assert found.megabytes < MEGABYTES, found
    return found


def _run(call: Callable[[], object], sender: Connection) -> None:
    limit = (address_space() or 0) + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start, error = time.process_time(), ""
    try:
        call()
    except LogError as failure:
        error = str(failure)
    seconds = time.process_time() - start
    growth = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    sender.send(Outcome(error, seconds, growth / 1000))
