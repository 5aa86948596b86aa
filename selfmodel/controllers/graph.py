"""Networks as graphs of operators, evaluated for many robots together.

The operators are those of ONNX with its names, over rows: axis 0 of every value is that of the
robots, and each row of a result is bit-identical for every number of rows. Of a recurrent network,
the values around its cell have the robots on axis 1, after one time step: ``(1, n, width)``.
Arithmetic is in float64: against another evaluation, only the rounding of its float32 is left.
"""

import functools
import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from selfmodel.arrays import FloatArray, frozen

MAX_NODES = 1000
"""Largest number of operators of a graph."""

MAX_NUMBERS = 2**17
"""Largest number of numbers that all operators of a graph compute for a row."""


@dataclass(frozen=True)
class Node:
    """One operator of a graph.

    Attributes:
        operator: Its name in ONNX, a key of ``OPERATORS``.
        inputs: Names of its inputs: the graph's input, its tensors, or outputs of earlier nodes; ""
            for an optional input that is left out.
        outputs: Names of its outputs.
        attributes: Its numbers by name, as sorted pairs.
    """

    operator: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    attributes: tuple[tuple[str, float | tuple[float, ...]], ...] = ()


@dataclass(frozen=True)
class State:
    """Numbers that a recurrent network hands to its next evaluation, ``(1, n, width)``; 0 at first.

    Attributes:
        input: Name of the input that receives them.
        output: Name of the output that has the next ones.
        width: Numbers a row.
    """

    input: str
    output: str
    width: int


@dataclass(frozen=True, eq=False)
class Graph:
    """A network from one row of numbers to another; graphs of equal content are equal.

    Attributes:
        input: Name of the input, of ``inputs`` numbers a row.
        output: Name of the output, of ``outputs`` numbers a row; 0 for as many as are computed.
        nodes: Operators, in the order of their evaluation.
        tensors: Weights and constants by name; arrays of whole numbers are shapes and axes. The
            second factor of a product is one of them, and so are the weights of a recurrent cell.
        states: What it keeps from one evaluation to the next; none of a feed-forward network.

    Raises:
        ValueError: An operator is unknown, a value is used before it is computed or has another
            shape, or a tensor has numbers that are not finite; the message names it.
    """

    input: str
    output: str
    inputs: int
    outputs: int
    nodes: tuple[Node, ...]
    tensors: Mapping[str, FloatArray]
    states: tuple[State, ...] = ()

    def __post_init__(self) -> None:
        self._check_names()
        for name, tensor in self.tensors.items():
            if not np.isfinite(tensor).all():
                raise ValueError(f"the tensor {name} has numbers that are not finite")
        tensors = {name: frozen(tensor) for name, tensor in self.tensors.items()}
        object.__setattr__(self, "tensors", MappingProxyType(tensors))
        for name, width in (("", self.inputs), *((s.input, s.width) for s in self.states)):
            if not 1 <= width <= MAX_NUMBERS:
                what = f"numbers of the state {name}" if name else "inputs"
                raise ValueError(f"expected 1 to {MAX_NUMBERS} {what}, got {width}")
        for rows in (1, 2):  # a tensor of two rows fits two robots alone
            given = (rows, self.inputs)
            found = self(np.zeros(given)).shape  # raises ValueError
            if not self.outputs and len(found) == len(given):
                object.__setattr__(self, "outputs", found[1])
            expected = (rows, self.outputs)
            if found != expected:
                raise ValueError(
                    f"its output for inputs of {given} has the shape {found}, expected {expected}"
                )
        self._check_states()

    def _check_states(self) -> None:
        first = self.initial(2)
        _, later = self.step(np.zeros((2, self.inputs)), first)  # raises ValueError
        for state, before, after in zip(self.states, first, later, strict=True):
            if before.shape != after.shape:
                raise ValueError(
                    f"the state {state.output} has the shape {after.shape}, expected that of "
                    f"{state.input}, {before.shape}"
                )

    def _check_names(self) -> None:
        if len(self.nodes) > MAX_NODES:
            raise ValueError(f"it has {len(self.nodes)} operators, expected at most {MAX_NODES}")
        known = {self.input, *(state.input for state in self.states), *self.tensors}
        for node in self.nodes:
            if node.operator not in OPERATORS:
                raise ValueError(
                    f"the operator {node.operator} is not supported, which are "
                    f"{', '.join(sorted(OPERATORS))}"
                )
            if missing := [name for name in node.inputs if name and name not in known]:
                raise ValueError(f"{missing[0]} is used by {node.operator} before it is computed")
            for name, value in node.attributes:
                if not np.isfinite(value).all():
                    raise ValueError(f"the {name} of {node.operator} is not finite")
            # The product with a row of another robot would be no row.
            factors = node.inputs[1 : 1 + _FACTORS.get(node.operator, 0)]
            if not self.tensors.keys() >= set(filter(None, factors)):
                raise ValueError(f"the second factor of {node.operator} must be a tensor")
            known |= set(node.outputs)
        for output in (self.output, *(state.output for state in self.states)):
            if output not in known:
                raise ValueError(f"no operator computes the output {output}")

    def initial(self, rows: int) -> tuple[FloatArray, ...]:
        """Returns the states before the first evaluation."""
        return tuple(np.zeros((1, rows, state.width)) for state in self.states)

    def __call__(self, rows: FloatArray) -> FloatArray:
        """Returns the output of each row for its first states, as ``step`` does."""
        return self.step(rows, self.initial(len(rows)))[0]

    @np.errstate(all="ignore")  # the numbers of a simulation that diverged
    def step(
        self, rows: FloatArray, states: Sequence[FloatArray]
    ) -> tuple[FloatArray, tuple[FloatArray, ...]]:
        """Returns the output of each row, ``(n, outputs)``, and the next states.

        Args:
            rows: Inputs, ``(n, inputs)``.
            states: Those of ``initial``, or of the last evaluation.
        """
        # In the order of C: otherwise numpy sums along a row in another order than of one row.
        rows = np.ascontiguousarray(rows)
        values: dict[str, FloatArray] = {**self.tensors, self.input: rows}
        values |= {own.input: each for own, each in zip(self.states, states, strict=True)}
        left = MAX_NUMBERS * len(rows)
        for node in self.nodes:
            arguments: list[Any] = [values[name] if name else None for name in node.inputs]
            try:
                results = _results(node, arguments, left)
            except _FAILURES as error:
                shapes = ", ".join(str(np.shape(one)) for one in arguments)
                raise ValueError(f"{node.operator} of the shapes {shapes}: {error}") from error
            left -= sum(map(np.size, results))
            values.update(zip(node.outputs, results, strict=False))
        return values[self.output], tuple(values[state.output] for state in self.states)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Graph):
            return NotImplemented
        return self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the operators and the tensors."""
        states = [[s.input, s.output, s.width] for s in self.states]
        shape = [self.input, self.output, self.inputs, self.outputs, *states]
        nodes = [[n.operator, n.inputs, n.outputs, n.attributes] for n in self.nodes]
        digest = hashlib.sha256(json.dumps([shape, nodes]).encode())
        for name, tensor in sorted(self.tensors.items()):
            digest.update(json.dumps([name, tensor.shape]).encode())
            digest.update(tensor.tobytes())
        return digest.hexdigest()

    @property
    def weights(self) -> int:
        """Number of numbers in its tensors."""
        return sum(tensor.size for tensor in self.tensors.values())


def layers(
    weights: Sequence[tuple[FloatArray, FloatArray]], activation: str, last: str = "Identity"
) -> Graph:
    """Returns the network of dense layers, each ``(outputs, inputs)`` and its bias ``(outputs,)``.

    Args:
        weights: Matrix and bias of each layer.
        activation: Operator between two layers, such as ``Elu``.
        last: Operator after the last layer.
    """
    nodes, tensors, value = list[Node](), dict[str, FloatArray](), "input"
    for k, (matrix, bias) in enumerate(weights):
        tensors |= {f"weight{k}": matrix, f"bias{k}": bias}
        dense = Node("Gemm", (value, f"weight{k}", f"bias{k}"), (f"dense{k}",), (("transB", 1.0),))
        end = k == len(weights) - 1
        value = "output" if end else f"layer{k}"
        nodes += [dense, Node(last if end else activation, (f"dense{k}",), (value,))]
    inputs, outputs = weights[0][0].shape[1], weights[-1][0].shape[0]
    return Graph("input", "output", inputs, outputs, tuple(nodes), tensors)


_FAILURES = (
    *(ValueError, IndexError, KeyError, TypeError, AttributeError),  # of arguments of other kinds
    *(ArithmeticError, MemoryError),  # of their numbers
)


def _results(node: Node, arguments: "Arguments", left: int) -> Sequence[FloatArray]:
    """Returns the outputs of an operator, of ``left`` numbers at most."""
    attributes = {**dict(node.attributes), "num_outputs": len(node.outputs)}
    # Before any is computed: two small values may make a large one.
    sizes = [np.shape(one) for one in arguments if one is not None]
    if node.operator not in _BY_SHAPE and math.prod(np.broadcast_shapes(*sizes)) > left:
        raise ValueError(f"more than {MAX_NUMBERS} numbers in a row")
    results = OPERATORS[node.operator](arguments, attributes)
    if len(results) < len(node.outputs):
        raise ValueError(f"{len(results)} outputs, expected {len(node.outputs)}")
    if sum(map(np.size, results)) > left:
        raise ValueError(f"more than {MAX_NUMBERS} numbers in a row")
    return results


_FACTORS: Mapping[str, int] = MappingProxyType({"Gemm": 1, "MatMul": 1, "GRU": 3, "LSTM": 3})
"""Number of inputs, after the first, that must be tensors."""

_BY_SHAPE = (
    *("Gemm", "MatMul", "Concat", "Split", "Slice", "Reshape", "Clip", "LayerNormalization"),
    *("Squeeze", "Unsqueeze", "GRU", "LSTM"),
)
"""Operators whose arguments do not broadcast; none makes more numbers than it is given, but a
product or a cell, of its tensor's rows."""


# ---------------------------------------------------------------- operators

Arguments = Sequence[Any]
Attributes = Mapping[str, Any]
Operator = Callable[[Arguments, Attributes], Sequence[FloatArray]]
"""Function from the inputs and the attributes of a node to its outputs."""


def _matmul(rows: FloatArray, matrix: FloatArray) -> FloatArray:
    """Returns ``rows @ matrix.T``; BLAS sums in an order that depends on the number of rows."""
    if np.shape(rows)[-1] != np.shape(matrix)[-1]:  # einsum would repeat a single number
        raise ValueError("a product of other sizes")
    return np.asarray(np.einsum("ni,ji->nj", np.ascontiguousarray(rows), matrix))


def _gemm(arguments: Arguments, attributes: Attributes) -> Sequence[FloatArray]:
    rows, matrix, *bias = arguments
    if attributes.get("transA"):
        raise ValueError("a transposed first factor is not supported")
    turned = matrix if attributes.get("transB") else np.ascontiguousarray(matrix.T)
    result = attributes.get("alpha", 1.0) * _matmul(rows, turned)
    return [result + attributes.get("beta", 1.0) * bias[0] if bias else result]


def _product(arguments: Arguments, _attributes: Attributes) -> Sequence[FloatArray]:
    rows, matrix = arguments
    return [_matmul(rows, np.ascontiguousarray(matrix.T))]


def _sigmoid(x: FloatArray) -> FloatArray:
    return np.asarray((1 + np.tanh(x / 2)) / 2)  # does not overflow


def _elu(arguments: Arguments, attributes: Attributes) -> Sequence[FloatArray]:
    (x,) = arguments
    return [np.where(x > 0, x, attributes.get("alpha", 1.0) * np.expm1(np.minimum(x, 0)))]


def _leaky(arguments: Arguments, attributes: Attributes) -> Sequence[FloatArray]:
    (x,) = arguments
    return [np.where(x > 0, x, attributes.get("alpha", 0.01) * x)]


def _clip(arguments: Arguments, attributes: Attributes) -> Sequence[FloatArray]:
    x, *ends = arguments
    low = ends[0] if ends and ends[0] is not None else attributes.get("min", -math.inf)
    high = ends[1] if len(ends) > 1 and ends[1] is not None else attributes.get("max", math.inf)
    return [np.clip(x, low, high)]


def _normalised(arguments: Arguments, attributes: Attributes) -> Sequence[FloatArray]:
    x, scale, *bias = arguments
    x = np.ascontiguousarray(x)
    if attributes.get("axis", -1) not in (-1, x.ndim - 1):
        raise ValueError("expected the last axis")
    centred = x - x.mean(axis=-1, keepdims=True)
    variance = np.square(centred).mean(axis=-1, keepdims=True)
    result = centred / np.sqrt(variance + attributes.get("epsilon", 1e-5)) * scale
    return [result + bias[0] if bias else result]


def _along_rows(axis: float, x: FloatArray) -> None:
    if x.ndim != 2 or axis not in (1, -1):  # rows, and the numbers of a row
        raise ValueError("expected axis 1 of rows")


def _concatenated(arguments: Arguments, attributes: Attributes) -> Sequence[FloatArray]:
    count = max(len(one) for one in arguments)
    parts = [np.broadcast_to(one, (count, one.shape[-1])) for one in arguments]
    _along_rows(attributes["axis"], parts[0])
    return [np.concatenate(parts, axis=1)]


def _split(arguments: Arguments, attributes: Attributes) -> Sequence[FloatArray]:
    x, *sizes = arguments
    _along_rows(attributes.get("axis", 0), x)
    given = sizes[0] if sizes else attributes.get("split")
    if given is None:  # equal parts, but for a smaller last one
        count = int(attributes["num_outputs"])
        return np.split(x, -(-x.shape[1] // count) * np.arange(1, count), axis=1)
    parts = np.asarray(given, dtype=np.intp)
    if parts.min() < 0 or parts.sum() != x.shape[1]:
        raise ValueError(f"parts of {parts.tolist()} numbers do not make {x.shape[1]}")
    return np.split(x, np.cumsum(parts)[:-1], axis=1)


def _slice(arguments: Arguments, _attributes: Attributes) -> Sequence[FloatArray]:
    if len(arguments) < 3:  # the ends are attributes
        raise ValueError("it is of an old operator set: export with 10 or a later one")
    x, starts, ends, *more = arguments
    axes = more[0] if more and more[0] is not None else [0.0]
    step = int(more[1][0]) if len(more) > 1 else 1
    if len(starts) != 1:
        raise ValueError("expected one axis")
    _along_rows(float(axes[0]), x)
    return [x[:, int(starts[0]) : int(min(ends[0], 2**31)) : step]]


def _flat(arguments: Arguments, _attributes: Attributes) -> Sequence[FloatArray]:
    x, *shape = arguments
    if shape and (len(shape[0]) != 2 or shape[0][1] not in (-1, x.size // len(x))):
        raise ValueError(f"a shape of {shape[0].tolist()}: expected one row of numbers a robot")
    return [x.reshape(len(x), -1)]


def _softmax(arguments: Arguments, attributes: Attributes) -> Sequence[FloatArray]:
    x = np.ascontiguousarray(arguments[0])
    _along_rows(attributes.get("axis", -1), x)
    raised = np.exp(x - x.max(axis=-1, keepdims=True))
    return [raised / raised.sum(axis=-1, keepdims=True)]


def _axes(arguments: Arguments, attributes: Attributes) -> list[int]:
    """Returns the axes of ``Squeeze`` and ``Unsqueeze``, which were attributes up to version 11."""
    given = arguments[1] if len(arguments) > 1 else attributes.get("axes", ())
    return [int(axis) for axis in np.ravel(given)]


def _unsqueezed(arguments: Arguments, attributes: Attributes) -> Sequence[FloatArray]:
    x, axes = arguments[0], _axes(arguments, attributes)
    if axes not in ([0], [-3]) or x.ndim != 2:
        raise ValueError("expected axis 0 of rows")
    return [x[np.newaxis]]


def _squeezed(arguments: Arguments, attributes: Attributes) -> Sequence[FloatArray]:
    x, axes = arguments[0], _axes(arguments, attributes)
    if not axes or any(axis % x.ndim >= x.ndim - 2 for axis in axes):
        raise ValueError("expected axes before that of the robots")
    return [np.squeeze(x, tuple(axes))]


def _recurrent(
    arguments: Arguments,
    attributes: Attributes,
    gates: int,
    cell: Callable[..., Sequence[FloatArray]],
) -> Sequence[FloatArray]:
    """Returns the outputs of a recurrent cell of one direction after one time step.

    Args:
        arguments: Rows, ``(1, n, inputs)``, both matrices, bias, lengths, states.
        attributes: Those of the node.
        gates: Number of its gates.
        cell: Function from the product of the rows, ``(n, gates * width)``, the matrix of the
            states, both biases and the rows of the states to the next rows of the states.
    """
    x, matrix, own, *more = arguments
    more += [None] * (4 - len(more))
    bias, lengths, states = more[0], more[1], more[2:]
    width, allowed = own.shape[-1], {"hidden_size", "linear_before_reset", "num_outputs"}
    if x.ndim != 3 or len(x) != 1 or lengths is not None or len(states) > 2:
        raise ValueError("expected one time step of rows")
    if own.shape != (1, gates * width, width) or matrix.shape[:2] != own.shape[:2]:
        raise ValueError("expected weights of one direction")
    if others := {name for name, value in attributes.items() if value} - allowed:
        raise ValueError(f"its {', '.join(sorted(others))} is not supported")
    if bias is None:
        bias = np.zeros((1, 2 * gates * width))
    rows = [np.zeros((x.shape[1], width)) if state is None else state[0] for state in states]
    results = cell(_matmul(x[0], matrix[0]), own[0], *np.split(bias[0], 2), *rows)
    return [results[0][np.newaxis, np.newaxis], *(each[np.newaxis] for each in results)]


def _lstm(arguments: Arguments, attributes: Attributes) -> Sequence[FloatArray]:
    def cell(
        x: FloatArray, own: FloatArray, bias: FloatArray, back: FloatArray, *states: FloatArray
    ) -> Sequence[FloatArray]:
        hidden, kept = states
        gates = x + _matmul(hidden, own) + (bias + back)
        enter, leave, forget, new = np.split(gates, 4, axis=1)
        kept = _sigmoid(forget) * kept + _sigmoid(enter) * np.tanh(new)
        return [_sigmoid(leave) * np.tanh(kept), kept]

    return _recurrent(arguments, attributes, 4, cell)


def _gru(arguments: Arguments, attributes: Attributes) -> Sequence[FloatArray]:
    def cell(
        x: FloatArray, own: FloatArray, bias: FloatArray, back: FloatArray, *states: FloatArray
    ) -> Sequence[FloatArray]:
        hidden, width = states[0], own.shape[1]
        end = 2 * width  # of the weights of its two gates
        gates = x[:, :end] + _matmul(hidden, own[:end]) + (bias + back)[:end]
        update, reset = np.split(_sigmoid(gates), 2, axis=1)
        if attributes.get("linear_before_reset"):
            past = reset * (_matmul(hidden, own[end:]) + back[end:])
        else:
            past = _matmul(reset * hidden, own[end:]) + back[end:]
        new = np.tanh(x[:, end:] + bias[end:] + past)
        return [(1 - update) * new + update * hidden]

    return _recurrent(arguments, attributes, 3, cell)


_FLOATS, _INTEGERS = (1, 10, 11, 16), (2, 3, 4, 5, 6, 7, 12, 13)
"""Types of numbers in ONNX."""


def _cast(arguments: Arguments, attributes: Attributes) -> Sequence[FloatArray]:
    (x,) = arguments
    if attributes["to"] not in (*_FLOATS, *_INTEGERS):
        raise ValueError("expected a type of numbers")
    return [x if attributes["to"] in _FLOATS else np.trunc(x)]


def _reduced(function: Callable[[FloatArray, FloatArray], FloatArray]) -> Operator:
    return lambda arguments, _attributes: [functools.reduce(function, arguments)]


def _of_one(function: Callable[[FloatArray], FloatArray]) -> Operator:
    def apply(arguments: Arguments, _attributes: Attributes) -> Sequence[FloatArray]:
        (x,) = arguments
        return [function(x)]

    return apply


def _of_two(function: Callable[[FloatArray, FloatArray], FloatArray]) -> Operator:
    def apply(arguments: Arguments, _attributes: Attributes) -> Sequence[FloatArray]:
        first, second = arguments
        return [function(first, second)]

    return apply


OPERATORS: Mapping[str, Operator] = MappingProxyType(
    {
        "Gemm": _gemm,
        "MatMul": _product,
        "Elu": _elu,
        "LeakyRelu": _leaky,
        "Clip": _clip,
        "LayerNormalization": _normalised,
        "Concat": _concatenated,
        "Split": _split,
        "Slice": _slice,
        "Flatten": _flat,
        "Reshape": _flat,
        "Softmax": _softmax,
        "Squeeze": _squeezed,
        "Unsqueeze": _unsqueezed,
        "LSTM": _lstm,
        "GRU": _gru,
        "Add": _of_two(np.add),
        "Sub": _of_two(np.subtract),
        "Mul": _of_two(np.multiply),
        "Div": _of_two(np.divide),
        "Max": _reduced(np.maximum),
        "Min": _reduced(np.minimum),
        "Neg": _of_one(np.negative),
        "Abs": _of_one(np.abs),
        "Exp": _of_one(np.exp),
        "Sqrt": _of_one(np.sqrt),
        "Sin": _of_one(np.sin),
        "Cos": _of_one(np.cos),
        "Tanh": _of_one(np.tanh),
        "Sigmoid": _of_one(_sigmoid),
        "Relu": _of_one(lambda x: np.maximum(x, 0.0)),
        "Softplus": _of_one(lambda x: np.logaddexp(x, 0.0)),
        "Softsign": _of_one(lambda x: x / (1 + np.abs(x))),
        "Identity": _of_one(lambda x: x),
        "Cast": _cast,
    }
)
"""Supported operators, by their name in ONNX. ``Reshape`` makes one row of the
numbers of each robot; ``Cast`` is of numbers to numbers."""
