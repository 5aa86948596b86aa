"""Promises of policy files, of the networks that they name, and of policies in controller files."""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
from hypothesis import given, strategies as st

from selfmodel.controllers.compensation import Compensated
from selfmodel.controllers.controller import Controller, draw_genomes
from selfmodel.controllers.graph import layers
from selfmodel.controllers.policy import Policy
from selfmodel.errors import InputError
from selfmodel.logs import load_controller, save_controller
from selfmodel.logs.controllers import controller_bytes, parse_controller
from selfmodel.logs.policies import PRESETS, read_network, read_policy
from selfmodel.robot.designs import cpg_for
from selfmodel.robot.robot import Robot
from tests.helpers.drivers import random_cpgs
from tests.helpers.policies import (
    CELLS,
    POLICY,
    onnx_bytes,
    policy_of,
    random_layers,
    random_network,
    recurrent_bytes,
    save_layers,
    save_policy,
)
from tests.helpers.robots.arms import robot_of
from tests.helpers.robots.go1 import HIP, KNEE, go1
from tests.logs.edits import altered

# ---------------------------------------------------------------- policy files


def test_what_a_file_leaves_out_is_the_robot_s(tmp_path: Path):
    robot = robot_of(go1())
    own = read_policy(save_policy(tmp_path, robot), robot)
    names, interface = robot.anatomy.names, own.interface

    assert (own.sensors, own.motors) == (names.sensors, names.motors)
    assert interface.hinges == interface.joints == names.hinges
    assert interface.pose == (0.0, HIP, KNEE) * 4
    assert interface.action.motors == names.motors
    assert interface.action.offset == own.neutral == interface.holding == (0.0, HIP, KNEE) * 4
    assert interface.action.scale == (0.4,) * len(names.motors)
    assert interface.timestep == robot.control_timestep
    assert own.ranges == cpg_for(robot).ranges
    assert (interface.history, interface.decimation, interface.velocity) == (1, 1, (0, 0, 0))


def test_what_a_file_gives_is_taken(tmp_path: Path, quadruped: Robot):
    names = quadruped.anatomy.names
    text = f"""
    network = "network.npz"
    joints = ["{names.hinges[3]}", "{names.hinges[1]}"]
    pose = [0.25, -0.5]
    velocity = [1.0, 0.5, -0.5]
    history = 2
    by_term = true
    newest_first = true
    decimation = 4
    period = 0.8
    activation = "Relu"
    last = "Tanh"
    observation = [
        {{term = "joint_positions", scale = [2.0, 3.0], offset = 0.1}},
        {{term = "velocity"}},
    ]
    [action]
    motors = ["{names.motors[2]}"]
    scale = 0.3
    offset = 0.2
    clip = 5.0
    """
    path = save_policy(tmp_path, quadruped, text)
    pairs = random_layers(10, 4, 1)
    save_layers(tmp_path, pairs)
    own = read_policy(path, quadruped)
    interface, action = own.interface, own.interface.action

    assert own.graph == layers(
        [(w.astype(float), b.astype(float)) for w, b in pairs], "Relu", "Tanh"
    )
    assert interface.joints == (names.hinges[3], names.hinges[1])
    assert (interface.pose, interface.velocity) == ((0.25, -0.5), (1.0, 0.5, -0.5))
    assert (interface.history, interface.decimation, interface.period) == (2, 4, 0.8)
    assert interface.by_term
    assert interface.newest_first
    first, second = interface.terms
    assert (first.name, first.scale, first.offset) == ("joint_positions", (2.0, 3.0), (0.1,))
    assert (second.name, second.scale, second.offset) == ("velocity", (1.0,), (0.0,))
    assert (action.motors, action.scale, action.offset) == ((names.motors[2],), (0.3,), (0.2,))
    assert action.clip == 5.0


@pytest.mark.parametrize("preset", PRESETS)
def test_a_preset_fits_a_network_of_its_size(tmp_path: Path, quadruped: Robot, preset: str):
    # Three vectors, joints, their velocities, and actions; legs have linear velocity or a phase.
    size = 3 * 8 + (9 + 2 if preset == "unitree_rl_gym" else 9 + 3)
    save_layers(tmp_path, random_layers(size, 8))
    path = tmp_path / "policy.toml"
    path.write_text(f'network = "network.npz"\npreset = "{preset}"')
    own = read_policy(path, quadruped)
    scales = {term.name: term.scale for term in own.interface.terms}
    named = ("angular_velocity", "velocity", "joint_velocities", "gravity")
    usual = {"gym": ((0.25,), (2.0, 2.0, 0.25), (0.05,), (1.0,)), "": ((1.0,),) * 4}

    assert tuple(scales[name] for name in named) == usual["gym" if "gym" in preset else ""]
    assert own.interface.action.scale == (0.25 if "gym" in preset else 0.5,) * 8
    assert scales.get("linear_velocity", (2.0,)) == ((2.0,) if "gym" in preset else (1.0,))
    path.write_text(path.read_text() + "\naction.scale = 0.125")
    assert read_policy(path, quadruped).interface.action.scale == (0.125,) * 8


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ('preset = "isaac_gym"', "unknown preset 'isaac_gym': did you mean isaac_lab"),
        ('presets = "isaac_lab"', "unknown field `presets`"),
        (
            '[[observation]]\nterms = "gravity"',
            "unknown field `terms`|missing required field `term`",
        ),
        ('[[observation]]\nterm = "height"', "unknown term 'height'"),
        ('[[observation]]\nterm = "gravity"\nscale = nan', "scale"),
        ('[[observation]]\nterm = "gravity"\nscale = inf', "scale"),
        (
            'joints = ["front_left_kne"]',
            "unknown joint 'front_left_kne': did you mean front_left_k",
        ),
        ('action.motors = ["tail"]', "does not fit quadruped: unknown motor 'tail'"),
        ('preset = "isaac_lab"', "has 3 inputs, and its terms 36"),
        ("pose = [0.0]", "expected 8 numbers of its pose, got 1"),
        ("history = 0", "history"),
        ("velocity = [1.0]", "expected 3 numbers of its velocity, got 1"),
        ("velocity = ", "expected a policy file as TOML: "),
        (
            'activation = "Swish"',
            "network.npz: expected a network.*operator 'Swish'",
        ),
    ],
)
def test_a_file_with_a_mistake_is_refused_and_the_mistake_named(
    tmp_path: Path, quadruped: Robot, text: str, match: str
):
    save_layers(tmp_path, random_layers(3, 4, 8))
    path = tmp_path / "policy.toml"
    path.write_text(f'network = "network.npz"\n{text}\n')
    with pytest.raises(InputError, match=rf"(?s)(policy\.toml.*)?{match}"):
        read_policy(path, quadruped)


@pytest.mark.parametrize("name", ["../network.npz", "weights/network.npz", "/network.npz"])
def test_a_network_in_another_folder_is_refused(tmp_path: Path, quadruped: Robot, name: str):
    path = tmp_path / "policy.toml"
    path.write_text(f'network = "{name}"')
    with pytest.raises(InputError, match=r"policy.toml: expected network.*beside this one"):
        read_policy(path, quadruped)


# ---------------------------------------------------------------- networks

X = np.random.default_rng(3).normal(size=(5, 6)).astype(np.float32)
(W0, B0), (W1, B1) = random_layers(6, 5, 4)
TENSORS = {"w0": W0.T.copy(), "b0": B0, "w1": W1.T.copy(), "b1": B1}
GEMM = onnx_bytes("h = Gemm(x, w0, b0); a = Elu(h); y = Gemm<transB=0>(a, w1, b1)", TENSORS, 6, 4)
PRODUCTS = onnx_bytes(
    "p = MatMul(x, w0); h = Add(p, b0); a = Elu(h); q = MatMul(a, w1); y = Add(b1, q)",
    *(TENSORS, 6, 4),
)


def saved(folder: Path, data: bytes) -> Path:
    path = folder / "network.onnx"
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("data", [GEMM, PRODUCTS], ids=["gemm", "products"])
def test_an_onnx_network_is_what_onnxruntime_computes(tmp_path: Path, data: bytes):
    path = saved(tmp_path, data)
    graph = read_network(path)
    (expected,) = onnxruntime.InferenceSession(path).run(None, {"x": X})

    np.testing.assert_allclose(graph(X.astype(float)), expected, atol=1e-5)
    assert (graph.inputs, graph.outputs, graph.weights) == (6, 4, 6 * 5 + 5 + 5 * 4 + 4)


def test_a_constant_of_an_onnx_network_is_a_tensor(tmp_path: Path):
    code = "c = Constant<value = float[6] {0, 1, 2, 3, 4, 5}>(); y = Mul(x, c)"
    graph = read_network(saved(tmp_path, onnx_bytes(code, {}, 6, 6)))

    np.testing.assert_array_equal(graph(X.astype(float)), X.astype(float) * np.arange(6))


def edited(edit: Callable[[onnx.GraphProto], object]) -> bytes:
    model = onnx.load_model_from_string(GEMM)
    edit(model.graph)
    return model.SerializeToString()


def external(graph: onnx.GraphProto) -> None:
    onnx.external_data_helper.set_external_data(graph.initializer[2], "weights.bin")


def open_ended(graph: onnx.GraphProto) -> None:
    graph.input[0].type.tensor_type.shape.dim[1].dim_param = "any"


def recurrent(graph: onnx.GraphProto) -> None:
    graph.input.append(onnx.helper.make_tensor_value_info("h0", onnx.TensorProto.FLOAT, [1, 8]))


def without_weights(graph: onnx.GraphProto) -> None:
    del graph.node[0].input[1:]


def cell(text: str, width: int = 4, layers: int = 1) -> bytes:
    """A recurrent network; its weights are of two directions where it has two numbers of each."""
    own, directions = (2, 2) if "size=2" in text else (4, 1)
    tensors = {"w": np.ones((directions, 3 * own, 6)), "r": np.ones((directions, 3 * own, own))}
    tensors = {name: each.astype(np.float32) for name, each in tensors.items()}
    code = f'u = Unsqueeze(x, z); q, h = {text}(u, w, r, "", "", h0); y = Squeeze(h, z)'
    return onnx_bytes(
        code, {**tensors, "z": np.array([0])}, 6, own, states={"h0": ("h", width)}, layers=layers
    )


@pytest.mark.parametrize(
    ("data", "match"),
    [
        (b"no model", "expected a network as ONNX"),
        (b"", "expected one input and an output, .* got the inputs none and the outputs none"),
        (edited(external), "its weights are in another file: export it with weights inside"),
        (edited(open_ended), "its input has no fixed size: export it with one"),
        (edited(recurrent), "expected one input .* got the inputs x, h0 and the outputs y"),
        (cell("GRU<hidden_size=4>", layers=2), r"one layer, \(1, 1, width\), in the input h0, got"),
        (cell('GRU<hidden_size=4, activations=["Relu", "Tanh"]>'), "activations .* not supported"),
        (cell("GRU<hidden_size=4, clip=1.0>"), "its clip is not supported"),
        (cell("GRU<hidden_size=4>", width=5), "GRU of the shapes"),
        (cell("GRU<hidden_size=2>"), "expected weights of one direction"),
        (cell('GRU<hidden_size=4, direction="reverse">'), "direction reverse of GRU is not supp"),
        (cell("GRU<hidden_size=7>"), "expected weights of the hidden size, which are of 4"),
        (edited(without_weights), "expected a network as ONNX"),
        (onnx_bytes("y = Erf(x)", {}, 6, 6), "unknown operator 'Erf'"),
    ],
)
def test_an_onnx_file_that_is_no_whole_network_is_refused(tmp_path: Path, data: bytes, match: str):
    with pytest.raises(InputError, match=rf"network\.onnx: .*{match}"):
        read_network(saved(tmp_path, data))


def test_without_the_package_onnx_the_remedy_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    path = saved(tmp_path, GEMM)
    monkeypatch.setitem(sys.modules, "onnx", None)
    with pytest.raises(InputError, match=r"network\.onnx needs .* pip install 'selfmodel\[onnx\]'"):
        read_network(path)


def test_an_npz_is_a_network_of_its_layers(tmp_path: Path):
    path = save_layers(tmp_path, random_layers(6, 5, 4, seed=2))
    assert read_network(path, "Elu") == random_network(6, 5, 4, seed=2, activation="Elu")
    assert read_network(path, "Relu") != random_network(6, 5, 4, seed=2, activation="Elu")


@pytest.mark.parametrize(
    ("arrays", "match"),
    [
        ({}, "it holds nothing"),
        ({"weight0": np.ones((2, 3))}, "it holds weight0"),
        ({"weight1": np.ones((2, 3)), "bias1": np.ones(2)}, "it holds bias1, weight1"),
        ({"weight0": np.ones(3), "bias0": np.ones(1)}, r"expected weights of \(outputs, inputs\)"),
        ({"weight0": np.ones((2, 3)), "bias0": np.ones(4)}, "Gemm|broadcast"),
        (
            {"weight0": np.ones((2, 3)), "bias0": np.full(2, np.inf)},
            "bias0 has numbers that are not",
        ),
        ({"weight0": np.full((2, 3), "x"), "bias0": np.ones(2)}, "expected numbers, got <U1"),
        ({"weight0": np.array([None]), "bias0": np.ones(2)}, "Object arrays cannot be loaded"),
    ],
)
def test_an_npz_that_is_no_network_is_refused(tmp_path: Path, arrays: dict, match: str):
    np.savez(tmp_path / "network.npz", **arrays)
    with pytest.raises(InputError, match=rf"network\.npz: expected a network, as .*({match})"):
        read_network(tmp_path / "network.npz")


# ---------------------------------------------------------------- controller files


@pytest.fixture(scope="module")
def policy(tmp_path_factory: pytest.TempPathFactory, quadruped: Robot) -> Controller:
    return policy_of(tmp_path_factory.mktemp("policy"), quadruped)


def around(base: Controller, seed: int = 0, *, feedback: bool = True) -> Controller:
    design = Compensated.around(base, feedback=feedback)
    return Controller(design, draw_genomes(np.random.default_rng(seed), (design.weights,)))


@given(seed=st.integers(0, 99), feedback=st.booleans(), of_cpg=st.booleans())
def test_a_layer_comes_back_equal_with_the_controller_within(
    policy: Controller, quadruped: Robot, seed: int, *, feedback: bool, of_cpg: bool
):
    (cpg,) = random_cpgs(quadruped, 1, seed)
    before = around(cpg if of_cpg else policy, seed, feedback=feedback)
    data = controller_bytes(before)
    assert parse_controller(data, "here") == before
    assert controller_bytes(parse_controller(data, "here")) == data


def test_a_policy_comes_back_equal_from_a_file(
    tmp_path: Path, policy: Controller, quadruped: Robot
):
    path = tmp_path / "walk.npz"
    save_controller(path, policy)
    again = load_controller(path)

    assert again == policy
    assert controller_bytes(again) == path.read_bytes()
    assert hash(again) == hash(policy)
    assert isinstance(again.design, Policy)
    rows = np.random.default_rng(0).normal(size=(3, again.design.graph.inputs))
    assert again.design.graph(rows).tobytes() == policy.design.graph(rows).tobytes()
    assert again != policy_of(tmp_path, quadruped, POLICY.replace("0.4", "0.5"))


@pytest.mark.parametrize("cell", CELLS)
def test_a_recurrent_policy_comes_back_equal(tmp_path: Path, quadruped: Robot, cell: str):
    path = save_policy(tmp_path, quadruped, POLICY.replace("npz", "onnx"))
    saved(tmp_path, recurrent_bytes(cell, 35, 8))
    before = Controller(read_policy(path, quadruped), np.zeros(0))
    again = parse_controller(controller_bytes(before), "here")

    assert again == before
    assert again.design.graph.states == before.design.graph.states != ()


def test_weights_that_float32_lacks_and_names_of_any_kind_come_back(policy: Controller):
    graph = policy.design.graph
    names = {name: f"/actor/{name}.é" for name in graph.tensors}
    tensors = {names[name]: tensor / 3 for name, tensor in graph.tensors.items()}
    tensors[names["bias0"]] = np.full(16, 1e300)
    nodes = [
        replace(node, inputs=tuple(names.get(name, name) for name in node.inputs))
        for node in graph.nodes
    ]
    wide = replace(graph, nodes=tuple(nodes), tensors=tensors)
    design = replace(policy.design, graph=wide)
    before = Controller(design, np.zeros(0))
    assert parse_controller(controller_bytes(before), "here") == before


def text(content: bytes) -> np.ndarray:
    return np.frombuffer(content, dtype=np.uint8)


NAN = {"tensor/bias0": np.full(16, np.nan)}
OTHER_MOTORS = {"motors": np.array(["a"] * 8)}


@pytest.mark.parametrize(
    ("layer", "change", "match"),
    [
        (False, {"content": text(b'{"input": "x"')}, "truncated"),
        (False, {"content": text(b'{"input": "x"}')}, "missing required field"),
        (False, {"content": text(b"[]")}, "Expected `object`"),
        (False, {"content": None}, "it holds genome"),
        (False, {"content": np.zeros((2, 2), np.uint8)}, "its arrays have the types and ranks"),
        (False, {"kind": np.array("network")}, "it holds content"),
        (
            False,
            {"kind": np.array("tree")},
            "'network' or 'cpg' or 'policy' or 'finetuned' or 'compensation'",
        ),
        (False, {"genome": np.zeros(1)}, "has 0 weights, got a genome of shape"),
        (False, {"tensor/bias0": None}, "bias0 is used by Gemm before it is computed"),
        (False, {"xtensor/bias0": np.zeros(1)}, "it holds content"),
        (False, {"tensor/weight0": np.zeros((16, 2))}, "Gemm of the shapes"),
        (False, NAN, "the tensor bias0 has numbers that are not finite"),
        (True, {"base": text(b"PK no controller")}, "expected a controller"),
        (True, {"feedback": np.array(1)}, "its arrays have the types and ranks"),
        (True, {"base": None}, "it holds feedback"),
        (True, {"genome": np.zeros(3)}, "has 59 weights, got a genome of shape"),
        (True, OTHER_MOTORS, "the sensors, motors and ranges of the controller within"),
    ],
)
def test_an_altered_policy_or_layer_is_refused(
    policy: Controller, *, layer: bool, change: dict, match: str
):
    data = altered(controller_bytes(around(policy) if layer else policy), **change)
    with pytest.raises(InputError, match=rf"here: expected a controller .*{match}"):
        parse_controller(data, "here")


def test_layers_within_layers_are_not_unpacked(policy: Controller):
    data = controller_bytes(around(policy))
    for _ in range(3):
        data = altered(data, base=text(data))
    with pytest.raises(InputError, match=r"expected the kind .* got 'compensation'"):
        parse_controller(data, "here")
