"""Controllers as ``.npz`` files: numpy arrays and nothing that could run.

The arrays: ``kind`` ("network"), ``sensors`` and ``motors`` (names), ``hidden`` (a count) and
``genome`` (float64).
"""

import io
import struct
import tokenize
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selfmodel.controller import Controller, Network
from selfmodel.errors import InputError
from selfmodel.logs.errors import LogWriteError
from selfmodel.logs.files import read_bounded

LARGEST = 2**20
"""Bytes that a controller may have: the paper's have under 3,000."""

_KIND = "network"
_ARRAYS = ("kind", "sensors", "motors", "hidden", "genome")


def save_controller(path: Path, controller: Controller) -> None:
    """Writes a controller to a file that does not exist yet.

    Raises:
        InputError: The file exists.
        LogWriteError: It could not be written.
    """
    try:
        with path.open("xb") as file:
            file.write(controller_bytes(controller))
    except FileExistsError:
        raise InputError(f"{path} exists, and is not overwritten: choose another name") from None
    except OSError as error:
        raise LogWriteError(path, error) from error


def load_controller(path: Path) -> Controller:
    """Returns the controller in a file.

    Raises:
        InputError: There is none; the message names the file.
    """
    return parse_controller(read_bounded(path, "a controller file", LARGEST), str(path))


def controller_bytes(controller: Controller) -> bytes:
    """Returns a controller as the bytes of an ``.npz`` file; equal controllers, equal bytes."""
    file = io.BytesIO()
    np.savez(
        file,
        allow_pickle=False,
        kind=np.array(_KIND),
        sensors=np.array(controller.network.sensors, dtype=np.str_),
        motors=np.array(controller.network.motors, dtype=np.str_),
        hidden=np.array(controller.network.hidden, dtype=np.int64),
        genome=controller.genome,
    )
    return file.getvalue()


def parse_controller(data: bytes, source: str) -> Controller:
    """Returns the controller that ``controller_bytes`` was given.

    Args:
        data: The bytes of an ``.npz`` file.
        source: Where they come from, for the error.

    Raises:
        InputError: They are not a controller.
    """
    try:
        arrays = _arrays(data)
        network = Network(
            sensors=tuple(arrays["sensors"].tolist()),
            motors=tuple(arrays["motors"].tolist()),
            hidden=int(arrays["hidden"]),
        )
        return Controller(network, arrays["genome"])
    except _FAILURES as failure:
        raise InputError(
            f"{source}: expected a controller (.npz with the arrays {', '.join(_ARRAYS)}): "
            f"{failure or type(failure).__name__}"
        ) from failure


_FAILURES = (
    ValueError,  # numpy's headers, and a genome that does not fit
    TypeError,
    KeyError,
    EOFError,
    MemoryError,
    RuntimeError,  # an encrypted file, or an unknown compression
    OverflowError,
    SyntaxError,
    tokenize.TokenError,  # numpy's headers are Python literals
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
)
"""Everything that zipfile and numpy raise over bytes that are not what they expect."""


def _arrays(data: bytes) -> dict[str, NDArray[Any]]:
    if len(data) > LARGEST:
        raise ValueError(f"it has more than {LARGEST} bytes")
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {info.filename: info for info in archive.infolist()}
        expected = {f"{name}.npy" for name in _ARRAYS}
        if set(members) != expected or len(archive.infolist()) != len(expected):
            raise ValueError(f"it holds {', '.join(sorted(members)) or 'nothing'}")
        if sum(info.file_size for info in members.values()) > LARGEST:
            raise ValueError(f"it unpacks to more than {LARGEST} bytes")
        found = {name: _array(archive.read(f"{name}.npy")) for name in _ARRAYS}
    types = {name: array.dtype.kind for name, array in found.items()}
    ranks = {name: array.ndim for name, array in found.items()}
    if types != {"kind": "U", "sensors": "U", "motors": "U", "hidden": "i", "genome": "f"}:
        raise ValueError(f"its arrays have the types {types}")
    if found["genome"].dtype != np.float64:
        raise ValueError(f"its genome is {found['genome'].dtype}, expected float64")
    if ranks != {"kind": 0, "sensors": 1, "motors": 1, "hidden": 0, "genome": 1}:
        raise ValueError(f"its arrays have the ranks {ranks}")
    if str(found["kind"]) != _KIND:
        raise ValueError(f"expected the kind {_KIND!r}, got {str(found['kind'])!r}")
    return found


def _array(data: bytes) -> NDArray[Any]:
    """Reads an ``.npy``; its header is held against its size before anything is allocated."""
    file = io.BytesIO(data)
    if np.lib.format.read_magic(file) != (1, 0):
        raise ValueError("it has arrays of another version than 1.0")
    shape, _, dtype = np.lib.format.read_array_header_1_0(file)
    count = 1
    for length in shape:
        count *= length
    if dtype.hasobject or dtype.itemsize * count != len(data) - file.tell():
        raise ValueError(f"an array of shape {shape} and type {dtype} does not fit its size")
    file.seek(0)
    array: NDArray[Any] = np.lib.format.read_array(file, allow_pickle=False)
    return array
