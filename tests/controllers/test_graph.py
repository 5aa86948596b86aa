"""Promises of networks as graphs: ONNX's operators, independent rows, and refusals by name."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
from hypothesis import given, settings, strategies as st

from selfmodel.controllers.graph import Graph, Node, State, layers
from selfmodel.controllers.operators import OPERATORS
from selfmodel.logs.policies import read_network
from tests.helpers.policies import (
    CELLS,
    onnx_bytes,
    random_layers,
    random_network,
    recurrent_bytes,
)

UNARY = (
    *("Neg", "Abs", "Exp", "Sqrt", "Sin", "Cos", "Tanh", "Sigmoid", "Relu", "Softplus"),
    *("Softsign", "Identity", "Flatten", "Elu<alpha=0.7>", "LeakyRelu", "LeakyRelu<alpha=0.2>"),
    *("Softmax", "Softmax<axis=1>"),
)
MODELS: list[tuple[str, int]] = [
    *((f"y = {operator}(x)", 6) for operator in UNARY),
    *((f"y = {operator}(x, row)", 6) for operator in ("Add", "Sub", "Mul", "Div")),
    *((f"a = Neg(x); y = {operator}(x, a, row)", 6) for operator in ("Max", "Min")),
    ("y = Gemm<alpha=0.5, beta=2.0>(x, w, five)", 5),
    ("y = Gemm<transB=1>(x, turned)", 5),
    ("y = MatMul(x, w)", 5),
    ("y = Clip(x, low, high)", 6),
    ('y = Clip(x, "", high)', 6),
    ("y = LayerNormalization<epsilon=0.01>(x, row, row)", 6),
    ("a = Neg(x); y = Concat<axis=1>(x, a)", 12),
    ("a, b, c = Split<axis=1>(x, sizes); y = Concat<axis=-1>(c, a, b)", 6),
    ("a, b, c, d = Split<axis=1, num_outputs=4>(x); y = Concat<axis=1>(c, b)", 4),
    ("y = Slice(x, one, end, one, two)", 3),
    ("y = Slice(x, four, minus, minus)", 3),
    ("y = Reshape(x, shape)", 6),
    ("a = Cast<to=11>(x); y = Cast<to=1>(a)", 6),
    ("a = Cast<to=7>(x); y = Cast<to=1>(a)", 6),
    ("u = Unsqueeze(x, zero); y = Squeeze(u, zero)", 6),
    ("u = Unsqueeze(x, zero); q, h = LSTM<hidden_size=2>(u, w4, r4, b4); y = Squeeze(h, zero)", 2),
    ("u = Unsqueeze(x, zero); q = LSTM<hidden_size=2>(u, w4, r4); y = Squeeze(q, both)", 2),
    ("u = Unsqueeze(x, zero); q, h = GRU<hidden_size=2>(u, w3, r3, b3); y = Squeeze(h, zero)", 2),
]
W = np.eye(6, 5, dtype=np.float32) - 0.3
TENSORS = {
    "row": np.arange(1, 7, dtype=np.float32) / 3,
    "w": W,
    "turned": W.T.copy(),
    "five": np.arange(5, dtype=np.float32),
    "low": np.float32(-0.5).reshape(()),
    "high": np.float32(0.7).reshape(()),
    "sizes": np.array([1, 2, 3]),
    **{name: np.array([k]) for name, k in (("one", 1), ("two", 2), ("four", -4), ("minus", -1))},
    "end": np.array([2**63 - 1]),
    "zero": np.array([0]),
    "both": np.array([0, 1]),
    **{f"w{k}": np.linspace(-1, 1, 12 * k, dtype=np.float32).reshape(1, 2 * k, 6) for k in (3, 4)},
    **{f"r{k}": np.linspace(-2, 1, 4 * k, dtype=np.float32).reshape(1, 2 * k, 2) for k in (3, 4)},
    **{f"b{k}": np.linspace(-1, 3, 4 * k, dtype=np.float32).reshape(1, 4 * k) for k in (3, 4)},
    "shape": np.array([-1, 6]),
}


@pytest.mark.parametrize(("code", "outputs"), MODELS, ids=[code for code, _ in MODELS])
def test_an_operator_is_that_of_onnx(tmp_path: Path, code: str, outputs: int):
    path = tmp_path / "network.onnx"
    path.write_bytes(onnx_bytes(code, TENSORS, 6, outputs))
    rows = np.random.default_rng(0).uniform(-2, 2, (7, 6)).astype(np.float32)
    rows = np.abs(rows) if "Sqrt" in code else rows
    (expected,) = onnxruntime.InferenceSession(path).run(None, {"x": rows})

    np.testing.assert_allclose(
        read_network(path)(rows.astype(float)), expected, rtol=1e-6, atol=1e-6
    )


def test_every_operator_is_compared_with_onnx():
    assert [name for name in OPERATORS if all(f"= {name}" not in code for code, _ in MODELS)] == []


@pytest.mark.parametrize("cell", CELLS)
def test_a_recurrent_network_is_that_of_onnx_over_many_evaluations(tmp_path: Path, cell: str):
    path = tmp_path / "network.onnx"
    path.write_bytes(recurrent_bytes(cell, 6, 3))
    network, session = read_network(path), onnxruntime.InferenceSession(path)
    states, names = network.initial(7), [state.input for state in network.states]
    theirs = [each.astype(np.float32) for each in states]
    for seed in range(20):
        rows = np.random.default_rng(seed).normal(size=(7, 6)).astype(np.float32)
        output, states = network.step(rows.astype(float), states)
        expected, *theirs = session.run(None, {"x": rows, **dict(zip(names, theirs, strict=True))})

        np.testing.assert_allclose(output, expected, rtol=1e-6, atol=1e-6)
        for own, other in zip(states, theirs, strict=True):
            np.testing.assert_allclose(own, other, rtol=1e-6, atol=1e-6)
    assert float(np.abs(states[0]).min()) > 0


@pytest.mark.parametrize("cell", CELLS)
def test_a_row_of_a_recurrent_network_is_the_same_to_the_bit_in_any_batch(
    tmp_path: Path, cell: str
):
    path = tmp_path / "network.onnx"
    path.write_bytes(recurrent_bytes(cell, 6, 3))
    network = read_network(path)
    x = np.random.default_rng(2).normal(size=(4, 33, 6))
    states, own = network.initial(33), network.initial(1)
    for rows in x:
        output, states = network.step(rows, states)
        alone, own = network.step(rows[[20]], own)

        assert output[20].tobytes() == alone.tobytes()


def test_layers_are_the_plain_formula():
    (w0, b0), (w1, b1), (w2, b2) = pairs = random_layers(4, 5, 6, 2)
    x = np.random.default_rng(1).normal(size=(9, 4))
    value = np.maximum(np.maximum(x @ w0.T + b0, 0) @ w1.T + b1, 0) @ w2.T + b2

    np.testing.assert_allclose(layers(pairs, "Relu", "Tanh")(x), np.tanh(value), rtol=1e-12)


MIXED = Graph(
    *("x", "y", 48, 12),
    (
        Node("Split", ("x", "sizes"), ("a", "b", "c", "d"), (("axis", 1.0),)),
        Node("Tanh", ("a",), ("a1",)),
        Node("Sigmoid", ("b",), ("b1",)),
        Node("Exp", ("b",), ("b2",)),
        Node("Softmax", ("c",), ("c1",)),
        Node("Elu", ("d",), ("d1",)),
        Node("Softplus", ("d",), ("d2",)),
        Node("Concat", ("a1", "b2", "c1", "d1", "b1", "d2"), ("all",), (("axis", 1.0),)),
        Node("LayerNormalization", ("all", "scale"), ("even",)),
        Node("Gemm", ("even", "w"), ("y",), (("transB", 1.0),)),
    ),
    {
        "sizes": np.array([5.0, 11, 13, 19]),
        "scale": np.linspace(1, 2, 78),
        "w": random_layers(78, 12)[0][0],
    },
)
EVERY_OTHER = Graph(
    *("x", "y", 1024, 129),
    (
        Node("Slice", ("x", "begin", "end", "axis", "step"), ("other",)),
        Node("Gemm", ("other", "w"), ("y",), (("transB", 1.0),)),
    ),
    {
        "begin": np.array([0]),
        "end": np.array([1024]),
        "axis": np.array([1]),
        "step": np.array([2]),
        "w": random_layers(512, 129)[0][0],
    },
)
NETWORKS = [
    random_network(48, 64, 32, 12, activation="Elu"),
    random_network(48, 520, 100, 12, activation="Elu"),  # by BLAS, the second layer in two parts
    random_network(1, 3, 1),
    MIXED,
    EVERY_OTHER,
]


@pytest.mark.parametrize("network", NETWORKS, ids=["layers", "large", "narrow", "mixed", "strided"])
@settings(max_examples=25)
@given(
    rows=st.integers(1, 130) | st.sampled_from([8, 16]),
    place=st.integers(0, 129),
    seed=st.integers(0, 99),
)
def test_a_row_is_the_same_to_the_bit_in_any_batch_and_place(
    network: Graph, rows: int, place: int, seed: int
):
    x = np.random.default_rng(seed).normal(size=(rows, network.inputs))
    row = slice(place % rows, place % rows + 1)

    assert network(x)[row].tobytes() == network(x[row]).tobytes()
    assert network(np.asfortranarray(x))[row].tobytes() == network(x[row]).tobytes()


GEMM = Node("Gemm", ("x", "w"), ("y",), (("transB", 1.0),))


def graph(*nodes: Node, output: str = "y", **tensors: np.ndarray) -> Graph:
    return Graph("x", output, 3, 2, nodes, {"w": np.ones((2, 3)), **tensors})


def node(operator: str, *inputs: str, out: str = "y", **attributes: float) -> Node:
    return Node(operator, ("x", *inputs), tuple(out.split()), tuple(attributes.items()))


@pytest.mark.parametrize(
    ("nodes", "options", "match"),
    [
        ([node("Gru")], {}, r"unknown operator 'Gru': did you mean GRU"),
        ([node("Add", "z"), GEMM], {}, "z is used by Add before it is computed"),
        ([GEMM], {"output": "z"}, "no operator computes the output z"),
        ([node("Tanh")], {}, r"its output for .* the shape \(1, 3\), expected \(1, 2\)"),
        ([GEMM], {"w": np.full((2, 3), np.nan)}, "the tensor w has numbers that are not finite"),
        ([GEMM], {"w": np.ones((2, 4))}, r"Gemm of the shapes \(1, 3\), \(2, 4\): "),
        ([GEMM], {"output": "b", "b": np.ones((2, 2))}, r"inputs of \(1, 3\) has the shape \(2, 2"),
        (
            [GEMM, Node("Add", ("y", "b"), ("y",))],
            {"b": np.ones((2, 2))},
            r"the shape \(2, 2\), ex",
        ),
        ([node("Softmax", out="a", axis=0.0), GEMM], {}, "Softmax .* expected axis 1"),
        ([node("Cast", out="a", to=9.0), GEMM], {}, "Cast .* expected a type of numbers"),
        ([node("Split", "w", out="a b c", axis=1.0), GEMM], {"w": np.array([3.0])}, "1 outputs, e"),
        ([node("Elu", out="a", alpha=math.inf), GEMM], {}, "the alpha of Elu is not finite"),
        ([node("Add", "b", out="a"), GEMM], {"b": np.ones((2**19, 1))}, "more than 131072 num"),
        (
            [node("Split", out="a b", axis=1.0, num_outputs=3e6), Node("Add", ("a", "c"), ("y",))],
            {"c": np.ones((2**17, 1))},
            "more than 131072 numbers in a row",
        ),
        ([node("Split", "s", out="a b", axis=1.0), GEMM], {"s": np.array([1.0, 1])}, "do not make"),
        (
            [node("Reshape", "s", out="a"), GEMM],
            {"s": np.array([-1.0, 1, 3])},
            "one row of numbers",
        ),
        ([node("Slice", out="a"), GEMM], {}, "export with 10 or a later one"),
        ([node("Add", "x", "x", out="a"), GEMM], {}, "expected 2 inputs"),
        ([GEMM, Node("Gemm", ("y", "m"), ("y",))], {"m": np.ones((3, 2))}, "of other sizes"),
        ([node("Unsqueeze", "s", out="a"), GEMM], {"s": np.array([1.0])}, "expected axis 0 of ro"),
        (
            [node("Unsqueeze", "s", out="a"), Node("Flatten", ("a",), ("b",)), GEMM],
            {"s": np.array([0.0])},
            "Flatten .* expected rows",
        ),
        ([node("Squeeze", "s", out="a"), GEMM], {"s": np.array([0.0])}, "before that of the robot"),
        ([Node("Gemm", ("w", "x"), ("a",)), GEMM], {}, "second factor of Gemm must be a tensor"),
        ([GEMM] * 1001, {}, "it has 1001 operators, expected at most 1000"),
    ],
)
def test_a_network_that_cannot_be_computed_is_refused(nodes: list[Node], options: dict, match: str):
    with pytest.raises(ValueError, match=match):
        graph(*nodes, **options)


def test_an_output_of_open_size_is_as_wide_as_it_is_computed():
    own = Graph("x", "y", 3, 0, (GEMM,), {"w": np.ones((2, 3))})

    assert (own.outputs, own) == (2, graph(GEMM))


def test_networks_are_equal_when_their_content_is():
    assert len({graph(GEMM), graph(GEMM, w=np.ones((2, 3)))}) == 1
    assert graph(GEMM) != graph(GEMM, w=np.ones((2, 3)) + 1e-9)
    assert graph(GEMM) != graph(replace(GEMM, attributes=(("alpha", 2.0), ("transB", 1.0))))
    assert graph(GEMM) != "a network"


@pytest.mark.parametrize(
    ("state", "match"),
    [
        (State("h", "h1", 0), "numbers of the state h, got 0"),
        (State("h", "h1", 2**60), "numbers of the state h, got"),
        (
            State("h", "h1", 2),
            r"the state h1 has the shape \(1, 1, 3\), expected that of h, \(1, 1, 2",
        ),
        (State("h", "z", 3), "no operator computes the output z"),
        (State("h", "two", 3), r"the state two has the shape \(1, 2, 3\), expected .* \(1, 1, 3\)"),
        (State("h", "wide", 3), r"the state wide has the shape \(1, 2, 3\), expected .* \(1, 1, 3"),
    ],
)
def test_a_state_that_does_not_come_back_is_refused(state: State, match: str):
    nodes = (
        *(GEMM, Node("Unsqueeze", ("x", "zero"), ("h1",))),
        Node("Add", ("h", "two") if state.output == "wide" else ("h1", "two"), ("wide",)),
    )
    tensors = {"w": np.ones((2, 3)), "zero": np.zeros(1), "two": np.ones((1, 2, 3))}
    with pytest.raises(ValueError, match=match):
        Graph("x", "y", 3, 2, nodes, tensors, (state,))
