"""The controller: the paper's recurrent network, decoded from a genome."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import FloatArray, frozen
from selfmodel.controllers.command_range import Commands, Ranges, checked_ranges

HIDDEN_NEURONS = 3


@dataclass(frozen=True)
class Network:
    """The size of a network and what its ends are connected to.

    Attributes:
        sensors: Names of its inputs, in order.
        motors: Names of its outputs, in order.
        hidden: Number of hidden neurons.
        ranges: What each motor is commanded; the paper's where none is given.

    Raises:
        ValueError: The ranges do not fit the motors, or one is none.
    """

    sensors: tuple[str, ...]
    motors: tuple[str, ...]
    hidden: int = HIDDEN_NEURONS
    ranges: Ranges = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "ranges", checked_ranges(self.motors, self.ranges))

    def controller(self, genome: FloatArray) -> "Controller":
        """Returns this network with the weights of a genome, ``(weights,)``."""
        return Controller(self, genome)

    @property
    def weights(self) -> int:
        """How many weights it has: 68 for the paper's quadruped, 120 for its hexapod."""
        return sum(rows * columns for rows, columns in self._shapes())

    def layers(self, genomes: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Returns the weights as matrices.

        Args:
            genomes: ``(n, weights)``: input to hidden with the bias last, hidden to hidden, hidden
                to motors with the bias last, each by rows of the neuron that receives.

        Returns:
            ``(n, hidden, sensors + hidden + 1)`` and ``(n, motors, hidden + 1)``, the bias last.
        """
        blocks = []
        start = 0
        for rows, columns in self._shapes():
            block = genomes[:, start : start + rows * columns]
            blocks.append(block.reshape(-1, rows, columns))
            start += rows * columns
        from_input, from_hidden, to_motor = blocks
        to_hidden = np.concatenate(
            [from_input[..., :-1], from_hidden, from_input[..., -1:]], axis=2
        )
        return to_hidden, np.ascontiguousarray(to_motor)

    def _shapes(self) -> tuple[tuple[int, int], ...]:
        return (
            (self.hidden, len(self.sensors) + 1),
            (self.hidden, self.hidden),
            (len(self.motors), self.hidden + 1),
        )


@dataclass(frozen=True, eq=False)
class Controller:
    """A network with its weights; two are equal when all of that is.

    Attributes:
        network: Its size and ends.
        genome: ``(weights,)``, each in [-1, 1].

    Raises:
        ValueError: The genome does not fit the network.
    """

    network: Network
    genome: FloatArray

    @property
    def design(self) -> Network:
        """What the genome is decoded with."""
        return self.network

    def __post_init__(self) -> None:
        if self.genome.shape != (self.network.weights,):
            raise ValueError(
                f"a network of {len(self.network.sensors)} sensors, {self.network.hidden} hidden "
                f"neurons and {len(self.network.motors)} motors has {self.network.weights} "
                f"weights, got a genome of shape {self.genome.shape}"
            )
        if not np.all(np.abs(self.genome) <= 1):
            raise ValueError("every weight must lie in [-1, 1]")
        object.__setattr__(self, "genome", frozen(self.genome))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Controller):
            return NotImplemented
        return self.network == other.network and self.genome.tobytes() == other.genome.tobytes()

    def __hash__(self) -> int:
        return hash((self.network, self.genome.tobytes()))


def draw_weights(rng: np.random.Generator, shape: tuple[int, ...]) -> FloatArray:
    """Returns random weights of ``shape``: uniform in [-1, 1], to two decimals."""
    return rng.integers(-100, 101, size=shape) / 100


class Population:
    """The networks of many robots, stepped together.

    A robot's arithmetic is the same to the bit whatever the number of rows and its place among
    them: contact is chaotic, and a last bit grows to half a metre.

    Args:
        controllers: One a robot, all of the same network.
        neurons: ``(n, hidden)``: 1 for a neuron that works, 0 for a silent one.
    """

    def __init__(self, controllers: Sequence[Controller], neurons: FloatArray) -> None:
        network = controllers[0].network
        if any(controller.network != network for controller in controllers):
            raise ValueError("controllers of one population must have the same network")
        genomes = np.array([controller.genome for controller in controllers])
        self._to_hidden, self._to_motors = network.layers(genomes)
        self._commands = Commands(network.ranges)
        self._neurons = None if np.all(neurons == 1) else neurons
        sensors = len(network.sensors)
        # Sensors, hidden neurons and the bias in one row: what feeds either layer is a slice of it.
        self._inputs = np.zeros((len(genomes), sensors + network.hidden + 1))
        self._inputs[:, -1] = 1.0
        self.readings = self._inputs[:, :sensors]
        self._hidden = self._inputs[:, sensors:-1]
        self._outputs = self._inputs[:, sensors:]

    def step(self, targets: FloatArray) -> None:
        """Computes the commands for what stands in ``readings``.

        Args:
            targets: ``(n, motors)``, written: within the network's ranges, in each motor's unit.
        """
        # einsum sums each row by itself, in an order that the number of rows does not change.
        hidden = np.einsum("nij,nj->ni", self._to_hidden, self._inputs)
        np.tanh(hidden, out=self._hidden)
        if self._neurons is not None:
            self._hidden *= self._neurons
        motors = np.einsum("nij,nj->ni", self._to_motors, self._outputs)
        np.tanh(motors, out=motors)
        self._commands.write(motors, targets)
