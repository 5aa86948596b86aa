"""Controllers as ``.npz`` files: numpy arrays and nothing that could run.

The arrays: ``kind``, ``sensors`` and ``motors`` (names) and ``genome`` (float64); of the kind
"network" also ``hidden`` (a count), of the kind "cpg" also ``timestep`` (s). Where motors have
other command ranges than the paper's, also ``ranges`` (float64, by motor the centre and half the
range).
"""

import io
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selfmodel.controllers.command_range import checked_ranges
from selfmodel.controllers.cpg import Cpg
from selfmodel.controllers.driver import Design, Evolved
from selfmodel.controllers.network import Network
from selfmodel.errors import InputError
from selfmodel.files import read_file
from selfmodel.logs.errors import LogWriteError

LARGEST = 2**20
"""Bytes that a controller may have: the paper's have under 3,000."""

_TYPES: Mapping[str, tuple[str, int]] = MappingProxyType(
    {
        "kind": ("U", 0),
        "sensors": ("U", 1),
        "motors": ("U", 1),
        "hidden": ("i", 0),
        "timestep": ("f", 0),
        "genome": ("f", 1),
        "ranges": ("f", 2),
    }
)
"""Of every array the type and the rank."""

_ARRAYS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "network": ("kind", "sensors", "motors", "hidden", "genome"),
        "cpg": ("kind", "sensors", "motors", "timestep", "genome"),
    }
)
"""Of each kind the arrays, in their order; ``ranges`` may follow."""


def save_controller(path: Path, controller: Evolved) -> None:
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


def load_controller(path: Path) -> Evolved:
    """Returns the controller in a file.

    Raises:
        InputError: There is none; the message names the file.
    """
    return parse_controller(read_file(path, "a controller file", LARGEST), str(path))


def controller_bytes(controller: Evolved) -> bytes:
    """Returns a controller as the bytes of an ``.npz`` file; equal controllers, equal bytes."""
    design = controller.design
    own: dict[str, NDArray[Any]] = (
        {"kind": np.array("network"), "hidden": np.array(design.hidden, dtype=np.int64)}
        if isinstance(design, Network)
        else {"kind": np.array("cpg"), "timestep": np.array(design.timestep)}
    )
    arrays = {
        "sensors": np.array(design.sensors, dtype=np.str_),
        "motors": np.array(design.motors, dtype=np.str_),
        "genome": controller.genome,
        **own,
    }
    ordered = {name: arrays[name] for name in _ARRAYS[str(own["kind"])]}
    if design.ranges != checked_ranges(design.motors, ()):
        ordered["ranges"] = np.array(design.ranges)
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **ordered)
    return file.getvalue()


def parse_controller(data: bytes, source: str) -> Evolved:
    """Returns the controller that ``controller_bytes`` was given.

    Args:
        data: The bytes of an ``.npz`` file.
        source: Where they come from, for the error.

    Raises:
        InputError: They are not a controller.
    """
    try:
        arrays = _arrays(data)
        return _design(arrays).controller(arrays["genome"])
    except _FAILURES as failure:
        raise InputError(
            f"{source}: expected a controller (.npz with the arrays "
            f"{', '.join(_ARRAYS['network'])}, or those of a CPG): "
            f"{failure or type(failure).__name__}"
        ) from failure


def _design(arrays: Mapping[str, NDArray[Any]]) -> Design:
    sensors, motors = (tuple(arrays[name].tolist()) for name in ("sensors", "motors"))
    ranges = tuple(
        (float(centre), float(half)) for centre, half in arrays.get("ranges", np.empty((0, 2)))
    )
    if "hidden" in arrays:
        return Network(sensors, motors, int(arrays["hidden"]), ranges)
    return Cpg(sensors, motors, float(arrays["timestep"]), ranges)


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
        if sum(info.file_size for info in members.values()) > LARGEST:
            raise ValueError(f"it unpacks to more than {LARGEST} bytes")
        kind = _kind(archive) if "kind.npy" in members else "network"
        expected = _ARRAYS[kind] + (("ranges",) if "ranges.npy" in members else ())
        names = {f"{name}.npy" for name in expected}
        if set(members) != names or len(archive.infolist()) != len(names):
            raise ValueError(f"it holds {', '.join(sorted(members)) or 'nothing'}")
        found = {name: _array(archive.read(f"{name}.npy")) for name in expected}
    types = {name: array.dtype.kind for name, array in found.items()}
    ranks = {name: array.ndim for name, array in found.items()}
    if types != {name: _TYPES[name][0] for name in expected}:
        raise ValueError(f"its arrays have the types {types}")
    if ranks != {name: _TYPES[name][1] for name in expected}:
        raise ValueError(f"its arrays have the ranks {ranks}")
    for name, array in found.items():
        if array.dtype.kind == "f" and array.dtype != np.float64:
            raise ValueError(f"its {name} is {array.dtype}, expected float64")
    return found


def _kind(archive: zipfile.ZipFile) -> str:
    kind = str(_array(archive.read("kind.npy")))
    if kind not in _ARRAYS:
        raise ValueError(f"expected the kind {' or '.join(map(repr, _ARRAYS))}, got {kind!r}")
    return kind


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
