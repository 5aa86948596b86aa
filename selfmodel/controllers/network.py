"""Recurrent network: the paper's controller design."""

from collections.abc import Mapping, Sequence, Set as AbstractSet
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.controllers.controller import (
    HOLDS,
    CommandScaler,
    Design,
    HeadingHold,
)

HIDDEN_NEURONS = 3
"""Hidden neurons of the paper's network."""

MAX_HIDDEN_NEURONS = 100
"""Largest number of hidden neurons of a network."""


@dataclass(frozen=True)
class Network(Design):
    """Design of a recurrent network with one hidden layer of ``hidden`` neurons.

    With ``heading``, the outputs hold it; see ``HeadingHold``.
    """

    name: ClassVar[str] = "network"

    hidden: int = HIDDEN_NEURONS

    @property
    def weights(self) -> int:
        """Number of weights: 68 for the paper's quadruped, 120 for its hexapod."""
        return self.hidden * (len(self.sensors) + 1 + self.hidden) + len(self.motors) * (
            self.hidden + 1 + self.heading
        )

    @property
    def description(self) -> str:
        """Numbers of sensors, hidden neurons and motors as text."""
        return (
            f"a network of {len(self.sensors)} sensors, {self.hidden} hidden neurons and "
            f"{len(self.motors)} motors{HOLDS * self.heading}"
        )

    def summary(self, _genome: FloatArray) -> str:
        """Returns the number of hidden neurons as text."""
        return f"a network of {self.hidden} hidden neurons"

    def batch(self, genomes: FloatArray, silent: Sequence[AbstractSet[int]]) -> "NetworkBatch":
        """Returns the batch of the networks of some genomes; see ``Design.batch``."""
        return NetworkBatch(self, genomes, silent)

    def layers(self, genomes: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Returns the weights as matrices.

        Args:
            genomes: ``(n, weights)``: input to hidden with the bias last, hidden to hidden, hidden
                to motors with the bias last, each by rows of the receiving neuron. What follows is
                the heading hold.

        Returns:
            ``(n, hidden, sensors + hidden + 1)`` and ``(n, motors, hidden + 1)``, the bias last.
        """
        sensors, motors, hidden = len(self.sensors), len(self.motors), self.hidden
        shapes = ((hidden, sensors + 1), (hidden, hidden), (motors, hidden + 1))
        ends = np.cumsum([rows * columns for rows, columns in shapes])
        from_input, from_hidden, to_motor = (
            block.reshape(-1, *shape)
            for block, shape in zip(np.split(genomes, ends, axis=1)[:-1], shapes, strict=True)
        )
        to_hidden = np.concatenate(
            [from_input[..., :-1], from_hidden, from_input[..., -1:]], axis=2
        )
        return to_hidden, np.ascontiguousarray(to_motor)


class NetworkBatch:
    """The networks of many robots; a ``ControllerBatch``. The activation of silent neurons is 0."""

    def __init__(
        self, network: Network, genomes: FloatArray, silent: Sequence[AbstractSet[int]]
    ) -> None:
        self._to_hidden, self._to_motors = network.layers(genomes)
        self._scaler = CommandScaler(network.ranges)
        self._working = None
        if any(silent):
            silenced = [[neuron in own for neuron in range(network.hidden)] for own in silent]
            self._working = 1.0 - np.array(silenced)
        sensors = len(network.sensors)
        # Sensors, hidden neurons and the bias in one row: the input of each layer is a slice.
        self._inputs = np.zeros((len(genomes), sensors + network.hidden + 1))
        self._inputs[:, -1] = 1.0
        self.readings = self._inputs[:, :sensors]
        own = network.heading * len(network.motors)
        self._heading = HeadingHold(genomes[:, network.weights - own :])
        self.observed: Mapping[str, FloatArray] = self._heading.observed
        self._hidden = self._inputs[:, sensors:-1]
        self._outputs = self._inputs[:, sensors:]

    def step(self, targets: FloatArray) -> None:
        """Writes the commands of the next control step; see ``ControllerBatch``."""
        # einsum sums each row by itself, in an order that the number of rows does not change.
        hidden = np.einsum("nij,nj->ni", self._to_hidden, self._inputs)
        np.tanh(hidden, out=self._hidden)
        if self._working is not None:
            self._hidden *= self._working
        motors = np.einsum("nij,nj->ni", self._to_motors, self._outputs)
        np.tanh(motors, out=motors)
        self._heading.scale(motors)
        np.clip(motors, -1, 1, out=motors)
        self._scaler.write(motors, targets)

    def end(self, _running: IndexArray) -> None:
        """Changes nothing: the commands of a robot cost little."""
