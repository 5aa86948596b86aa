"""Mutations of ``.npz`` files: arrays of other types, shapes and numbers, other archives."""

import io
import tokenize
import zipfile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.fuzz.mutate import data as raw
from tests.fuzz.mutate.numbers import number, packed, text

Arrays = dict[str, NDArray[Any]]

_UNREADABLE = (ValueError, EOFError, SyntaxError, tokenize.TokenError, zipfile.BadZipFile)
"""Exceptions of numpy and zipfile for an archive that was damaged before."""


def mutated(data: bytes, rng: np.random.Generator) -> tuple[bytes, str]:
    """Returns an archive with one or two mutations, and their names."""
    kind = rng.random()
    if kind < 0.15:
        return raw.mutated(data, rng)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = {info.filename: archive.read(info) for info in archive.infolist()}
        arrays = {name: np.load(io.BytesIO(content)) for name, content in members.items()}
    except _UNREADABLE:  # an earlier mutation
        return raw.mutated(data, rng)
    if kind < 0.4:
        return _packed(*_member_changed(members, rng), rng)
    names = [_changed(arrays, rng) for _ in range(int(rng.choice([1, 1, 1, 2])))]
    return _packed({name: _npy(array) for name, array in arrays.items()}, ", ".join(names), rng)


def _packed(members: dict[str, bytes], name: str, rng: np.random.Generator) -> tuple[bytes, str]:
    file = io.BytesIO()
    packing = zipfile.ZIP_DEFLATED if rng.random() < 0.2 else zipfile.ZIP_STORED
    with zipfile.ZipFile(file, "w", packing) as archive:
        for member, content in members.items():
            archive.writestr(zipfile.ZipInfo(member), content, packing)
    return file.getvalue(), name


def _npy(array: NDArray[Any]) -> bytes:
    file = io.BytesIO()
    np.lib.format.write_array(file, array, version=(1, 0), allow_pickle=False)
    return file.getvalue()


def _member_changed(
    members: dict[str, bytes], rng: np.random.Generator
) -> tuple[dict[str, bytes], str]:
    """Changes the bytes of a member, of its header in most cases."""
    name = str(rng.choice(sorted(members)))
    content = members[name]
    kind = int(rng.integers(6))
    if kind == 0:
        new = {**members, name: raw.mutated(content, rng)[0]}
    elif kind == 1:
        new = {**members, text(rng) or "x": content}
    elif kind == 2:
        new = {key: held for key, held in members.items() if key != name}
    elif kind == 3:
        new = {**members, name: bytes(int(rng.choice([10**5, 3 * 10**6])))}
    else:
        header = bytearray(content)
        at = int(rng.integers(6, min(len(content), 128)))
        new_bytes = rng.choice([b"'", b"(", b",", b"9", b"O", b"{", b"\\", b"\n", packed(rng)])
        header[at : at + len(new_bytes)] = bytes(new_bytes)
        new = {**members, name: bytes(header)}
    return new, f"{name}: kind {kind}"


def _changed(arrays: Arrays, rng: np.random.Generator) -> str:
    name = str(rng.choice(sorted(arrays)))
    array = arrays[name]
    kind = int(rng.choice([0, 1, 2, 3, 3, 3, 3, 4, 5, 6]))
    if kind == 0:
        kinds = ["<f4", "<i8", "<u1", "U3", "S4", "?", "<c16", "<M8[s]", ">f8", "<f2"]
        try:
            arrays[name] = array.astype(str(rng.choice(kinds)))
        except (ValueError, TypeError, OverflowError):
            arrays[name] = np.zeros(3)
        return f"{name} as {arrays[name].dtype}"
    if kind == 1:
        shape = tuple(int(n) for n in rng.choice([0, 1, 2, 3], size=int(rng.integers(0, 4))))
        arrays[name] = np.resize(array, shape) if array.size else np.zeros(shape)
        return f"{name} of shape {shape}"
    if kind == 2:
        count = max(0, array.size + int(rng.integers(-2, 3)))
        arrays[name] = np.resize(array, count) if array.size else np.zeros(count)
        return f"{name} of {count}"
    if kind == 3 and array.size:
        new = np.asfortranarray(array.copy()) if rng.random() < 0.2 else array.copy()
        flat = new.reshape(-1)
        with np.errstate(all="ignore"):
            try:
                flat[rng.integers(flat.size)] = text(rng) if new.dtype.kind == "U" else number(rng)
            except (ValueError, OverflowError):
                return f"{name} as it was"
        arrays[name] = flat.reshape(array.shape)
        return f"{name} with another value"
    if kind == 4:
        arrays[name] = np.array([text(rng) for _ in range(int(rng.integers(0, 6)))], dtype=np.str_)
        return f"{name} of texts"
    if kind == 5:
        other = str(rng.choice(["ranges.npy", "kind.npy", "hidden.npy", "timestep.npy", "x.npy"]))
        arrays[other] = array
        return f"{other} is {name}"
    arrays[name] = np.array(number(rng), dtype=np.float64)
    return f"{name} = {arrays[name]}"
