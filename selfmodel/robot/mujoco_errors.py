"""MuJoCo's warnings, which are counted and not printed, and its errors as ``InputError``.

MuJoCo has one log per process. By default it prints every warning and error, and appends it to
``MUJOCO_LOG.TXT`` in the working folder. Every module that compiles a model calls ``configure``,
and so does every block that simulates one, because dm_control sets a handler of its own, which
prints, when it is imported.
"""

import re
import sys
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import mujoco

from selfmodel.errors import InputError

MUJOCO_ERRORS = (
    ValueError,
    KeyError,
    OverflowError,
    MemoryError,
    RuntimeError,  # "unknown exception": MuJoCo is out of memory
    mujoco.FatalError,
)
"""Exceptions that MuJoCo raises for a model that it cannot compile or simulate."""

_OUT_OF_MEMORY = ("ould not allocate", "unknown exception")
"""Parts of MuJoCo's messages when it is out of memory; the second is a C++ ``bad_alloc``."""

_TIME, _NUMBER = re.compile(r" *Time = [^ ]*\.$"), re.compile(r"\d+(\.\d+)?")
_counts: Counter[str] = Counter()


def configure() -> None:
    """Turns MuJoCo's log off, and counts its warnings, unless the program handles them itself."""
    handler = mujoco.get_mju_user_warning()
    dm_control = sys.modules.get("dm_control.mujoco.wrapper.core")
    if handler is not None and handler is not getattr(dm_control, "_warning_callback", None):
        return
    config = mujoco.MjLogConfig.get()
    config.logto_console = config.logto_file = False
    mujoco.MjLogConfig.set(config)
    mujoco.set_mju_user_warning(_count)


def _count(message: str) -> None:
    # An exception would end the process: MuJoCo calls this function from C, in any thread.
    _counts[_NUMBER.sub("N", _TIME.sub("", message.strip()))] += 1


configure()


def mujoco_warnings() -> Mapping[str, int]:
    """Returns the number of each warning in this process; every number in the text is ``N``."""
    return dict(_counts)


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


@contextmanager
def mujoco_errors_as_input_errors(task: str) -> Iterator[None]:
    """Converts MuJoCo's exceptions at a task, such as ``"load the model"``, to ``InputError``."""
    configure()
    try:
        yield
    except InputError:
        raise
    except MUJOCO_ERRORS as error:
        message = " ".join(str(error).split()).removeprefix("Error: ")
        if isinstance(error, MemoryError) or any(part in message for part in _OUT_OF_MEMORY):
            message = "for lack of memory: make the model smaller"
            raise InputError(f"MuJoCo cannot {task}, {message}") from error
        raise InputError(f"MuJoCo cannot {task}: {message}") from error


@contextmanager
def loading_a_model() -> Iterator[None]:
    """Converts MuJoCo's exceptions to ``InputError``, and suppresses its warnings."""
    with (
        mujoco_errors_as_input_errors("load the model"),
        uncounted_warnings(),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore")
        yield


def compile_model(mjcf: str, assets: dict[str, bytes]) -> mujoco.MjModel:
    """Returns the compiled model of an MJCF, or raises ``InputError``."""
    with loading_a_model():
        return mujoco.MjModel.from_xml_string(mjcf, assets)
