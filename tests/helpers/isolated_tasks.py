"""Tasks for the tests of isolation: each runs in a child process."""

import os
import signal
import sys
import tempfile
import time
from pathlib import Path

from selfmodel.errors import InputError
from selfmodel.isolation import Message
from selfmodel.logs import CorruptError


def echo(request: Message) -> Message:
    """Prints, which must not reach the answer."""
    sys.stdout.write("noise\n")
    os.write(1, b"more noise")
    return request


def crash(_: Message) -> Message:
    os.kill(os.getpid(), signal.SIGSEGV)
    return Message({})


def allocate(request: Message) -> Message:
    return Message({"bytes": len(bytearray(request.header["bytes"]))})


def loop(_: Message) -> Message:
    while True:
        pass


def wait(_: Message) -> Message:
    time.sleep(1000)
    return Message({})


def nest(request: Message) -> Message:
    return nest(request)


def refuse(_: Message) -> Message:
    raise InputError("no robot")


def refuse_log(_: Message) -> Message:
    raise CorruptError("walk.bag", "it is damaged", advice="record it again")


def fail(_: Message) -> Message:
    raise KeyError("a defect")


def scratch(_: Message) -> Message:
    folder = tempfile.gettempdir()
    Path(folder, "left.over").touch()
    return Message({"folder": folder})
