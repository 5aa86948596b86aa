"""Controller files: ``.npz`` archives of numpy arrays, without pickled objects.

The arrays of every file: ``kind`` (the name of the design), ``sensors`` and ``motors`` (names), the
design's own number (``KINDS``: ``hidden``, a count, of a network; ``timestep``, s, of a CPG) and
``genome`` (float64). Controllers whose command ranges differ from the paper's also have ``ranges``
(float64, centre and half width per motor), and those that hold their heading ``heading`` (true).

In place of a number, a policy has ``content`` (its operators, terms and action, as JSON) and the
tensors of its network, a fine-tuned one also ``features``, and a compensating layer ``base`` (the
bytes of the controller within) and ``feedback``.
"""

import io
import struct
import tokenize
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import PAPER_RANGE, Controller, Design, Ranges
from selfmodel.controllers.cpg import Cpg
from selfmodel.controllers.network import Network
from selfmodel.errors import InputError
from selfmodel.files import read_file
from selfmodel.logs.files import create_file

MAX_CONTROLLER_BYTES = 2**24
"""Largest size of a controller file, bytes. Those of the paper's robots are under 3,000; a policy
of four layers of 512 neurons has three million."""

Arrays = Mapping[str, NDArray[Any]]
"""Arrays of a file, by name."""

KINDS: Mapping[str, tuple[Callable[..., Design], str, str]] = {
    Network.name: (Network, "hidden", "i"),
    Cpg.name: (Cpg, "timestep", "f"),
}
"""Class of each kind of design, by its name, with the name and type code of its own number."""

POLICY, FINETUNED, LAYER = "policy", "finetuned", "compensation"
"""Names of the designs without a number of their own."""

NPZ_FAILURES = (
    ValueError,  # numpy's headers
    TypeError,
    KeyError,
    EOFError,
    RuntimeError,  # an encrypted file, or an unknown compression
    OverflowError,
    SyntaxError,
    tokenize.TokenError,  # numpy's headers are Python literals
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
    msgspec.MsgspecError,  # the content of a policy
)
"""Exceptions of zipfile and numpy for malformed bytes."""


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
    arrays: dict[str, NDArray[Any]] = {
        "kind": np.array(design.name),
        "sensors": np.array(design.sensors, dtype=np.str_),
        "motors": np.array(design.motors, dtype=np.str_),
        **_own_arrays(design),
        "genome": controller.genome,
    }
    if any(one != PAPER_RANGE for one in design.ranges):
        arrays["ranges"] = np.array(design.ranges)
    return npz_bytes(arrays)


def npz_bytes(arrays: Arrays, write: Callable[..., None] = np.savez) -> bytes:
    """Returns arrays as the bytes of an ``.npz`` file; equal arrays, equal bytes."""
    file = io.BytesIO()
    write(file, allow_pickle=False, **arrays)
    return file.getvalue()


def parse_controller(data: bytes, source: str) -> Controller:
    """Returns the controller of bytes that ``controller_bytes`` made; errors name the source."""
    return _parsed(data, source, (*KINDS, POLICY, FINETUNED, LAYER))


def _parsed(data: bytes, source: str, known: Sequence[str]) -> Controller:
    """Returns a controller of one of some kinds."""
    what = "a controller (.npz with the arrays kind, sensors, motors, genome and a design's own)"
    with npz_errors(source, what):
        arrays = read_arrays(data, MAX_CONTROLLER_BYTES)
        kind = str(arrays.get("kind", "network"))
        if kind not in known:
            raise ValueError(f"expected the kind {' or '.join(map(repr, known))}, got {kind!r}")
        expected = {"kind": "U0", "sensors": "U1", "motors": "U1", **_own_types(kind, arrays)}
        expected |= {"genome": "f1"} | ({"ranges": "f2"} if "ranges" in arrays else {})
        check_types(arrays, expected, lambda array: f"{array.dtype.kind}{array.ndim}")
        for name, array in arrays.items():
            wide = array.dtype == np.float64 or name.startswith(_TENSOR)
            if array.dtype.kind == "f" and not wide:
                raise ValueError(f"its {name} is {array.dtype}, expected float64")
        sensors, motors = (tuple(arrays[name].tolist()) for name in ("sensors", "motors"))
        ranges = tuple((c, half) for c, half in arrays.get("ranges", np.empty((0, 2))).tolist())
        design = _design(kind, (sensors, motors), ranges, arrays, source)
        return Controller(design, arrays["genome"])


_TENSOR = "tensor/"
"""Prefix of the names of a network's tensors."""

_GRAPH = ("input", "output", "inputs", "outputs", "nodes")
"""Attributes of a network beside its tensors."""


def _own_arrays(design: Design) -> dict[str, NDArray[Any]]:
    if design.name in KINDS:
        number = KINDS[design.name][1]
        holds = {"heading": np.array(object=True)} if design.heading else {}
        return {number: np.array(getattr(design, number)), **holds}
    from selfmodel.controllers.compensation import Compensated  # noqa: PLC0415  # few controllers are one
    from selfmodel.controllers.graph import Graph  # noqa: PLC0415  # few controllers are one
    from selfmodel.controllers.policy import Policy  # noqa: PLC0415  # few controllers are one

    if isinstance(design, Policy) and design.name in (POLICY, FINETUNED):
        graph = design.graph
        if not isinstance(graph, Graph):
            raise InputError(f"no file holds the function {graph.name}: give its policy file again")
        of_graph = {name: getattr(graph, name) for name in _GRAPH}
        of_graph |= {"states": graph.states} if graph.states else {}
        content = msgspec.json.encode({**of_graph, "interface": design.interface})
        tensors = {f"{_TENSOR}{name}": _narrow(each) for name, each in graph.tensors.items()}
        arrays = {"content": np.frombuffer(content, dtype=np.uint8), **tensors}
        features = getattr(design, "features", None)  # of a fine-tuned one
        return arrays if features is None else arrays | {"features": np.array(features)}
    if isinstance(design, Compensated):
        base = np.frombuffer(controller_bytes(design.base), dtype=np.uint8)
        return {"base": base, "feedback": np.array(design.feedback)}
    raise TypeError(f"expected a design of a controller file, got {design!r}")


def _narrow(tensor: FloatArray) -> NDArray[Any]:
    """Returns a tensor in float32 if that changes no number: networks are trained in it."""
    with np.errstate(over="ignore"):
        narrow = tensor.astype(np.float32)
    return narrow if np.array_equal(narrow, tensor) else tensor


def _own_types(kind: str, arrays: Arrays) -> dict[str, str]:
    """Returns the types and ranks of these arrays, for ``check_types``."""
    if kind in (POLICY, FINETUNED):
        tensors = {
            name: f"f{each.ndim}" for name, each in arrays.items() if name.startswith(_TENSOR)
        }
        return {"content": "u1", **tensors} | ({"features": "f2"} if kind == FINETUNED else {})
    if kind == LAYER:
        return {"base": "u1", "feedback": "b0"}
    _, number, code = KINDS[kind]
    return {number: f"{code}0"} | ({"heading": "b0"} if "heading" in arrays else {})


def _design(
    kind: str,
    ends: tuple[tuple[str, ...], tuple[str, ...]],
    ranges: Ranges,
    arrays: Arrays,
    source: str,
) -> Design:
    if kind in KINDS:
        design, number, _ = KINDS[kind]
        heading = bool(arrays.get("heading"))
        return design(*ends, arrays[number].item(), ranges=ranges, heading=heading)
    from selfmodel.controllers.compensation import Compensated  # noqa: PLC0415  # few controllers are one
    from selfmodel.controllers.graph import Graph, Node, State  # noqa: PLC0415  # few controllers are one
    from selfmodel.controllers.policy import Interface, Policy  # noqa: PLC0415  # few controllers are one

    if kind in (POLICY, FINETUNED):
        types = (str, str, int, int, tuple[Node, ...], Interface)
        fields = list(zip((*_GRAPH, "interface"), types, strict=True))
        states = ("states", tuple[State, ...], ())  # absent of a feed-forward network
        form = msgspec.defstruct("Content", [*fields, states], forbid_unknown_fields=True)
        content = msgspec.json.decode(arrays["content"].tobytes(), type=form)
        of_graph = msgspec.structs.asdict(content)
        interface = of_graph.pop("interface")
        tensors = {
            name.removeprefix(_TENSOR): np.asarray(each, dtype=np.float64)
            for name, each in arrays.items()
            if name.startswith(_TENSOR)
        }
        graph = Graph(**of_graph, tensors=tensors)
        policy = Policy(*ends, ranges=ranges, graph=graph, interface=interface)
        if kind == POLICY:
            return policy
        from selfmodel.controllers.trained import Finetuned  # noqa: PLC0415  # few controllers are one

        rows = tuple(map(tuple, arrays["features"].tolist()))
        return Finetuned(**vars(policy), features=rows)
    # Without a layer, which could have another within, and so on.
    base = _parsed(arrays["base"].tobytes(), source, (*KINDS, POLICY, FINETUNED))
    feedback = bool(arrays["feedback"])
    return Compensated(*ends, ranges=ranges, base=base, feedback=feedback)


# ---------------------------------------------------------------- archives of arrays


@contextmanager
def npz_errors(source: str, what: str, advice: str = "") -> Iterator[None]:
    """Makes the errors of malformed bytes one sentence, and warnings errors."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # Python's, for a header that is a damaged literal
            yield
    except (*NPZ_FAILURES, MemoryError, Warning) as failure:
        reason = f"{failure or type(failure).__name__}{advice}"
        raise InputError(f"{source}: expected {what}: {reason}") from failure


def read_arrays(data: bytes, limit: int) -> dict[str, NDArray[Any]]:
    """Returns the arrays of an ``.npz`` file that unpacks to at most ``limit`` bytes."""
    if len(data) > limit:
        raise ValueError(f"it has more than {limit} bytes")
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
        if len(members) < len(archive.infolist()):
            raise ValueError("it holds an array twice")
        if sum(info.file_size for info in members.values()) > limit:
            raise ValueError(f"it unpacks to more than {limit} bytes")
        return {name: _array(archive.read(info)) for name, info in members.items()}


def _array(data: bytes) -> NDArray[Any]:
    file = io.BytesIO(data)
    array: NDArray[Any] = np.lib.format.read_array(file, allow_pickle=False)
    if file.tell() != len(data):
        raise ValueError("bytes follow an array")
    return array


def check_types(
    arrays: Arrays, expected: Mapping[str, str], type_of: Callable[[NDArray[Any]], str]
) -> None:
    """Checks that a file has all arrays of some types, and no others."""
    if arrays.keys() != expected.keys():
        raise ValueError(f"it holds {', '.join(sorted(arrays)) or 'nothing'}")
    types = {name: type_of(array) for name, array in arrays.items()}
    if types != expected:
        raise ValueError(f"its arrays have the types and ranks {types}")
