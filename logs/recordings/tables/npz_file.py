"""Reader of NPZ files: arrays of numpy by name, without pickled objects.

An array ``(rows,)`` is a column. An array ``(rows, n)`` is n columns, called by the array's name
and a label: those of an array of n texts, such as ``joint_names``, or numbers from 0.
"""

import warnings
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import prod
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from selfmodel.errors import InputError
from selfmodel.logs.npz import NPZ_FAILURES
from selfmodel.logs.recordings.tables.content import (
    MAX_COLUMNS,
    Content,
    Numbers,
    Request,
    as_numbers,
    reason_of,
)


@dataclass(frozen=True)
class _Member:
    """Array of an archive, by its header."""

    file: str
    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    @property
    def name(self) -> str:
        return self.file.removesuffix(".npy")


def read_npz(request: Request) -> Content:
    """Returns the wanted columns of an NPZ file.

    Raises:
        InputError: The file is no NPZ file.
        OSError: The file cannot be read.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Python's, for a header that is a damaged literal
            with zipfile.ZipFile(request.path) as archive:
                return _content(request, archive)
    except InputError:
        raise
    except NPZ_FAILURES as failure:
        raise InputError(
            f"{request.path}: expected an NPZ file of arrays of numbers, got: "
            f"{reason_of(failure)}: write it again with numpy.savez"
        ) from failure


def _content(request: Request, archive: zipfile.ZipFile) -> Content:
    members = [_member(archive, info) for info in archive.infolist()]
    found = [member for member in members if member is not None]
    texts = {m.name: _read(archive, m) for m in found if _is_text(m)}
    labels = {name: tuple(map(str, array.tolist())) for name, array in texts.items()}
    numeric = [m for m in found if m.dtype.kind in "fiubmM" and m.shape and len(m.shape) <= 2]
    if sum(m.shape[1] if len(m.shape) == 2 else 1 for m in numeric) > MAX_COLUMNS:
        raise InputError(f"{request.path} has more than {MAX_COLUMNS} columns")
    named = [(member, _names(member, labels)) for member in numeric]
    names = [name for _, some in named for name in some]
    request.check_names(names)
    needed = [(m, some) for m, some in named if not request.wanted.isdisjoint(some)]
    columns: dict[str, Numbers] = {}
    for member, some in needed:
        array = _read(archive, member).reshape(member.shape[0], prod(member.shape[1:]))
        for k, name in enumerate(some):
            if name in request.wanted:
                columns[name] = as_numbers(array[:, k], exact=name == request.exact)
    return Content(names, columns)


def _member(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> _Member | None:
    """Header of an array; None for a file of another kind."""
    if not info.filename.endswith(".npy"):
        return None
    with archive.open(info) as file:
        return _Member(info.filename, *_header(file))


def _header(file: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = npy.read_magic(file)
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, _, dtype = read(file)
    if any(length < 0 for length in shape):
        raise ValueError(f"an array of the shape {shape}")
    return shape, dtype


def _is_text(member: _Member) -> bool:
    few = len(member.shape) == 1 and member.shape[0] <= MAX_COLUMNS
    return few and member.dtype.kind == "U" and member.dtype.itemsize <= 4 * 1000


def _read(archive: zipfile.ZipFile, member: _Member) -> NDArray[Any]:
    with archive.open(member.file) as file:
        array: NDArray[Any] = npy.read_array(file, allow_pickle=False)
        if file.read(1):  # reads to the end, where zipfile compares the checksum
            raise ValueError(f"bytes follow the array {member.name}")
    return array


def _names(member: _Member, labels: Mapping[str, Sequence[str]]) -> tuple[str, ...]:
    if len(member.shape) == 1:
        return (member.name,)
    width = member.shape[1]
    fitting = [(name, some) for name, some in labels.items() if len(some) == width]
    own = [some for name, some in fitting if name.startswith(member.name)]
    known = set(own or [some for _, some in fitting])
    if len(known) == 1:
        return tuple(f"{member.name}.{label}" for label in known.pop())
    return tuple(f"{member.name}.{k}" for k in range(width))
