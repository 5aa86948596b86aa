"""Promises of networks that others trained: their outputs are those of onnxruntime."""

import ast
import importlib.util
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
from onnx import TensorProto, numpy_helper

from selfmodel.logs.policies import read_network
from tests.helpers.policies import onnx_bytes

GO1 = Path(__file__).parents[3] / "shared" / "samples" / "go1-policy" / "go1_policy.onnx"
BULLET = ("Ant", "HalfCheetah", "Walker2D")
"""Bodies of policies in the examples of PyBullet's wheel."""


def bullet_bytes(name: str) -> bytes:
    """Returns a policy of PyBullet's examples, two layers of ReLU and a linear one, as ONNX.

    Its file is parsed and not imported, which would need OpenAI's Gym.
    """
    found = importlib.util.find_spec("pybullet_envs")
    if found is None:
        pytest.skip("PyBullet is not installed")
    folder = Path(found.submodule_search_locations[0]) / "examples"
    text = (folder / f"enjoy_TF_{name}BulletEnv_v0_2017may.py").read_text(encoding="utf-8")
    given = {
        node.targets[0].id: node.value.args[0]
        for node in ast.parse(text).body
        if isinstance(node, ast.Assign)
    }
    names = [f"weights_{layer}_{of}" for layer in ("dense1", "dense2", "final") for of in "wb"]
    arrays = {name: np.array(ast.literal_eval(given[name]), np.float32) for name in names}
    code = (
        f"p = Gemm(x, {names[0]}, {names[1]}); q = Relu(p); "
        f"r = Gemm(q, {names[2]}, {names[3]}); s = Relu(r); y = Gemm(s, {names[4]}, {names[5]})"
    )
    return onnx_bytes(code, arrays, len(arrays[names[0]]), len(arrays[names[-1]]))


def network_bytes(name: str) -> bytes:
    """Returns a policy as ONNX, that of mujoco_playground's Go1 or one of PyBullet's."""
    if name != "Go1":
        return bullet_bytes(name)
    if not GO1.exists():
        pytest.skip(f"{GO1} is a file of others, and not in this repository")
    return GO1.read_bytes()


def in_float64(data: bytes) -> bytes:
    """Returns a network that is computed in float64: its inputs, outputs and tensors are."""
    model = onnx.load_model_from_string(data)
    for value in (*model.graph.input, *model.graph.output, *model.graph.value_info):
        value.type.tensor_type.elem_type = TensorProto.DOUBLE
    constants = (one.t for node in model.graph.node for one in node.attribute if one.HasField("t"))
    for tensor in (*model.graph.initializer, *constants):
        if tensor.data_type == TensorProto.FLOAT:
            values = numpy_helper.to_array(tensor).astype(np.float64)
            tensor.CopyFrom(numpy_helper.from_array(values, tensor.name))
    return model.SerializeToString()


def onnxruntime_outputs(data: bytes, rows: np.ndarray) -> np.ndarray:
    """Returns onnxruntime's output for each row, one by one: some networks take one row only."""
    session = onnxruntime.InferenceSession(data)
    (given,) = session.get_inputs()
    return np.concatenate([session.run(None, {given.name: row[np.newaxis]})[0] for row in rows])


@pytest.mark.parametrize("name", ["Go1", *BULLET])
def test_outputs_of_a_public_policy_are_those_of_onnxruntime(tmp_path: Path, name: str):
    data = network_bytes(name)
    path = tmp_path / "network.onnx"
    path.write_bytes(data)
    network = read_network(path)
    rows = np.random.default_rng(0).normal(size=(1000, network.inputs)).astype(np.float32)
    single, double = (
        onnxruntime_outputs(*each)
        for each in ((data, rows), (in_float64(data), rows.astype(float)))
    )
    own, largest = network(rows.astype(float)), float(np.abs(double).max())

    np.testing.assert_allclose(own, double, rtol=0, atol=1e-13 * largest)
    # Its own error in float32: that of a tanh is 3e-6, of layers of ReLU 2e-7.
    np.testing.assert_allclose(
        own, single, rtol=0, atol=(4e-6 if name == "Go1" else 1e-6) * largest
    )
    assert np.abs(own - single).mean() < 5e-7 * largest
