"""Tasks for the tests of isolation: each runs in a child process."""

import os
import signal
import sys
import tempfile
import time
from pathlib import Path

from selfmodel.errors import InputError
from selfmodel.isolation import Message


def echo(request: Message) -> Message:
    """Prints, which must not reach the answer, and adds the temporary folder."""
    sys.stdout.write("noise\n")
    os.write(1, b"more noise")
    folder = tempfile.gettempdir()
    Path(folder, "left.over").touch()
    return Message({**request.header, "folder": folder}, request.buffers)


def crash(_: Message) -> Message:
    os.kill(os.getpid(), signal.SIGSEGV)
    return Message({})


def allocate(_: Message) -> Message:
    return Message({"bytes": len(bytearray(10**15))})


def loop(_: Message) -> Message:
    while True:
        pass


def wait(_: Message) -> Message:
    time.sleep(1000)
    return Message({})


def nest(request: Message) -> Message:
    return nest(request)


def refuse(_: Message) -> Message:
    raise InputError("walk.bag is damaged: record it again")


def fail(_: Message) -> Message:
    raise KeyError("a defect")
