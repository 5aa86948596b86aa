"""Policy files: a small TOML that names a network, what it observes and what it commands.

::

    network = "policy.onnx"        # beside this file; or an .npz of layers, or "module:function"
    preset = "mujoco_playground"   # terms and action of a framework; a key below replaces its own
    velocity = [1.0, 0.0, 0.0]     # commanded: forward, to the left, m/s; turn to the left, rad/s
    joints = ["FR_hip_joint"]      # in the order of the network; the robot's by default

    [[observation]]
    term = "joint_velocities"
    scale = 0.05

    [action]
    scale = 0.5
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta, Struct

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller
from selfmodel.controllers.function import Function, name_of
from selfmodel.controllers.graph import Graph, Node, State, layers
from selfmodel.controllers.policy import TASK, Action, Interface, Policy, PolicyBatch, Term
from selfmodel.errors import InputError, TrialError, check_function, unknown_name
from selfmodel.files import imported, load_toml, read_file
from selfmodel.logs.controllers import (
    MAX_CONTROLLER_BYTES,
    controller_bytes,
    npz_errors,
    read_arrays,
)
from selfmodel.robot.actuators import command_ranges, holding_commands
from selfmodel.robot.observations import OBSERVATIONS, observation_of, observation_width
from selfmodel.robot.robot import Robot

Number = Annotated[float, Meta(gt=-1e9, lt=1e9)]
Numbers = Number | tuple[Number, ...]
Count = Annotated[int, Meta(ge=1, le=1000)]
Positive = Annotated[float, Meta(gt=0, lt=1e9)]


class Section(Struct, forbid_unknown_fields=True, frozen=True):
    """Table of the file."""


class Observed(Section, frozen=True):
    """A term of the observation; see ``selfmodel.controllers.policy.Term``."""

    term: str
    scale: Numbers = 1.0
    offset: Numbers = 0.0


class Commanded(Section, frozen=True):
    """Targets from the output; see ``selfmodel.controllers.policy.Action``.

    By default, the motors are the robot's, and the offset is their commands of the initial pose.
    """

    scale: Numbers | None = None
    offset: Numbers | None = None
    motors: tuple[str, ...] = ()
    clip: Positive | None = None


class PolicyFile(Section, frozen=True):
    """The file; see ``selfmodel.controllers.policy.Policy``.

    Attributes:
        network: File of the network beside this one, ``.onnx`` or ``.npz``, or the name of a
            function, ``package.module:function``; "" for one that is given beside the file.
        preset: Key of ``PRESETS``.
        activation: Operator between the layers of an ``.npz``, ``last`` that after them.
        pose: Positions of ``joints`` that count as 0, rad; the initial pose by default.
        newest_first: Whether a history begins with the newest observation; ``by_term``, whether it
            is stacked term by term.
        batched: Whether a function takes the observations of many robots, ``(n, inputs)``.
        task: Observation of the term ``task``, a key of ``robot.observations``; that of a body of
            dm_control's suite by default.
    """

    network: str = ""
    preset: str = ""
    activation: str = "Elu"
    last: str = "Identity"
    observation: tuple[Observed, ...] = ()
    action: Commanded = Commanded()
    joints: tuple[str, ...] = ()
    pose: tuple[Number, ...] = ()
    velocity: tuple[Number, ...] = (0.0, 0.0, 0.0)
    history: Count = 1
    by_term: bool = False
    newest_first: bool = False
    decimation: Count = 1
    period: Positive | None = None
    batched: bool = False
    task: str = ""


def _terms(*terms: str, **scales: Numbers) -> tuple[Observed, ...]:
    return tuple(Observed(term, scales.get(term, 1.0)) for term in terms)


_LEGGED_GYM: Mapping[str, Numbers] = {
    "linear_velocity": 2.0,
    "angular_velocity": 0.25,
    "velocity": (2.0, 2.0, 0.25),
    "joint_velocities": 0.05,
}

_BODY = ("linear_velocity", "angular_velocity", "gravity")
_JOINTS = ("joint_positions", "joint_velocities", "last_action")

PRESETS: Mapping[str, tuple[tuple[Observed, ...], float, float]] = {
    "mujoco_playground": (_terms(*_BODY, *_JOINTS, "velocity"), 0.5, 1.0),
    "isaac_lab": (_terms(*_BODY, "velocity", *_JOINTS), 0.5, 1.0),
    "legged_gym": (_terms(*_BODY, "velocity", *_JOINTS, **_LEGGED_GYM), 0.25, 1.0),
    "unitree_rl_gym": (
        _terms(*_BODY[1:], "velocity", *_JOINTS, "phase", **_LEGGED_GYM),
        0.25,
        0.8,
    ),
}
"""Terms of the observation, scale of the action, and period of the clock, s, by the framework that
trains the policy."""


def read_policy(
    source: Path | Mapping[str, Any], robot: Robot, function: Callable[[Any], Any] | None = None
) -> Policy:
    """Returns the policy of a robot that a TOML file describes, or its keys and values.

    A function from an observation to an action is in the place of its network, if given.

    Raises:
        InputError: A file cannot be read or is invalid, or the policy does not fit the robot; the
            message names the file and what does not fit. Or a function fails on the initial pose.
    """
    what, named, path, data = "a policy file", "the policy", Path(), b""
    if isinstance(source, Path):
        named, path, data = str(source), source, read_file(source, what, 2**20)
    try:
        keys = load_toml(data.decode()) if isinstance(source, Path) else source
        file = msgspec.convert(keys, PolicyFile)
    # No ValueError in msgspec 0.19.
    except (ValueError, msgspec.ValidationError) as failure:
        raise InputError(f"{named}: expected {what} as TOML: {failure}") from failure
    if file.preset and file.preset not in PRESETS:
        raise InputError(f"{named}: {unknown_name('preset', file.preset, PRESETS)}")
    graph = _network(file, path.parent, named, function)
    try:
        policy = policy_of(file, graph, robot)
        if isinstance(policy.graph, Function):
            policy.graph.check(_initial_observation(policy, robot))
    except (ValueError, TrialError) as failure:
        raise InputError(f"{named} does not fit {robot.name}: {failure}") from failure
    if policy.function:
        return policy
    # A log has it as a file of its own, and a layer around it in another.
    size = len(controller_bytes(Controller(policy, np.zeros(0))))
    if size > MAX_CONTROLLER_BYTES // 2:
        raise InputError(
            f"{named}: expected a policy of at most {MAX_CONTROLLER_BYTES // 2} bytes in a log, "
            f"got {size}: export a smaller network"
        )
    return policy


def _network(
    file: PolicyFile, folder: Path, named: str, function: Callable[[Any], Any] | None
) -> Graph | Function:
    """Returns the network of a policy, or its function, without the number of outputs."""
    name = file.network
    if function is None and ":" in name:
        function = imported(name, "function")
    if function is not None:
        check_function(name or "a policy", function)
        name = name if ":" in name else name_of(function)
        return Function(name, function, 0, file.batched)
    if not name or Path(name).name != name:
        raise InputError(
            f"{named}: expected network, the name of a file beside this one or a "
            f"package.module:function, got {name!r}: copy the file here, and name it"
        )
    return read_network(folder / name, file.activation, file.last)


def _initial_observation(policy: Policy, robot: Robot) -> FloatArray:
    """Returns what a policy observes of a robot at rest in its initial pose, ``(inputs,)``."""
    batch, model = PolicyBatch(policy, 1), robot.model
    pose = [model.qpos0[model.joint(name).qposadr[0]] for name in robot.anatomy.hinges]
    for signal, values in batch.observed.items():
        values[:] = {"base_orientation": [1, 0, 0, 0], "joint_positions": pose}.get(signal, [0])
    return np.asarray(batch.observation()[0])


def policy_of(file: PolicyFile, graph: Graph | Function, robot: Robot) -> Policy:
    """Returns the policy of a file and its network; raises ``ValueError`` if it does not fit."""
    names, model = robot.anatomy.names, robot.model
    terms, scale, period = PRESETS.get(file.preset, ((), 1.0, 1.0))
    action = file.action
    motors, joints = action.motors or names.motors, file.joints or names.hinges
    if isinstance(graph, Function):
        graph = replace(graph, outputs=len(motors))
    # A name that is unknown is refused by the policy.
    holding = dict(zip(names.motors, holding_commands(model).tolist(), strict=True))
    initial = {name: float(model.qpos0[model.joint(name).qposadr[0]]) for name in names.hinges}
    given = scale if action.scale is None else action.scale
    offset = [holding.get(name, 0.0) for name in motors] if action.offset is None else action.offset
    return Policy(
        *(names.sensors, names.motors),
        ranges=command_ranges(model),
        graph=graph,
        interface=Interface(
            terms=tuple(
                Term(each.term, _row(each.scale), _row(each.offset))
                for each in file.observation or terms
            ),
            action=Action(
                motors=motors,
                scale=_row(given, len(motors)),
                offset=_row(offset, len(motors)),
                clip=action.clip,
            ),
            hinges=names.hinges,
            joints=joints,
            pose=file.pose or tuple(initial.get(name, 0.0) for name in joints),
            holding=tuple(holding.values()),
            timestep=robot.control_timestep,
            velocity=file.velocity,
            history=file.history,
            by_term=file.by_term,
            newest_first=file.newest_first,
            decimation=file.decimation,
            period=file.period or period,
            **_task(file, robot),
        ),
    )


def _task(file: PolicyFile, robot: Robot) -> dict[str, Any]:
    """Returns the fields of an interface for the observation of a task, if a policy has it."""
    if not file.task and all(each.term != TASK for each in file.observation):
        return {}
    if not (key := file.task or observation_of(robot.name)):
        raise InputError(
            f"{robot.name} is no body whose task has an observation: give task = one of "
            f"{', '.join(OBSERVATIONS)}"
        )
    return {"task": key, "task_width": observation_width(key, robot.model)}


def _row(numbers: Numbers | Sequence[float], count: int = 1) -> tuple[float, ...]:
    row = (numbers,) * count if isinstance(numbers, float | int) else numbers
    return tuple(map(float, row))


# ---------------------------------------------------------------- networks


def read_network(path: Path, activation: str = "Elu", last: str = "Identity") -> Graph:
    """Returns the network in an ``.onnx`` file, or in an ``.npz`` of layers.

    Such an archive has the arrays ``weight0``, ``(outputs, inputs)``, ``bias0``, ``weight1`` and so
    on. The operators are those between its layers, and after its last one.

    Raises:
        InputError: The file cannot be read, or has another content; the message names the file.
    """
    if path.suffix.lower() not in (".onnx", ".npz"):
        raise InputError(
            f"expected a network as .onnx or .npz, got {path}: export it as ONNX, such as with "
            f"torch.onnx.export"
        )
    data = read_file(path, "a network", MAX_CONTROLLER_BYTES)
    if path.suffix.lower() == ".onnx":
        return _of_onnx(data, path)
    with npz_errors(str(path), "a network, as .onnx or as .npz of weight0, bias0, weight1, ..."):
        arrays = read_arrays(data, MAX_CONTROLLER_BYTES)
        count = len(arrays) // 2
        if not count or arrays.keys() != {
            f"{of}{k}" for of in ("weight", "bias") for k in range(count)
        }:
            raise ValueError(f"it holds {', '.join(sorted(arrays)) or 'nothing'}")
        pairs = [(arrays[f"weight{k}"], arrays[f"bias{k}"]) for k in range(count)]
        if any((w.ndim, b.ndim) != (2, 1) for w, b in pairs):
            raise ValueError("expected weights of (outputs, inputs), and biases of (outputs,)")
        return layers([(_numbers(w), _numbers(b)) for w, b in pairs], activation, last)


def _numbers(array: np.ndarray) -> FloatArray:
    if array.dtype.kind not in "fiu":
        raise ValueError(f"expected numbers, got {array.dtype}")
    return np.asarray(array, dtype=np.float64)


def _of_onnx(data: bytes, path: Path) -> Graph:
    try:
        import onnx  # noqa: PLC0415  # optional
        from google.protobuf.message import DecodeError  # noqa: PLC0415  # comes with onnx
    except ImportError as error:
        raise InputError(
            f"{path} needs the package onnx, which is not installed: pip install 'selfmodel[onnx]'"
        ) from error
    try:
        return _graph(onnx.load_model_from_string(data).graph)
    except (ValueError, TypeError, IndexError, KeyError, DecodeError) as failure:
        raise InputError(f"{path}: expected a network as ONNX: {failure}") from failure


def _graph(network: Any) -> Graph:  # noqa: ANN401  # onnx is optional
    from onnx import TensorProto, numpy_helper  # noqa: PLC0415  # optional

    constants = [
        (node.output[0], attribute)
        for node in network.node
        for attribute in node.attribute
        if node.op_type == "Constant"
    ]
    values = [(tensor.name, tensor) for tensor in network.initializer]
    values += [(name, attribute.t) for name, attribute in constants if attribute.name == "value"]
    if any(tensor.data_location == TensorProto.EXTERNAL for _, tensor in values):
        raise ValueError("its weights are in another file: export it with weights inside")
    tensors = {name: _numbers(numpy_helper.to_array(tensor)) for name, tensor in values}
    tensors |= {
        name: np.array(attribute.floats or attribute.f, dtype=np.float64)
        for name, attribute in constants
        if attribute.name in ("value_float", "value_floats")
    }
    inputs = [each for each in network.input if each.name not in tensors]
    kept_on = inputs[1:]
    if not inputs or len(network.output) < 1 + len(kept_on):
        raise ValueError(
            f"expected one input and an output, and both for each state of a recurrent network, "
            f"got the inputs {', '.join(each.name for each in inputs) or 'none'} and the outputs "
            f"{', '.join(each.name for each in network.output) or 'none'}"
        )
    nodes = [_node(node, tensors) for node in network.node if node.op_type != "Constant"]
    shapes = [each.type.tensor_type.shape.dim for each in (inputs[0], network.output[0])]
    width, outputs = (int(shape[-1].dim_value) if len(shape) else 0 for shape in shapes)
    if not width:
        raise ValueError("its input has no fixed size: export it with one")
    if any(one.dim_value > 1 for one in shapes[0][:-1]):
        raise ValueError(
            f"expected an input of one row of numbers, got "
            f"{[one.dim_value or one.dim_param for one in shapes[0]]}"
        )
    states = tuple(
        State(before.name, after.name, _state_width(before))
        for before, after in zip(kept_on, network.output[1:], strict=False)
    )
    used = {name for node in nodes for name in node.inputs}
    kept = {name: tensor for name, tensor in tensors.items() if name in used}
    ends = inputs[0].name, network.output[0].name
    return Graph(*ends, width, outputs, tuple(nodes), kept, states)


def _state_width(value: Any) -> int:  # noqa: ANN401  # onnx is optional
    """Returns the numbers a row of a recurrent state: of one layer, for one robot."""
    sizes = [int(one.dim_value) for one in value.type.tensor_type.shape.dim]  # 0: open
    if len(sizes) != 3 or sizes[0] != 1 or sizes[1] > 1 or not sizes[2]:
        raise ValueError(
            f"expected a state of one layer, (1, 1, width), in the input {value.name}, got {sizes}"
        )
    return sizes[2]


_USUAL = ([b"Sigmoid", b"Tanh", b"Tanh"], [b"Sigmoid", b"Tanh"])
"""Activations of an LSTM and of a GRU."""


def _node(node: Any, tensors: dict[str, FloatArray]) -> Node:  # noqa: ANN401  # onnx is optional
    """Returns an operator; a constant second factor is stored as its rows are summed."""
    from onnx import helper  # noqa: PLC0415  # optional

    attributes: dict[str, float | tuple[float, ...]] = {}
    for attribute in node.attribute:
        value = helper.get_attribute_value(attribute)
        if attribute.name == "activations" and value not in _USUAL:
            raise ValueError(f"the activations {value} of {node.op_type} are not supported")
        if attribute.name == "direction" and value != b"forward":
            raise ValueError(f"the direction {value.decode()} of {node.op_type} is not supported")
        if isinstance(value, bytes):
            continue
        if isinstance(value, float | int):
            attributes[attribute.name] = float(value)
        elif isinstance(value, Sequence) and all(isinstance(one, float | int) for one in value):
            attributes[attribute.name] = tuple(map(float, value))
    operator, inputs = str(node.op_type), tuple(node.input)
    is_product = operator in ("MatMul", "Gemm") and not attributes.get("transB")
    if is_product and inputs[1] in tensors:
        turned = f"{inputs[1]}.T"
        tensors[turned] = np.ascontiguousarray(tensors[inputs[1]].T)
        operator, inputs = "Gemm", (inputs[0], turned, *inputs[2:])
        attributes["transB"] = 1.0
    return Node(operator, inputs, tuple(node.output), tuple(sorted(attributes.items())))
