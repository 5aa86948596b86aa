"""Networks as graphs of operators, evaluated for many robots together.

The operators are those of ONNX with its names, over rows: axis 0 of every value is that of the
robots, and each row of a result is bit-identical for every number of rows. Of a recurrent network,
the values around its cell have the robots on axis 1, after one time step: ``(1, n, width)``.
Arithmetic is in float64: against another evaluation, only the rounding of its float32 is left.
"""

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from selfmodel.arrays import FloatArray, frozen
from selfmodel.controllers.operators import BY_SHAPE, OPERATORS, TENSOR_FACTORS, Arguments
from selfmodel.errors import check_name

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
        attributes: Its numbers by name, as sorted pairs.
    """

    operator: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    attributes: tuple[tuple[str, float | tuple[float, ...]], ...] = ()

    @cached_property
    def keywords(self) -> Mapping[str, Any]:
        """Its attributes by name, and the number of its outputs, as ``OPERATORS`` receive them."""
        return {**dict(self.attributes), "num_outputs": len(self.outputs)}


@dataclass(frozen=True)
class State:
    """Numbers that a recurrent network hands to its next evaluation, ``(1, n, width)``; 0 at first.

    They are an input of the network, by name, and the next ones an output.
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
                raise ValueError(
                    f"the tensor {name} has numbers that are not finite: train or export it again"
                )
        tensors = {name: frozen(tensor) for name, tensor in self.tensors.items()}
        object.__setattr__(self, "tensors", MappingProxyType(tensors))
        for name, width in (("", self.inputs), *((s.input, s.width) for s in self.states)):
            if not 1 <= width <= MAX_NUMBERS:
                what = f"numbers of the state {name}" if name else "inputs"
                raise ValueError(f"expected 1 to {MAX_NUMBERS} {what}, got {width}")
        for rows in (1, 2):  # a tensor of two rows fits two robots alone
            given = (rows, self.inputs)
            first = self.initial(rows)
            output, later = self.step(np.zeros(given), first)  # raises ValueError
            if not self.outputs and output.ndim == len(given):
                object.__setattr__(self, "outputs", output.shape[1])
            expected = (rows, self.outputs)
            if output.shape != expected:
                raise ValueError(
                    f"its output for inputs of {given} has the shape {output.shape}, expected "
                    f"{expected}"
                )
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
            check_name("operator", node.operator, sorted(OPERATORS))
            if missing := [name for name in node.inputs if name and name not in known]:
                raise ValueError(f"{missing[0]} is used by {node.operator} before it is computed")
            for name, value in node.attributes:
                if not np.isfinite(value).all():
                    raise ValueError(f"the {name} of {node.operator} is not finite")
            # The product with a row of another robot would be no row.
            factors = node.inputs[1 : 1 + TENSOR_FACTORS.get(node.operator, 0)]
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
        self,
        rows: FloatArray,
        states: Sequence[FloatArray],
        own: Mapping[str, FloatArray] = MappingProxyType({}),
    ) -> tuple[FloatArray, tuple[FloatArray, ...]]:
        """Returns the output of each row, ``(n, outputs)``, and the next states.

        Args:
            rows: Inputs, ``(n, inputs)``.
            states: Those of ``initial``, or of the last evaluation.
            own: Tensors of each row in place of those of the network, ``(n, ...)``, by name.
        """
        # In the order of C: otherwise numpy sums along a row in another order than of one row.
        rows = np.ascontiguousarray(rows)
        values: dict[str, FloatArray] = {**self.tensors, **own, self.input: rows}
        values |= {kept.input: each for kept, each in zip(self.states, states, strict=True)}
        left = MAX_NUMBERS * len(rows)
        for node in self.nodes:
            arguments: list[Any] = [values[name] if name else None for name in node.inputs]
            try:
                results, size = _results(node, arguments, left)
            except _FAILURES as error:
                shapes = ", ".join(str(np.shape(one)) for one in arguments)
                raise ValueError(f"{node.operator} of the shapes {shapes}: {error}") from error
            left -= size
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
    """Returns the network of dense layers: matrix ``(outputs, inputs)`` and bias ``(outputs,)``."""
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


def _results(node: Node, arguments: Arguments, left: int) -> tuple[Sequence[FloatArray], int]:
    """Returns the outputs of a node, and how many numbers they have together."""
    # Before any is computed: two small values may make a large one.
    shapes = {np.shape(one) for one in arguments if one is not None}
    if node.operator not in BY_SHAPE and math.prod(np.broadcast_shapes(*shapes)) > left:
        raise ValueError(f"more than {MAX_NUMBERS} numbers in a row")
    results = OPERATORS[node.operator](arguments, node.keywords)
    if len(results) < len(node.outputs):
        raise ValueError(f"{len(results)} outputs, expected {len(node.outputs)}")
    if (size := sum(map(np.size, results))) > left:
        raise ValueError(f"more than {MAX_NUMBERS} numbers in a row")
    return results, size
