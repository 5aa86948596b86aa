"""Controller files: ``.npz`` archives of numpy arrays, without pickled objects.

The arrays of every file: ``kind`` (the name of the design), ``sensors`` and ``motors`` (names), the
design's own arrays (``KINDS``: ``hidden``, a count, of a network; ``timestep``, s, of a CPG) and
``genome`` (float64). Controllers whose command ranges differ from the paper's also have ``ranges``
(float64, centre and half width per motor).
"""

import io
import warnings
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selfmodel.controllers.controller import Controller, Design, Ranges, checked_ranges
from selfmodel.controllers.cpg import Cpg
from selfmodel.controllers.network import Network
from selfmodel.errors import InputError
from selfmodel.files import read_file
from selfmodel.logs.files import create_file
from selfmodel.logs.npz import NPZ_FAILURES, read_array

MAX_CONTROLLER_BYTES = 2**20
"""Largest size of a controller file, bytes; those of the paper's robots are under 3,000."""

Arrays = Mapping[str, NDArray[Any]]
"""Arrays of a controller file, by name."""

_COMMON: Mapping[str, tuple[str, int]] = MappingProxyType(
    {"kind": ("U", 0), "sensors": ("U", 1), "motors": ("U", 1), "genome": ("f", 1)}
)
"""Type code and rank of the arrays of every controller file."""

_RANGES = ("f", 2)
"""Type code and rank of the optional array ``ranges``."""


@dataclass(frozen=True)
class KindFormat:
    """Format of the arrays of one kind of design.

    Attributes:
        arrays: Type code and rank of the design's own arrays, by name, in the order of the file.
        write: Function from a design of the kind to its own arrays.
        read: Function from sensors, motors, command ranges and the arrays of a file to the design.
    """

    arrays: Mapping[str, tuple[str, int]]
    write: Callable[[Any], Arrays]
    read: Callable[[tuple[str, ...], tuple[str, ...], Ranges, Arrays], Design]

    @property
    def types(self) -> dict[str, tuple[str, int]]:
        """Type code and rank of all required arrays, by name, in the order of the file."""
        return {
            **{name: _COMMON[name] for name in ("kind", "sensors", "motors")},
            **self.arrays,
            "genome": _COMMON["genome"],
        }


def _write_network(design: Network) -> Arrays:
    return {"hidden": np.array(design.hidden, dtype=np.int64)}


def _read_network(
    sensors: tuple[str, ...], motors: tuple[str, ...], ranges: Ranges, arrays: Arrays
) -> Network:
    return Network(sensors, motors, int(arrays["hidden"]), ranges)


def _write_cpg(design: Cpg) -> Arrays:
    return {"timestep": np.array(design.timestep)}


def _read_cpg(
    sensors: tuple[str, ...], motors: tuple[str, ...], ranges: Ranges, arrays: Arrays
) -> Cpg:
    return Cpg(sensors, motors, float(arrays["timestep"]), ranges)


KINDS: Mapping[str, KindFormat] = MappingProxyType(
    {
        Network.name: KindFormat({"hidden": ("i", 0)}, _write_network, _read_network),
        Cpg.name: KindFormat({"timestep": ("f", 0)}, _write_cpg, _read_cpg),
    }
)
"""Format of each kind of design, by its name."""


def save_controller(path: Path, controller: Controller) -> None:
    """Writes a controller to a new file.

    Raises:
        InputError: The file exists.
        LogWriteError: The file could not be written.
    """
    with create_file(path) as file:
        file.write(controller_bytes(controller))


def load_controller(path: Path) -> Controller:
    """Returns the controller in a file.

    Raises:
        InputError: The file contains no controller; the message names the file.
    """
    return parse_controller(read_file(path, "a controller file", MAX_CONTROLLER_BYTES), str(path))


def controller_bytes(controller: Controller) -> bytes:
    """Returns a controller as the bytes of an ``.npz`` file; equal controllers, equal bytes."""
    design = controller.design
    kind = KINDS[design.name]
    arrays: dict[str, NDArray[Any]] = {
        "kind": np.array(design.name),
        "sensors": np.array(design.sensors, dtype=np.str_),
        "motors": np.array(design.motors, dtype=np.str_),
        **kind.write(design),
        "genome": controller.genome,
    }
    if design.ranges != checked_ranges(design.motors, ()):
        arrays["ranges"] = np.array(design.ranges)
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **arrays)
    return file.getvalue()


def parse_controller(data: bytes, source: str) -> Controller:
    """Returns the controller of bytes that ``controller_bytes`` made.

    Args:
        data: The bytes of an ``.npz`` file.
        source: Name of the file, for the error message.

    Raises:
        InputError: The bytes are not a controller file.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # Python's, for a header that is a damaged literal
            arrays = _arrays(data)
        return Controller(_design(arrays), arrays["genome"])
    except _FAILURES as failure:
        raise InputError(
            f"{source}: expected a controller (.npz with the arrays "
            f"{', '.join(KINDS['network'].types)}, or those of a CPG): "
            f"{failure or type(failure).__name__}"
        ) from failure


def _design(arrays: Arrays) -> Design:
    sensors, motors = (tuple(arrays[name].tolist()) for name in ("sensors", "motors"))
    ranges = tuple(
        (float(centre), float(half)) for centre, half in arrays.get("ranges", np.empty((0, 2)))
    )
    return KINDS[str(arrays["kind"])].read(sensors, motors, ranges, arrays)


_FAILURES = (*NPZ_FAILURES, MemoryError, Warning)
"""Exceptions of malformed bytes, and of a genome that does not fit."""


def _arrays(data: bytes) -> dict[str, NDArray[Any]]:
    if len(data) > MAX_CONTROLLER_BYTES:
        raise ValueError(f"it has more than {MAX_CONTROLLER_BYTES} bytes")
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {info.filename: info for info in archive.infolist()}
        if sum(info.file_size for info in members.values()) > MAX_CONTROLLER_BYTES:
            raise ValueError(f"it unpacks to more than {MAX_CONTROLLER_BYTES} bytes")
        kind = _kind(archive) if "kind.npy" in members else "network"
        expected = KINDS[kind].types | ({"ranges": _RANGES} if "ranges.npy" in members else {})
        names = {f"{name}.npy" for name in expected}
        if set(members) != names or len(archive.infolist()) != len(names):
            raise ValueError(f"it holds {', '.join(sorted(members)) or 'nothing'}")
        found = {name: read_array(archive.read(f"{name}.npy")) for name in expected}
    types = {name: array.dtype.kind for name, array in found.items()}
    ranks = {name: array.ndim for name, array in found.items()}
    if types != {name: type_code for name, (type_code, _) in expected.items()}:
        raise ValueError(f"its arrays have the types {types}")
    if ranks != {name: rank for name, (_, rank) in expected.items()}:
        raise ValueError(f"its arrays have the ranks {ranks}")
    for name, array in found.items():
        if array.dtype.kind == "f" and array.dtype != np.float64:
            raise ValueError(f"its {name} is {array.dtype}, expected float64")
    return found


def _kind(archive: zipfile.ZipFile) -> str:
    kind = str(read_array(archive.read("kind.npy")))
    if kind not in KINDS:
        raise ValueError(f"expected the kind {' or '.join(map(repr, KINDS))}, got {kind!r}")
    return kind
