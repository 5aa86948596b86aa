"""Converts MuJoCo's errors to ``InputError``, and compiles an MJCF."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import mujoco

from selfmodel.errors import InputError
from selfmodel.robot.mujoco_log import configure, uncounted_warnings
from selfmodel.sandbox.budget import BudgetError

configure()

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


@contextmanager
def mujoco_errors_as_input_errors(task: str) -> Iterator[None]:
    """Converts MuJoCo's exceptions to ``InputError``.

    Args:
        task: Task that MuJoCo fails at, such as ``"load the model"``, for the message.

    Raises:
        InputError: MuJoCo raised an exception.
        BudgetError: MuJoCo is out of memory.
    """
    configure()
    try:
        yield
    except MUJOCO_ERRORS as error:
        if isinstance(error, InputError):
            raise
        message = " ".join(str(error).split()).removeprefix("Error: ")
        if isinstance(error, MemoryError) or any(part in message for part in _OUT_OF_MEMORY):
            raise BudgetError(
                f"MuJoCo cannot {task}, for lack of memory: to go on, raise the memory with "
                f"--budget memory=..."
            ) from error
        raise InputError(f"MuJoCo cannot {task}: {message}") from error


@contextmanager
def loading_a_model() -> Iterator[None]:
    """Converts MuJoCo's exceptions to ``InputError``, and suppresses its warnings.

    Raises:
        InputError: MuJoCo raised an exception.
    """
    with (
        mujoco_errors_as_input_errors("load the model"),
        uncounted_warnings(),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore")
        yield


def compile_model(mjcf: str, assets: dict[str, bytes]) -> mujoco.MjModel:
    """Returns the compiled model of an MJCF.

    Raises:
        InputError: MuJoCo cannot compile the MJCF.
    """
    with loading_a_model():
        return mujoco.MjModel.from_xml_string(mjcf, assets)
