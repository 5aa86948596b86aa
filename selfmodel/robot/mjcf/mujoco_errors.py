"""What MuJoCo says of a model, as one sentence."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import mujoco

from selfmodel.errors import InputError

FAILURES = (
    ValueError,
    KeyError,
    OverflowError,
    MemoryError,
    RuntimeError,  # "unknown exception": MuJoCo is out of memory
    mujoco.FatalError,
)
"""Everything that MuJoCo raises over a model that is none."""


@contextmanager
def told_by_mujoco() -> Iterator[None]:
    """Turns what MuJoCo raises into an ``InputError``, and keeps its warnings to itself.

    Raises:
        InputError: MuJoCo raised.
    """
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except FAILURES as error:
        if isinstance(error, InputError):
            raise
        said = " ".join(str(error).split()).removeprefix("Error: ")
        raise InputError(f"MuJoCo cannot load it: {said}") from error
    finally:
        mujoco.set_mju_user_warning(before)


def compiled(text: str, assets: dict[str, bytes]) -> mujoco.MjModel:
    """Returns the model that an MJCF describes.

    Raises:
        InputError: MuJoCo cannot load it.
    """
    with told_by_mujoco():
        return mujoco.MjModel.from_xml_string(text, assets)
