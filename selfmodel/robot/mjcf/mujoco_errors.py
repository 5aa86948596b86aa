"""Compiles an MJCF, and converts MuJoCo's errors to ``InputError``."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import mujoco

from selfmodel.errors import InputError

MUJOCO_ERRORS = (
    ValueError,
    KeyError,
    OverflowError,
    RuntimeError,
    mujoco.FatalError,
)
"""Exceptions that MuJoCo raises for an invalid model."""

_OUT_OF_MEMORY = ("ould not allocate", "unknown exception")
"""Parts of MuJoCo's messages when it is out of memory; the second is a C++ ``bad_alloc``."""


@contextmanager
def mujoco_errors_as_input_errors(
    prefix: str = "MuJoCo cannot load the model: ",
) -> Iterator[None]:
    """Converts MuJoCo's exceptions to ``InputError``, and suppresses its warnings.

    Args:
        prefix: Beginning of the message.

    Raises:
        InputError: MuJoCo raised an exception.
        MemoryError: MuJoCo is out of memory.
    """
    handler = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except MUJOCO_ERRORS as error:
        if isinstance(error, InputError):
            raise
        message = " ".join(str(error).split()).removeprefix("Error: ")
        if any(phrase in message for phrase in _OUT_OF_MEMORY):
            raise MemoryError(message) from None
        raise InputError(f"{prefix}{message}") from error
    finally:
        mujoco.set_mju_user_warning(handler)


def compile_model(mjcf: str, assets: dict[str, bytes]) -> mujoco.MjModel:
    """Returns the compiled model of an MJCF.

    Raises:
        InputError: MuJoCo cannot compile the MJCF.
    """
    with mujoco_errors_as_input_errors():
        return mujoco.MjModel.from_xml_string(mjcf, assets)
