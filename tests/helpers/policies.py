"""Small random networks, policies and policy files for the tests of policies."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType

import numpy as np
import onnx
from onnx import TensorProto, ValueInfoProto, helper, numpy_helper

from selfmodel.controllers.controller import Controller, Design
from selfmodel.controllers.graph import Graph, layers
from selfmodel.controllers.policy import JOINT_TERMS, Action, Interface, Policy, Term
from selfmodel.logs.policies import read_policy
from selfmodel.robot.robot import Robot
from selfmodel.trials.signals import SIGNALS

Layers = list[tuple[np.ndarray, np.ndarray]]

# ---------------------------------------------------------------- a made-up robot

SENSORS, HINGES, MOTORS = ("touch", "angle"), ("hip", "free", "knee"), ("hip", "tail", "knee")
RANGES = ((0.5, 0.75), (0.0, 1.0), (-1.0, 0.5))
INTERFACE = Interface(
    terms=tuple(map(Term, ("gravity", "joint_positions", "last_action", "velocity"))),
    action=Action(motors=("knee", "hip"), scale=(0.1, 0.2), offset=(-0.9, 0.4)),
    hinges=HINGES,
    joints=("knee", "hip"),
    pose=(-0.9, 0.4),
    holding=(0.3, 0.2, -0.8),
    timestep=0.02,
    velocity=(0.5, -0.1, 0.2),
)


def policy(*terms: str | Term, graph: Graph | None = None, **changes: object) -> Policy:
    """Returns a policy of these terms, or the usual ones, with a random network that fits."""
    named = tuple(Term(each) if isinstance(each, str) else each for each in terms)
    own = replace(INTERFACE, **({"terms": named} if terms else {}), **changes)
    two = (*JOINT_TERMS, "last_action", "phase", "sensors")
    size = own.history * sum(2 if term.name in two else 3 for term in own.terms)
    network = graph or random_network(size, 8, len(own.action.motors))
    return Policy(SENSORS, MOTORS, ranges=RANGES, graph=network, interface=own)


def constant(*outputs: float, inputs: int = 3) -> Graph:
    """Returns a network whose output is always the same."""
    return layers([(np.zeros((len(outputs), inputs)), np.array(outputs))], "Tanh")


def feel(batch: object, seed: int, rows: slice = slice(None), count: int | None = None) -> None:
    """Writes random signals into a batch: those of some rows of ``count``."""
    for signal, values in {"sensors": batch.readings, **batch.observed}.items():
        rng = np.random.default_rng((seed, SIGNALS.index(signal)))
        drawn = rng.normal(size=(count or len(values), values.shape[1]))
        if signal == "base_orientation":
            drawn /= np.linalg.norm(drawn, axis=1, keepdims=True)
        values[:] = drawn[rows]


def commanded(
    design: Design, genomes: np.ndarray | None = None, steps: int = 8, **rows: object
) -> np.ndarray:
    """Returns the commands, ``(steps, n, motors)``, for random signals."""
    genomes = np.empty((1, 0)) if genomes is None else genomes
    batch = design.batch(genomes, [frozenset()] * len(genomes))
    commands = np.empty((steps, len(genomes), len(design.motors)))
    for k in range(steps):
        feel(batch, k, **rows)
        batch.step(commands[k])
    return commands


# ---------------------------------------------------------------- networks


def random_layers(*sizes: int, seed: int = 0) -> Layers:
    """Returns matrices and biases of dense layers of these sizes, in float32."""
    rng = np.random.default_rng(seed)
    return [
        tuple(
            rng.normal(size=size, scale=inputs**-0.5).astype(np.float32)
            for size in ((outputs, inputs), outputs)
        )
        for inputs, outputs in pairwise(sizes)
    ]


def random_network(*sizes: int, seed: int = 0, activation: str = "Tanh") -> Graph:
    """Returns a network of dense layers of these sizes."""
    pairs = random_layers(*sizes, seed=seed)
    return layers([(w.astype(float), b.astype(float)) for w, b in pairs], activation)


RNG = np.random.default_rng(5)
CELLS: dict[str, tuple[str, dict[str, tuple[str, int]], int]] = {
    "LSTM": ("LSTM<hidden_size=4>", {"h": ("h1", 4), "c": ("c1", 4)}, 4),
    "GRU": ('GRU<hidden_size=4, linear_before_reset=1, direction="forward">', {"h": ("h1", 4)}, 3),
    "plain GRU": ("GRU<hidden_size=4>", {"h": ("h1", 4)}, 3),
}
"""Recurrent cells as ONNX's text, their states, and their numbers of gates."""


def recurrent_bytes(cell: str, inputs: int, outputs: int) -> bytes:
    """Returns a model with a cell of four numbers and a layer, as frameworks export it."""
    text, states, gates = CELLS[cell]
    sizes = {"w": (1, gates * 4, inputs), "r": (1, gates * 4, 4), "b": (1, gates * 8)}
    sizes |= {"out": (outputs, 4), "bias": (outputs,)}
    tensors = {name: RNG.normal(size=size).astype(np.float32) for name, size in sizes.items()}
    tensors |= {"zero": np.array([0]), "one": np.array([1])}
    ends = ", ".join(after for after, _ in states.values())
    code = (
        f'u = Unsqueeze(x, zero); q, {ends} = {text}(u, w, r, b, "", {", ".join(states)}); '
        "s = Squeeze(q, one); t = Squeeze(s, zero); e = Elu(t); y = Gemm<transB=1>(e, out, bias)"
    )
    return onnx_bytes(code, tensors, inputs, outputs, states=states)


def save_layers(folder: Path, pairs: Layers) -> Path:
    """Writes ``network.npz`` of layers."""
    arrays = {f"weight{k}": weight for k, (weight, _) in enumerate(pairs)}
    path = folder / "network.npz"
    np.savez(path, **arrays, **{f"bias{k}": bias for k, (_, bias) in enumerate(pairs)})
    return path


def onnx_bytes(
    code: str,
    tensors: Mapping[str, np.ndarray],
    inputs: int,
    outputs: int,
    *,
    states: Mapping[str, tuple[str, int]] = MappingProxyType({}),
    layers: int = 1,
) -> bytes:
    """Returns a model from ``x`` to ``y``, whose number of rows is open.

    The code has ONNX's text of each operator, separated by ``;``. A state has the name of its
    input, and that of its output and its width.
    """

    def value(name: str, *sizes: int | str) -> ValueInfoProto:
        return helper.make_tensor_value_info(name, TensorProto.FLOAT, sizes)

    nodes = [onnx.parser.parse_node(line) for line in code.split(";")]
    used = {name for node in nodes for name in node.input}
    before = [value(name, layers, "rows", width) for name, (_, width) in states.items()]
    after = [value(name, layers, "rows", width) for name, width in states.values()]
    graph = helper.make_graph(
        nodes,
        "network",
        [value("x", "rows", inputs), *before],
        [value("y", "rows", outputs), *after],
        [numpy_helper.from_array(each, name) for name, each in tensors.items() if name in used],
    )
    opset = [helper.make_opsetid("", 18)]
    model = helper.make_model(graph, opset_imports=opset, ir_version=8)
    onnx.checker.check_model(model)
    return model.SerializeToString()


# ---------------------------------------------------------------- policy files

TERMS = (
    *("angular_velocity", "gravity", "velocity"),
    *("joint_positions", "joint_velocities", "last_action", "phase"),
)
POLICY = 'network = "network.npz"\nactivation = "Tanh"\naction.scale = 0.4\n' + "".join(
    f'[[observation]]\nterm = "{term}"\n' for term in TERMS
)
"""A policy file for any robot, of ``save_policy``."""


def save_policy(folder: Path, robot: Robot, text: str = POLICY) -> Path:
    """Writes a policy file, and a small random network that fits ``POLICY``."""
    hinges, motors = len(robot.anatomy.hinges), len(robot.anatomy.motors)
    save_layers(folder, random_layers(3 * 3 + 2 * hinges + motors + 2, 16, motors))
    path = folder / "policy.toml"
    path.write_text(text)
    return path


def policy_of(folder: Path, robot: Robot, text: str = POLICY) -> Controller:
    """Returns the controller of ``save_policy``."""
    return Controller(read_policy(save_policy(folder, robot, text), robot), np.zeros(0))
