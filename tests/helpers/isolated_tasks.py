"""Tasks for the tests of isolation: each is one thing that a child process may do."""

import ctypes
import os
import resource
import socket
import stat
from pathlib import Path

from selfmodel.errors import InputError
from selfmodel.logs.errors import CorruptError
from selfmodel.sandbox.budget import Budget
from selfmodel.sandbox.message import Message


def echo(message: Message, _: Budget, __: Path) -> Message:
    return Message({"facts": dict(message.facts)}, message.blobs)


def allocate(message: Message, _: Budget, __: Path) -> Message:
    return Message({"bytes": len(bytearray(message.facts["bytes"]))})


def loop(_: Message, __: Budget, ___: Path) -> Message:
    while True:
        pass


def cpu_limit(_: Message, __: Budget, ___: Path) -> Message:
    return Message({"seconds": resource.getrlimit(resource.RLIMIT_CPU)[0]})


def wait(_: Message, __: Budget, ___: Path) -> Message:
    left, right = socket.socketpair()
    with left, right:
        left.recv(1)  # for ever
    return Message({})


def crash(_: Message, __: Budget, ___: Path) -> Message:
    ctypes.string_at(0)
    return Message({})


def refuse(_: Message, __: Budget, ___: Path) -> Message:
    raise InputError("expected a robot, got a chair")


def refuse_log(_: Message, __: Budget, ___: Path) -> Message:
    raise CorruptError("a.mcap", "it is damaged", advice="make it again")


def fail(_: Message, __: Budget, ___: Path) -> Message:
    raise ZeroDivisionError("a mistake")


def nest(_: Message, __: Budget, ___: Path) -> Message:
    def deeper() -> None:
        deeper()

    deeper()
    return Message({})


def write(message: Message, _: Budget, scratch: Path) -> Message:
    (scratch / "own").write_text("allowed")
    results = []
    for path in map(Path, message.facts["paths"]):
        try:
            path.write_text("changed")
            results.append("changed")
        except OSError as error:
            results.append(type(error).__name__)
    return Message({"results": results})


def fill_disk(message: Message, _: Budget, scratch: Path) -> Message:
    with (scratch / "big").open("wb") as file:
        file.truncate(message.facts["bytes"])
    return Message({})


def answer(message: Message, _: Budget, __: Path) -> Message:
    return Message({"text": "x" * message.facts["characters"]})


def sockets(_: Message, __: Budget, ___: Path) -> Message:
    found = 0
    for descriptor in range(64):
        try:
            found += stat.S_ISSOCK(os.fstat(descriptor).st_mode)
        except OSError:
            continue
    return Message({"sockets": found})
