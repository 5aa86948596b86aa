"""Controllers: a design, such as a network or a CPG, with the genome that sets its weights.

Each design is one file: ``network.py``, ``cpg.py``, ``policy.py``, ``compensation.py`` around
another, and ``trained.py``, of changed policies. A further design needs four changes: its file
with a ``Design`` and a ``ControllerBatch``, its row in ``selfmodel.robot.designs.DESIGNS`` (the
names on the command line), its row in ``selfmodel.logs.controllers.KINDS`` (the arrays of its
``.npz`` file: one number of its own), and its name on the help page, ``cli/options.toml``.
"""

import math
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Mapping, Sequence, Set as AbstractSet
from dataclasses import dataclass, field
from typing import ClassVar, Protocol

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray, frozen
from selfmodel.controllers.playback import Playback, PlaybackBatch
from selfmodel.errors import InputError, check_type, typed
from selfmodel.rotation import headings

TARGET_RANGE = np.pi / 4
"""Half range of the paper's motor targets about 0, rad."""

PAPER_RANGE = (0.0, TARGET_RANGE)
"""Command range of the paper's motors."""

TASK_PREFIX = "task:"
"""Prefix of the name of a signal that is the observation of a task of dm_control's suite, before a
key of ``selfmodel.robot.observations``."""

HEADING = ("base_orientation",)
"""Signals that a heading hold observes."""

Ranges = tuple[tuple[float, float], ...]
"""Centre and half width of the command range per motor, in the motor's unit: rad for a position
servo, rad/s for a velocity servo, a fraction of the largest torque for many torque motors."""


class ControllerBatch(Protocol):
    """The controllers of many robots, stepped together.

    The commands of a robot are bit-identical for every number of rows and at every row: contact is
    chaotic, and a difference in the last bit grows to half a metre.

    Attributes:
        readings: Sensor readings, ``(n, sensors)``; the caller writes them before each step.
        observed: Other signals that the controllers observe, ``(n, width)`` each; likewise.
    """

    readings: FloatArray
    observed: Mapping[str, FloatArray]

    def step(self, targets: FloatArray) -> None:
        """Writes the commands of the next control step, ``(n, motors)``, given ``readings``."""

    def end(self, running: IndexArray) -> None:
        """Notes which robots are still stepped; the commands of the others matter no longer."""


@dataclass(frozen=True)
class Design(ABC):
    """Structure of a controller: its inputs, its outputs, and the arithmetic between them.

    Attributes:
        name: Name of the kind of design in options and controller files, such as ``network``.
        sensors: Names of the inputs, in order.
        motors: Names of the outputs, in order.
        ranges: Command range of each motor; the paper's for all by default.
        heading: Whether it holds its heading; see ``HeadingHold``.

    Raises:
        ValueError: The number of ranges is not the number of motors, or a range is not finite or
            has no positive width.
    """

    name: ClassVar[str]

    sensors: tuple[str, ...]
    motors: tuple[str, ...]
    ranges: Ranges = field(default=(), kw_only=True)
    heading: bool = field(default=False, kw_only=True)

    def __post_init__(self) -> None:
        motors, ranges = self.motors, self.ranges or (PAPER_RANGE,) * len(self.motors)
        if len(ranges) != len(motors):
            raise ValueError(f"{len(motors)} motors need a command range each, got {len(ranges)}")
        for motor, (centre, half) in zip(motors, ranges, strict=True):
            if not (math.isfinite(centre) and math.isfinite(half) and half > 0):
                raise ValueError(
                    f"the motor {motor} needs a finite command range of positive width, got "
                    f"{centre} plus and minus {half}"
                )
        object.__setattr__(self, "ranges", ranges)

    @property
    def hidden(self) -> int:
        """Number of hidden neurons; 0 for a design without neurons."""
        return 0

    @property
    def reads(self) -> bool:
        """Whether it uses the readings of the sensors."""
        return True

    @property
    def observes(self) -> tuple[str, ...]:
        """Signals that it observes besides the readings."""
        return HEADING * self.heading

    @property
    def neutral(self) -> tuple[float, ...]:
        """Command of each motor about which it moves: the centre of its range."""
        return tuple(centre for centre, _ in self.ranges)

    @property
    def function(self) -> str:
        """Name of the function of Python within, which no file holds; "" without one."""
        return ""

    @property
    def velocity(self) -> tuple[float, ...] | None:
        """Velocity that it is commanded, ``(3,)``; None if it is commanded none."""
        return None

    @property
    @abstractmethod
    def weights(self) -> int:
        """Length of a genome."""

    @property
    @abstractmethod
    def description(self) -> str:
        """Sizes of the design as text, for error messages."""

    @abstractmethod
    def summary(self, genome: FloatArray, /) -> str:
        """Returns a short description of the controller with that genome, ``(weights,)``."""

    def layer_file(self, _genome: FloatArray, /) -> str:
        """Returns what a genome changes of a controller within as TOML; "" if there is none."""
        return ""

    @abstractmethod
    def batch(self, genomes: FloatArray, silent: Sequence[AbstractSet[int]], /) -> ControllerBatch:
        """Returns the batch of the controllers of some genomes, in their initial state.

        Args:
            genomes: ``(n, weights)``, each value in [-1, 1].
            silent: Indices of the silent hidden neurons per robot, each below ``hidden``.
        """


@typed
@dataclass(frozen=True, eq=False)
class Controller:
    """A controller: a design with a genome; controllers with equal designs and genomes are equal.

    Attributes:
        design: The structure.
        genome: ``(weights,)``, each value in [-1, 1].

    Raises:
        InputError: The genome has another length than the design's, or a value outside [-1, 1].
    """

    design: Design
    genome: FloatArray

    def __post_init__(self) -> None:
        if self.genome.shape != (self.design.weights,):
            raise InputError(
                f"{self.design.description} has {self.design.weights} weights, got a genome of "
                f"shape {self.genome.shape}: give as many in one row"
            )
        if not np.all(np.abs(self.genome) <= 1):
            raise InputError("every weight must lie in [-1, 1]: clip or scale the genome")
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
    """Raises ``InputError`` unless a design has the hidden neurons that are to be silent."""
    missing = [neuron for neuron in sorted(silent) if neuron >= design.hidden]
    if missing:
        fault = f"neuron:{missing[0]}"
        neurons, network = "which has no hidden neurons", "choose a network as the controller"
        if design.hidden:
            neurons = f"whose hidden neurons are 0 to {design.hidden - 1}"
            network = "choose a larger network"
        raise InputError(
            f"{fault} does not apply to {design.description}, {neurons}: leave {fault} out, or "
            f"{network}"
        )


CommandSource = Controller | Playback
"""Source of a robot's commands: a playback if other software controlled the robot."""


def make_batch(
    sources: Sequence[CommandSource], silent: Sequence[AbstractSet[int]], sensors: int
) -> ControllerBatch:
    """Returns the batch of the command sources of many robots, in their initial state.

    The sources, one per robot, are controllers of one design, or playbacks. Silent are the hidden
    neurons of each robot with these indices; they do not affect a playback.

    Raises:
        ValueError: The sources are not all playbacks or all controllers of one design.
        InputError: A silent hidden neuron does not exist in the design.
    """
    for source in sources:
        check_type(source, Controller | Playback, "a Controller or a Playback to drive a robot")
    controllers = [source for source in sources if isinstance(source, Controller)]
    playbacks = [source for source in sources if isinstance(source, Playback)]
    designs = Counter(controller.design for controller in controllers)
    if len(designs) + bool(playbacks) != 1:
        counts = [f"{count} x {design.description}" for design, count in designs.items()]
        counts.append(f"{len(playbacks)} playbacks")
        raise ValueError(
            f"the command sources of one batch must have one design, got {'; '.join(counts)}"
        )
    if playbacks:
        return PlaybackBatch(playbacks, sensors)
    (design,) = designs
    for neurons in silent:
        check_silent_neurons(design, neurons)
    return design.batch(np.array([controller.genome for controller in controllers]), silent)


class CommandScaler:
    """Scales outputs in [-1, 1] to the command ranges of the motors."""

    def __init__(self, ranges: Ranges) -> None:
        self._half = np.array([half for _, half in ranges])
        centre = np.array([middle for middle, _ in ranges])
        self._centre = centre if centre.any() else None

    def write(self, outputs: FloatArray, commands: FloatArray) -> None:
        """Writes the commands for outputs in [-1, 1]; both arrays are ``(n, motors)``."""
        np.multiply(outputs, self._half, out=commands)
        if self._centre is not None:
            commands += self._centre


MAX_TURN = 0.5
"""Largest turn that a heading hold distinguishes, rad: a stride is then doubled, or gone."""

HOLDS = ", which holds its heading"
"""What the description of a design with a heading hold says."""


class HeadingHold:
    """The heading hold of many robots: their strides change as they turn, to go straight.

    Every motor has a gene, by which its stride grows while the robot is turned to the left of the
    forward direction, and shrinks while it is turned to the right, or the other way round. Neither
    touch nor angle sensors tell a robot that it walks in a curve. Without genes, it observes and
    changes nothing.

    Attributes:
        observed: Orientation of the base, w x y z, ``(n, 4)``; see ``ControllerBatch.observed``.
    """

    def __init__(self, genes: FloatArray) -> None:
        self._genes = genes
        self.observed = {name: np.zeros((len(genes), 4)) for name in HEADING * bool(genes.shape[1])}

    def scale(self, outputs: FloatArray) -> None:
        """Scales the strides of the next control step, ``(n, motors)``."""
        for orientation in self.observed.values():
            turn = headings(orientation)
            outputs *= 1 + self._genes * np.clip(turn / MAX_TURN, -1, 1)[:, np.newaxis]
