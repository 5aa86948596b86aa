"""Controllers: a design, such as a network or a CPG, with the genome that sets its weights."""

from collections.abc import Sequence, Set as AbstractSet
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from selfmodel.arrays import FloatArray, frozen
from selfmodel.controllers.command_range import Ranges
from selfmodel.errors import InputError


class ControllerBatch(Protocol):
    """The controllers of many robots, stepped together.

    The commands of a robot are bit-identical for every number of rows and at every row: contact is
    chaotic, and a difference in the last bit grows to half a metre.

    Attributes:
        readings: Sensor readings, ``(n, sensors)``; the caller writes them before each step.
    """

    readings: FloatArray

    def step(self, targets: FloatArray) -> None:
        """Computes the commands of the next control step from ``readings``.

        Args:
            targets: Commands, ``(n, motors)``, each in its motor's unit; written in place.
        """
        ...


class Design(Protocol):
    """Structure of a controller: its inputs, its outputs, and the arithmetic between them.

    A design is immutable, hashable and equal to every design of the same structure.
    """

    @property
    def name(self) -> str:
        """Name of the kind of design in options and controller files, such as ``network``."""
        ...

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the inputs, in order."""
        ...

    @property
    def motors(self) -> tuple[str, ...]:
        """Names of the outputs, in order."""
        ...

    @property
    def ranges(self) -> Ranges:
        """Command range of each motor."""
        ...

    @property
    def hidden(self) -> int:
        """Number of hidden neurons; 0 for a design without neurons."""
        ...

    @property
    def weights(self) -> int:
        """Length of a genome."""
        ...

    @property
    def description(self) -> str:
        """Sizes of the design as text, for error messages."""
        ...

    def summary(self, genome: FloatArray) -> str:
        """Returns a short description of the controller with that genome, ``(weights,)``."""
        ...

    def batch(self, genomes: FloatArray, silent: Sequence[AbstractSet[int]]) -> ControllerBatch:
        """Returns the batch of the controllers of some genomes, in their initial state.

        Args:
            genomes: ``(n, weights)``, each value in [-1, 1].
            silent: Indices of the silent hidden neurons per robot, each below ``hidden``.
        """
        ...


@dataclass(frozen=True, eq=False)
class Controller:
    """A controller: a design with a genome; controllers with equal designs and genomes are equal.

    Attributes:
        design: The structure.
        genome: ``(weights,)``, each value in [-1, 1].

    Raises:
        ValueError: The genome has another length than the design's, or a value outside [-1, 1].
    """

    design: Design
    genome: FloatArray

    def __post_init__(self) -> None:
        if self.genome.shape != (self.design.weights,):
            raise ValueError(
                f"{self.design.description} has {self.design.weights} weights, got a genome of "
                f"shape {self.genome.shape}"
            )
        if not np.all(np.abs(self.genome) <= 1):
            raise ValueError("every weight must lie in [-1, 1]")
        object.__setattr__(self, "genome", frozen(self.genome))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Controller):
            return NotImplemented
        return self.design == other.design and self.genome.tobytes() == other.genome.tobytes()

    def __hash__(self) -> int:
        return hash((self.design, self.genome.tobytes()))

    def __repr__(self) -> str:
        return f"<Controller: {self.design.summary(self.genome)}>"

    @property
    def summary(self) -> str:
        """Short description, such as ``its controller, a network of 3 hidden neurons``."""
        return f"its controller, {self.design.summary(self.genome)}"


def draw_genomes(rng: np.random.Generator, shape: tuple[int, ...]) -> FloatArray:
    """Returns random genomes of ``shape``: uniform in [-1, 1], in hundredths."""
    return rng.integers(-100, 101, size=shape) / 100


def check_silent_neurons(design: Design, silent: AbstractSet[int]) -> None:
    """Checks that a design has the hidden neurons that are to be silent.

    Args:
        design: The structure of the controller.
        silent: Indices of the silent hidden neurons.

    Raises:
        InputError: A neuron does not exist in the design; the message contains its index.
    """
    missing = [neuron for neuron in sorted(silent) if neuron >= design.hidden]
    if not missing:
        return
    fault = f"neuron:{missing[0]}"
    if not design.hidden:
        raise InputError(
            f"{fault} does not apply to {design.description}, which has no hidden neurons: leave "
            f"{fault} out, or choose a network as the controller"
        )
    raise InputError(
        f"{fault} does not apply to {design.description}, whose hidden neurons are 0 to "
        f"{design.hidden - 1}: leave {fault} out, or choose a larger network"
    )
