"""Policies whose weights are evolved: all of a network, or a few numbers of its last layer."""

import json
from abc import abstractmethod
from collections.abc import Mapping, Sequence, Set as AbstractSet
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Design
from selfmodel.controllers.graph import Graph, Node
from selfmodel.controllers.policy import Policy, PolicyBatch

FINETUNED_SPAN = 0.5
"""Largest change of an output of the last layer for a feature of its usual size."""

MAX_FEATURE = 1e6
"""Largest magnitude of a number of a feature."""

SAMPLES = 16
"""Inputs with which it is tried what an output depends on."""

TURNED = ".T"
"""End of the names of weights that are transposed in their ONNX file."""

LAYER_HEADER = """\
# The last layer of a policy, as selfmodel fine-tuned it:
# {within}.
#
# Add change to the tensor of this name in the network; it has the same shape.
"""
"""Head of a layer file."""


@dataclass(frozen=True)
class Evolved(Policy):
    """A policy whose genome is a change of the weights of its network; zeros change nothing."""

    graph: Graph

    @abstractmethod
    def tensors(self, genomes: FloatArray) -> Mapping[str, FloatArray]:
        """Returns the changed weights of genomes, ``(n, ...)`` by name, given ``(n, weights)``."""

    def batch(self, genomes: FloatArray, _silent: Sequence[AbstractSet[int]]) -> PolicyBatch:
        """Returns the batch of the policies of some genomes; see ``Design.batch``."""
        return PolicyBatch(self, len(genomes), self.tensors(genomes))

    def policy(self, genome: FloatArray) -> Policy:
        """Returns the policy of a genome, ``(weights,)``, with its weights in the network."""
        own = {name: rows[0] for name, rows in self.tensors(genome[np.newaxis]).items()}
        kept = {each.name: getattr(self, each.name) for each in fields(Policy)}
        graph = replace(self.graph, tensors={**self.graph.tensors, **own})
        return Policy(**{**kept, "graph": graph})


@dataclass(frozen=True)
class Trained(Evolved):
    """A policy whose genome is a change of all weights of its network.

    A weight is that of the network plus ``span``, its largest change, times the genome's value.
    """

    name: ClassVar[str] = "trained"

    span: float = field(kw_only=True)

    @property
    def weights(self) -> int:
        """Length of a genome."""
        return self.graph.weights

    def tensors(self, genomes: FloatArray) -> Mapping[str, FloatArray]:
        """Returns the weights of genomes; see ``Evolved``."""
        own = self.graph.tensors
        ends = np.cumsum([tensor.size for tensor in own.values()])[:-1]
        parts = np.split(self.span * genomes, ends, axis=1)
        return {
            name: tensor + part.reshape(len(genomes), *tensor.shape)
            for (name, tensor), part in zip(own.items(), parts, strict=True)
        }


@dataclass(frozen=True)
class Finetuned(Evolved):
    """A policy whose genome is a change of low rank of the last layer of its network.

    The change of the weights of that layer, ``(outputs, inputs)``, is the product of the genome,
    ``(driven, rank)``, and the features, times ``FINETUNED_SPAN``. Source of the idea: Hu et al.,
    *LoRA: low-rank adaptation of large language models* (arXiv:2106.09685).

    Attributes:
        features: Directions of the inputs of the layer, ``(rank, inputs)``, of the inverse length
            of what a robot that walks has along them.

    Raises:
        ValueError: The network has no layer of weights, or another width.
    """

    name: ClassVar[str] = "finetuned"

    features: tuple[tuple[float, ...], ...] = field(kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        width = self.graph.tensors[last_layer(self.graph).weight].shape[1]
        if not self.features or {len(row) for row in self.features} != {width}:
            raise ValueError(f"expected features of {width} numbers, the inputs of its last layer")
        if not np.all(np.abs(self.features) <= MAX_FEATURE):  # NaN is not
            raise ValueError(f"expected features of at most {MAX_FEATURE:g}")

    @classmethod
    def of(cls, policy: Policy, features: FloatArray) -> "Finetuned":
        """Returns the design around a policy with a network, whose zeros are that policy."""
        own = {each.name: getattr(policy, each.name) for each in fields(Policy)}
        return cls(**own, features=tuple(map(tuple, features.tolist())))

    @cached_property
    def driven(self) -> list[int]:
        """Outputs of the last layer that those of the network depend on."""
        return _driven(self.graph)

    @property
    def weights(self) -> int:
        """Length of a genome."""
        return len(self.driven) * len(self.features)

    def tensors(self, genomes: FloatArray) -> Mapping[str, FloatArray]:
        """Returns the weights of the last layer of genomes; see ``Evolved``."""
        weight = last_layer(self.graph).weight
        own = self.graph.tensors[weight]
        numbers = genomes.reshape(len(genomes), len(self.driven), len(self.features))
        change = np.zeros((len(genomes), *own.shape))
        product = np.einsum("ndr,ri->ndi", numbers, np.array(self.features))
        change[:, self.driven] = FINETUNED_SPAN * product
        return {weight: own + change}

    def summary(self, genome: FloatArray) -> str:
        """Returns the description of the policy, with the size of the change."""
        own = super().summary(genome)
        if not genome.any():
            return own
        size = np.sqrt(np.mean(np.square(FINETUNED_SPAN * genome)))
        return f"{own}, with {self.weights} numbers of its last layer changed by {size:.2f}"

    def layer_file(self, genome: FloatArray) -> str:
        """Returns the change of the weights of a genome as TOML, for other software."""
        weight = last_layer(self.graph).weight
        change = self.tensors(genome[np.newaxis])[weight][0] - self.graph.tensors[weight]
        if weight.endswith(TURNED):  # as in the ONNX file
            weight, change = weight.removesuffix(TURNED), change.T
        rows = "".join(f"    {row},\n" for row in change.tolist())
        head = LAYER_HEADER.format(within=" ".join(super().summary(genome).split()))
        return f"{head}\ntensor = {json.dumps(weight)}\nchange = [\n{rows}]\n"


@dataclass(frozen=True)
class LastLayer:
    """The last layer of weights that the output of a network depends on.

    Attributes:
        weight: Name of its weights, ``(outputs, inputs)``.
        after: Operators between it and the output of the network.
    """

    input: str
    weight: str
    output: str
    after: tuple[Node, ...]


def last_layer(graph: Graph) -> LastLayer:
    """Returns the last layer of weights of a network.

    Raises:
        ValueError: It has none.
    """
    needed, after = {graph.output}, list[Node]()
    for node in reversed(graph.nodes):
        if needed.isdisjoint(node.outputs):
            continue
        if node.operator == "Gemm" and dict(node.attributes).get("transB"):
            own = node.inputs[0], node.inputs[1], node.outputs[0]
            return LastLayer(*own, after=tuple(after[::-1]))
        needed.update(node.inputs)
        after.append(node)
    raise ValueError("the network has no layer of weights to fine-tune")


def network_of(design: Design) -> Graph:
    """Returns the network of a policy, with a layer of weights.

    Raises:
        ValueError: It is another design, or has a function or no such layer.
    """
    graph = design.graph if isinstance(design, Policy) else None
    if not isinstance(graph, Graph):
        raise ValueError(f"expected a policy with a network, got {design.description}")  # noqa: TRY004
    last_layer(graph)
    return graph


def _driven(graph: Graph) -> list[int]:
    """Returns the outputs of the last layer that the output of a network depends on.

    What follows the layer is tried with small numbers, which saturate nothing; all outputs count
    where it needs other values too.
    """
    layer = last_layer(graph)
    count = len(graph.tensors[layer.weight])
    try:
        rest = Graph(layer.output, graph.output, count, 0, layer.after, graph.tensors)
    except ValueError:
        return list(range(count))
    small = 0.1 * np.random.default_rng(0).standard_normal((SAMPLES, 1, count))
    moved = small + 0.05 * np.eye(count)
    differs = rest(moved.reshape(-1, count)) != np.repeat(rest(small[:, 0]), count, axis=0)
    return np.flatnonzero(differs.any(axis=1).reshape(SAMPLES, count).any(axis=0)).tolist()


def initial_layers(
    inputs: int, hidden: int, outputs: int, rng: np.random.Generator
) -> list[tuple[FloatArray, FloatArray]]:
    """Returns the layers of a network whose output is 0, with 0 or one layer of hidden neurons."""
    last = np.zeros((outputs, hidden or inputs)), np.zeros(outputs)
    if not hidden:
        return [last]
    return [(rng.standard_normal((hidden, inputs)) / np.sqrt(inputs), np.zeros(hidden)), last]
