"""Use of the sandbox's child processes by one case: their time, their memory and how they ended."""

import signal
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any
from unittest import mock

from selfmodel.sandbox import isolation
from selfmodel.sandbox.message import Message


@dataclass
class ChildUse:
    """Use of the child processes so far.

    Attributes:
        seconds: CPU time of all of them, s.
        megabytes: Largest growth of the address space of one of them, 10^6 bytes.
        problem: Report of the first that crashed, waited too long, or raised an error that is not
            declared; "" without one.
    """

    seconds: float = 0.0
    megabytes: float = 0.0
    problem: str = ""

    def add(self, answer: Message | None, ended: Mapping[str, Any]) -> None:
        """Counts a child process.

        Args:
            answer: Its answer; None if it ended without.
            ended: Its exit status and CPU time, from the server.
        """
        self.seconds += ended["seconds"]
        problem = ""
        if answer is not None:
            self.megabytes = max(self.megabytes, answer.facts["peak"] / 1e6)
            problem = answer.facts["message"] if answer.facts.get("error") == "" else ""
        elif ended["status"] != -signal.SIGXCPU:  # the limit of the budget is no crash
            problem = f"a child process ended with {_name(ended['status'])}"
        self.problem = self.problem or problem


@contextmanager
def child_use() -> Iterator[ChildUse]:
    """Context manager that yields the use of the child processes within it."""
    use = ChildUse()
    call = isolation._Server.call

    def counted(*arguments: object) -> tuple[Message | None, Mapping[str, Any]]:
        answer, ended = call(*arguments)  # type: ignore[arg-type]  # they are passed on
        use.add(answer, ended)
        return answer, ended

    with mock.patch.object(isolation._Server, "call", counted):
        yield use


def _name(status: int) -> str:
    return signal.Signals(-status).name if status < 0 else f"status {status}"
