"""Policies whose weights are evolved: all of a network, or a few numbers of its last layer."""

import json
from abc import abstractmethod
from collections.abc import Mapping, Sequence, Set as AbstractSet
from dataclasses import dataclass, field, fields, replace
from typing import ClassVar

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Design
from selfmodel.controllers.graph import Graph
from selfmodel.controllers.policy import Policy, PolicyBatch

FINETUNED_SPAN = 0.5
"""Largest change of an output of the last layer for a feature of its usual size."""

LAYER_HEADER = """\
# The last layer of a policy, as selfmodel fine-tuned it:
# {within}.
#
#   output = (weights + change) input + bias
#
# tensor: name of the weights in the network. change: rows are outputs, columns inputs.
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

    A weight is that of the network plus ``span`` times the value of the genome.

    Attributes:
        span: Largest change of a weight.
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
        driven: Outputs of the layer that are changed.

    Raises:
        ValueError: The network has no layer of weights, or another width.
    """

    name: ClassVar[str] = "finetuned"

    features: tuple[tuple[float, ...], ...] = field(kw_only=True)
    driven: tuple[int, ...] = field(kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        outputs, inputs = self._matrix.shape
        if not self.features or {len(row) for row in self.features} != {inputs}:
            raise ValueError(f"expected features of {inputs} numbers, those of its last layer")
        if not self.driven or not {*self.driven} <= {*range(outputs)}:
            raise ValueError(f"expected some of the {outputs} outputs of its last layer")

    @classmethod
    def of(cls, policy: Policy, features: FloatArray) -> "Finetuned":
        """Returns the design around a policy with a network, whose zeros are that policy.

        Args:
            policy: The policy.
            features: Directions, ``(rank, inputs)``; see the class.
        """
        own = {each.name: getattr(policy, each.name) for each in fields(Policy)}
        rows = tuple(map(tuple, features.tolist()))
        return cls(**own, features=rows, driven=_driven(network_of(policy)))

    @property
    def _matrix(self) -> FloatArray:
        """Weights of the last layer, ``(outputs, inputs)``."""
        layer = last_layer(self.graph)
        return layer.rows(self.graph.tensors[layer.weight])

    @property
    def weights(self) -> int:
        """Length of a genome."""
        return len(self.driven) * len(self.features)

    def tensors(self, genomes: FloatArray) -> Mapping[str, FloatArray]:
        """Returns the weights of the last layer of genomes; see ``Evolved``."""
        layer, own = last_layer(self.graph), self._matrix
        change = np.zeros((len(genomes), *own.shape))
        numbers = genomes.reshape(len(genomes), len(self.driven), len(self.features))
        product = np.einsum("ndr,ri->ndi", numbers, np.array(self.features))
        change[:, list(self.driven)] = FINETUNED_SPAN * product
        return {layer.weight: layer.rows(own + change)}

    def summary(self, genome: FloatArray) -> str:
        """Returns the description of the policy, with the size of the change."""
        own = super().summary(genome)
        if not genome.any():
            return own
        size = np.sqrt(np.mean(np.square(FINETUNED_SPAN * genome)))
        return f"{own}, with {self.weights} numbers of its last layer changed by {size:.2f}"

    def layer_file(self, genome: FloatArray) -> str:
        """Returns the change of the weights of a genome as TOML, for other software."""
        layer, own = last_layer(self.graph), self._matrix
        changed = layer.rows(self.tensors(genome[np.newaxis])[layer.weight][0])
        rows = "".join(f"    {row},\n" for row in (changed - own).tolist())
        head = LAYER_HEADER.format(within=" ".join(super().summary(genome).split()))
        return f"{head}\ntensor = {json.dumps(layer.weight)}\nchange = [\n{rows}]\n"


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


@dataclass(frozen=True)
class LastLayer:
    """The last layer of weights of a network.

    Attributes:
        input: Name of its input.
        weight: Name of its weights.
        transposed: Whether these are ``(outputs, inputs)``.
    """

    input: str
    weight: str
    transposed: bool

    def rows(self, weights: FloatArray) -> FloatArray:
        """Returns weights as ``(..., outputs, inputs)``, or such as they are in the network."""
        return weights if self.transposed else np.ascontiguousarray(weights.swapaxes(-1, -2))


def last_layer(graph: Graph) -> LastLayer:
    """Returns the last layer of weights of a network.

    Raises:
        ValueError: It has none.
    """
    for node in reversed(graph.nodes):
        if node.operator in LAYERS and np.ndim(graph.tensors.get(node.inputs[1], 0)) == 2:
            transposed = bool(dict(node.attributes).get("transB"))
            return LastLayer(node.inputs[0], node.inputs[1], transposed)
    raise ValueError(f"the network has no layer of weights ({' or '.join(LAYERS)}) to fine-tune")


LAYERS = ("Gemm", "MatMul")
"""Operators of a layer of weights."""


def _driven(graph: Graph) -> tuple[int, ...]:
    """Returns the outputs of the last layer that the output of a network depends on."""
    layer = last_layer(graph)
    own = layer.rows(graph.tensors[layer.weight])
    changed = np.tile(own, (len(own), 1, 1))
    changed[range(len(own)), range(len(own))] += 1.0
    seen = np.tile(np.random.default_rng(0).standard_normal(graph.inputs), (len(own), 1))
    first = graph.initial(len(own))
    moved = graph.step(seen, first, {layer.weight: layer.rows(changed)})[0]
    differs = (moved != graph.step(seen, first)[0]).any(axis=1)
    return tuple(np.flatnonzero(differs).tolist())


def initial_layers(
    inputs: int, hidden: int, outputs: int, rng: np.random.Generator
) -> list[tuple[FloatArray, FloatArray]]:
    """Returns the layers of a network whose output is 0, with 0 or one layer of hidden neurons."""
    last = np.zeros((outputs, hidden or inputs)), np.zeros(outputs)
    if not hidden:
        return [last]
    return [(rng.standard_normal((hidden, inputs)) / np.sqrt(inputs), np.zeros(hidden)), last]
