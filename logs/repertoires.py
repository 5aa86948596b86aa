"""Repertoire files: ``.npz`` archives of numpy arrays, without pickled objects.

The arrays of every file: ``controller`` (the bytes of a controller file: the design, with the best
genome), ``genomes`` (int8, hundredths), ``scores`` and ``descriptors`` (float64), ``origin`` (JSON:
robot, digest of its model, settings, seed, version) and ``sha256``, the digest of all others. The
digest detects damage; it is no signature.
"""

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from selfmodel.errors import InputError
from selfmodel.files import read_file
from selfmodel.logs.controllers import (
    check_types,
    controller_bytes,
    npz_bytes,
    npz_errors,
    parse_controller,
    read_arrays,
)
from selfmodel.logs.files import replace_file
from selfmodel.recovery.repertoire import Origin, Repertoire, model_digest

if TYPE_CHECKING:
    import selfmodel.robot.robot

MAX_BYTES = 2**28
"""Largest size of a repertoire file and of its arrays, bytes; 20,000 gaits of the hexapod have
under 4 MB."""

_TYPES: Mapping[str, str] = {
    "controller": "uint8 1",
    "genomes": "int8 2",
    "scores": "float64 1",
    "descriptors": "float64 2",
    "origin": "uint8 1",
    "sha256": "uint8 1",
}
"""Type and rank of each array."""


def repertoire_bytes(repertoire: Repertoire) -> bytes:
    """Returns a repertoire as the bytes of an ``.npz`` file; equal repertoires, equal bytes."""
    hundredths = np.rint(repertoire.genomes * 100)
    if not np.array_equal(hundredths / 100, repertoire.genomes):
        raise ValueError("expected genomes in hundredths, as a repertoire search returns them")
    arrays: dict[str, NDArray[Any]] = {
        "controller": _as_array(controller_bytes(repertoire.controller(0))),
        "genomes": hundredths.astype(np.int8),
        "scores": repertoire.scores,
        "descriptors": repertoire.descriptors,
        "origin": _as_array(json.dumps(dataclasses.asdict(repertoire.origin)).encode()),
    }
    return npz_bytes({**arrays, "sha256": _digest(arrays)}, np.savez_compressed)


def save_repertoire(path: Path, repertoire: Repertoire) -> None:
    """Writes a repertoire, or replaces the file."""
    replace_file(path, repertoire_bytes(repertoire))


def load_repertoire(path: Path, robot: "selfmodel.robot.robot.Robot | None" = None) -> Repertoire:
    """Returns the verified repertoire in a file, which must be of a robot if one is given.

    Raises:
        InputError: The file is no repertoire, is damaged, or is of another model.
    """
    repertoire = parse_repertoire(read_file(path, "a repertoire file", MAX_BYTES), str(path))
    if robot is not None:
        check_model(repertoire, robot, str(path))
    return repertoire


def check_model(repertoire: Repertoire, robot: "selfmodel.robot.robot.Robot", source: str) -> None:
    """Checks that a repertoire, of a file ``source``, is of the model of a robot."""
    if repertoire.origin.model != model_digest(robot):
        raise InputError(
            f"{source}: expected a repertoire of {robot.name} with the model "
            f"{model_digest(robot)[:12]}, got one of {repertoire.origin.robot} with the model "
            f"{repertoire.origin.model[:12]}: make a repertoire of this model with `selfmodel "
            f"repertoire make`"
        )


def parse_repertoire(data: bytes, source: str) -> Repertoire:
    """Returns the repertoire of bytes that ``repertoire_bytes`` made; errors name the source."""
    what = f"a repertoire (.npz with the arrays {', '.join(_TYPES)})"
    with npz_errors(source, what, "; make it anew with `selfmodel repertoire make`"):
        arrays = read_arrays(data, MAX_BYTES)
        check_types(arrays, _TYPES, lambda array: f"{array.dtype} {array.ndim}")
        given = {name: array for name, array in arrays.items() if name != "sha256"}
        if not np.array_equal(arrays["sha256"], _digest(given)):
            raise ValueError("its digest is wrong, so it was altered or damaged")
        best = parse_controller(arrays["controller"].tobytes(), source)
        genomes, scores, descriptors = (
            arrays[name] for name in ("genomes", "scores", "descriptors")
        )
        if not (np.isfinite(scores).all() and np.isfinite(descriptors).all()):
            raise ValueError("a score or a descriptor is not finite")
        if genomes.size and np.abs(genomes.astype(np.int16)).max() > 100:
            raise ValueError("a weight is outside of -1 to 1")
        origin = msgspec.json.decode(arrays["origin"].tobytes(), type=Origin)
        return Repertoire(best.design, genomes / 100, scores, descriptors, origin)


def _digest(arrays: Mapping[str, NDArray[Any]]) -> NDArray[np.uint8]:
    digest = hashlib.sha256()
    for name in sorted(arrays):
        array = arrays[name]
        # Digests have a fixed length, so that names, shapes and contents cannot be confused.
        for part in (f"{name} {array.dtype} {array.shape}".encode(), array.tobytes()):
            digest.update(hashlib.sha256(part).digest())
    return _as_array(digest.digest())


def _as_array(data: bytes) -> NDArray[np.uint8]:
    return np.frombuffer(data, dtype=np.uint8)
