"""MuJoCo's warnings: counted, and written neither to the terminal nor to a file.

MuJoCo has one log per process. By default it prints every warning and error, and appends it to
``MUJOCO_LOG.TXT`` in the working folder. Every module that compiles a model calls ``configure``,
and so does every block that simulates one, because dm_control sets a handler of its own, which
prints, when it is imported.
"""

import re
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import MappingProxyType

import mujoco

_TIME = re.compile(r" *Time = [^ ]*\.$")
_NUMBER = re.compile(r"\d+(\.\d+)?")
_counts: Counter[str] = Counter()


def configure() -> None:
    """Turns MuJoCo's log off, and counts its warnings, unless the program handles them itself."""
    handler = mujoco.get_mju_user_warning()
    if handler is not None and handler is not _handler_of_dm_control():
        return
    config = mujoco.MjLogConfig.get()
    config.logto_console = config.logto_file = False
    mujoco.MjLogConfig.set(config)
    mujoco.set_mju_user_warning(_count)


def _handler_of_dm_control() -> object:
    module = sys.modules.get("dm_control.mujoco.wrapper.core")
    return getattr(module, "_warning_callback", None)


def _count(message: str) -> None:
    # An exception would end the process: MuJoCo calls this function from C, in any thread.
    _counts[_NUMBER.sub("N", _TIME.sub("", message.strip()))] += 1


def mujoco_warnings() -> Mapping[str, int]:
    """Returns the number of each warning in this process; every number in the text is ``N``."""
    return MappingProxyType(dict(_counts))


@contextmanager
def uncounted_warnings() -> Iterator[None]:
    """Discards the warnings of a block that reports them by itself."""
    configure()
    before = Counter(_counts)
    try:
        yield
    finally:
        _counts.clear()
        _counts.update(before)
