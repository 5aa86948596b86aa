"""Policies whose weights are evolved: from genomes to networks of layers, and to plain policies."""

from collections.abc import Mapping, Sequence, Set as AbstractSet
from dataclasses import dataclass, field, fields, replace
from typing import ClassVar

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.graph import Graph
from selfmodel.controllers.policy import Policy, PolicyBatch


@dataclass(frozen=True)
class Trained(Policy):
    """A policy whose genome is a change of the weights of its network.

    A weight is that of the network plus ``span`` times the value of the genome.

    Attributes:
        span: Largest change of a weight.
    """

    name: ClassVar[str] = "trained"

    graph: Graph
    span: float = field(kw_only=True)

    @property
    def weights(self) -> int:
        """Length of a genome."""
        return self.graph.weights

    def tensors(self, genomes: FloatArray) -> Mapping[str, FloatArray]:
        """Returns the weights of genomes, ``(n, ...)`` by name, given ``(n, weights)``."""
        own = self.graph.tensors
        ends = np.cumsum([tensor.size for tensor in own.values()])[:-1]
        parts = np.split(self.span * genomes, ends, axis=1)
        return {
            name: tensor + part.reshape(len(genomes), *tensor.shape)
            for (name, tensor), part in zip(own.items(), parts, strict=True)
        }

    def batch(self, genomes: FloatArray, _silent: Sequence[AbstractSet[int]]) -> PolicyBatch:
        """Returns the batch of the policies of some genomes; see ``Design.batch``."""
        return PolicyBatch(self, len(genomes), self.tensors(genomes))

    def policy(self, genome: FloatArray) -> Policy:
        """Returns the policy of a genome, ``(weights,)``, with its weights in the network."""
        tensors = {name: own[0] for name, own in self.tensors(genome[np.newaxis]).items()}
        kept = {each.name: getattr(self, each.name) for each in fields(Policy)}
        return Policy(**{**kept, "graph": replace(self.graph, tensors=tensors)})


def initial_layers(
    inputs: int, hidden: int, outputs: int, rng: np.random.Generator
) -> list[tuple[FloatArray, FloatArray]]:
    """Returns the layers of a network whose output is 0, with 0 or one layer of hidden neurons."""
    last = np.zeros((outputs, hidden or inputs)), np.zeros(outputs)
    if not hidden:
        return [last]
    return [(rng.standard_normal((hidden, inputs)) / np.sqrt(inputs), np.zeros(hidden)), last]
