"""Operators of networks by ONNX's names: functions of rows, each row apart and to the bit.

A function receives the values of a node's inputs, None for one that is left out, and its
attributes, and raises ``ValueError`` for those that it does not support.
"""

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.special import expit

from selfmodel.arrays import FloatArray

Arguments = Sequence[Any]
Attributes = Mapping[str, Any]
Operator = Callable[[Arguments, Attributes], Sequence[FloatArray]]
"""Function from the inputs and the attributes of a node to its outputs."""


LARGE, BLOCK, MAX_PRODUCTS = 2**12, 8, 2**18
"""Weights from which on BLAS is faster than einsum; rows that it multiplies at a time, zeros after
the last; and most products of a call, for which OpenBLAS starts no threads. The order of its sums
depends on both."""


def _matmul(rows: FloatArray, matrix: FloatArray) -> FloatArray:
    """Returns ``rows @ matrix.T``, whose bits do not depend on the number of rows.

    The matrix may be one for all rows, or of each row.
    """
    (outputs, width), is_own = np.shape(matrix)[-2:], np.ndim(matrix) == 3
    if np.shape(rows)[-1] != width:  # einsum would repeat a single number
        raise ValueError("a product of other sizes")
    if outputs * width < LARGE:
        of_row = "ni,nji->nj" if is_own else "ni,ji->nj"
        return np.asarray(np.einsum(of_row, np.ascontiguousarray(rows), matrix))
    # The own matrix of a row multiplies a block of it and zeros, as one for all does.
    count = len(rows) if is_own else -(-len(rows) // BLOCK)
    if is_own or len(rows) < count * BLOCK:
        blocks = np.zeros((count, BLOCK, width))
        (blocks[:, 0] if is_own else blocks.reshape(-1, width))[: len(rows)] = rows
    else:
        blocks = np.ascontiguousarray(rows).reshape(count, BLOCK, width)
    turned, most = np.swapaxes(matrix, -1, -2), max(1, MAX_PRODUCTS // (BLOCK * width))
    whole = np.empty((count, BLOCK, outputs))
    for first in range(0, outputs, most):
        part = slice(first, first + most)
        np.matmul(blocks, turned[..., part], out=whole[..., part])
    return whole[:, 0] if is_own else whole.reshape(-1, outputs)[: len(rows)]


def _gemm(arguments: Arguments, attributes: Attributes) -> Sequence[FloatArray]:
    rows, matrix, *bias = arguments
    if attributes.get("transA"):
        raise ValueError("a transposed first factor is not supported")
    turned = matrix if attributes.get("transB") else np.ascontiguousarray(matrix.T)
    result = _scaled(_matmul(rows, turned), attributes.get("alpha", 1.0))
    return [result + _scaled(bias[0], attributes.get("beta", 1.0)) if bias else result]


def _scaled(values: FloatArray, factor: float) -> FloatArray:
    return values if factor == 1 else factor * values


def _product(arguments: Arguments, _attributes: Attributes) -> Sequence[FloatArray]:
    rows, matrix = arguments
    return [_matmul(rows, np.ascontiguousarray(matrix.T))]


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
    if x.ndim != 2:  # the rows of all robots would become one
        raise ValueError("expected rows")
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

    The arguments are rows, ``(1, n, inputs)``, both matrices, bias, lengths and states. The cell is
    a function from the product of the rows, ``(n, gates * width)``, the matrix of the states, both
    biases and the rows of the states to the next rows of the states.
    """
    x, matrix, own, *more = arguments
    more += [None] * (4 - len(more))
    bias, lengths, states = more[0], more[1], more[2:]
    width, allowed = own.shape[-1], {"hidden_size", "linear_before_reset", "num_outputs"}
    if x.ndim != 3 or len(x) != 1 or lengths is not None or len(states) > 2:
        raise ValueError("expected one time step of rows")
    if own.shape != (1, gates * width, width) or matrix.shape[:2] != own.shape[:2]:
        raise ValueError("expected weights of one direction")
    if attributes.get("hidden_size", width) != width:
        raise ValueError(f"expected weights of the hidden size, which are of {width}")
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
        kept = expit(forget) * kept + expit(enter) * np.tanh(new)
        return [expit(leave) * np.tanh(kept), kept]

    return _recurrent(arguments, attributes, 4, cell)


def _gru(arguments: Arguments, attributes: Attributes) -> Sequence[FloatArray]:
    def cell(
        x: FloatArray, own: FloatArray, bias: FloatArray, back: FloatArray, *states: FloatArray
    ) -> Sequence[FloatArray]:
        hidden, width = states[0], own.shape[1]
        end = 2 * width  # of the weights of its two gates
        gates = x[:, :end] + _matmul(hidden, own[:end]) + (bias + back)[:end]
        update, reset = np.split(expit(gates), 2, axis=1)
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


def _of(count: int, function: Callable[..., FloatArray]) -> Operator:
    def apply(arguments: Arguments, _attributes: Attributes) -> Sequence[FloatArray]:
        if len(arguments) != count:
            raise ValueError(f"expected {count} inputs")
        return [function(*arguments)]

    return apply


OPERATORS: Mapping[str, Operator] = {
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
    "Add": _of(2, np.add),
    "Sub": _of(2, np.subtract),
    "Mul": _of(2, np.multiply),
    "Div": _of(2, np.divide),
    "Max": _reduced(np.maximum),
    "Min": _reduced(np.minimum),
    "Neg": _of(1, np.negative),
    "Abs": _of(1, np.abs),
    "Exp": _of(1, np.exp),
    "Sqrt": _of(1, np.sqrt),
    "Sin": _of(1, np.sin),
    "Cos": _of(1, np.cos),
    "Tanh": _of(1, np.tanh),
    "Sigmoid": _of(1, expit),
    "Relu": _of(1, lambda x: np.maximum(x, 0.0)),
    "Softplus": _of(1, lambda x: np.logaddexp(x, 0.0)),
    "Softsign": _of(1, lambda x: x / (1 + np.abs(x))),
    "Identity": _of(1, lambda x: x),
    "Cast": _cast,
}
"""Supported operators, by their name in ONNX. ``Reshape`` makes one row of the
numbers of each robot; ``Cast`` is of numbers to numbers."""

TENSOR_FACTORS: Mapping[str, int] = {"Gemm": 1, "MatMul": 1, "GRU": 3, "LSTM": 3}
"""Number of inputs, after the first, that must be tensors."""

BY_SHAPE = (
    *("Gemm", "MatMul", "Concat", "Split", "Slice", "Reshape", "Clip", "LayerNormalization"),
    *("Squeeze", "Unsqueeze", "GRU", "LSTM"),
)
"""Operators whose arguments do not broadcast; none makes more numbers than it is given, but a
product or a cell, of its tensor's rows."""
