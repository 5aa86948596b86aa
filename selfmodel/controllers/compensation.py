"""A compensating layer around a controller that is known to walk, evolved from the identity.

A robot that fails keeps its gait or its policy, and learns a few numbers around it: an offset and a
gain of each motor, a shift of the commanded velocity, and with ``feedback`` a linear response to
tilt and turning. A genome of zeros changes nothing, so the first candidate of a search is the robot
as it is.
"""

import json
from collections.abc import Mapping, Sequence, Set as AbstractSet
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.controllers.controller import Controller, ControllerBatch, Design
from selfmodel.controllers.policy import PolicyBatch
from selfmodel.rotation import directions

OFFSET = 0.5
"""Largest offset of a motor, as a fraction of the half width of its command range."""

GAIN = 2.0
"""Largest gain of a motor, about its neutral command; the smallest is its inverse."""

SHIFT = 0.5
"""Largest shift of a commanded velocity, m/s and rad/s."""

TILT, TURN = 0.5, 0.1
"""Largest response of a motor to a tilt by 90 degrees, and to a turn by 1 rad/s, as a fraction of
the half width of its command range."""

FEEDBACK = ("base_orientation", "base_angular_velocity")
"""Signals of the feedback: gravity's direction, forward and to the left, and the gyroscope's."""

RESPONSES = 5
"""Numbers of the feedback."""

HEADER = """\
# A compensating layer, as selfmodel evolved it around
# {within}.
#
#   command = clip(own + (own - neutral) * (gain - 1) + offset + response . felt, low, high)
#
# own: the command of the controller within for this motor, in the unit of the motor.
# felt: the direction of gravity in the frame of the base, its x (forward) and y (to the left),
#   0 if upright; and the angular velocity of the base about x, y and z of that frame, rad/s.
# velocity_shift is added to the velocity that the controller within is commanded: m/s forward and
#   to the left, and rad/s to the left.
"""
"""Head of a layer file."""

_SHARED = ("sensors", "motors", "ranges")
"""What a layer has of the controller within."""


@dataclass(frozen=True)
class Compensated(Design):
    """A layer around a controller; zeros are the identity.

    A genome has the offsets, then the gains of the motors, then the shift of the velocity if the
    base is a policy that is commanded one, then with ``feedback`` each motor's responses to gravity
    (x, y) and to the angular velocity (x, y, z). The ``base`` is the controller within.

    Raises:
        ValueError: The controller within has a layer already, or other sensors, motors or ranges.
    """

    name: ClassVar[str] = "compensation"

    base: Controller = field(kw_only=True)
    feedback: bool = field(kw_only=True, default=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.base.design, Compensated):
            raise ValueError("a layer around a layer: give the controller within")  # noqa: TRY004
        if any(getattr(self, each) != getattr(self.base.design, each) for each in _SHARED):
            raise ValueError("expected the sensors, motors and ranges of the controller within")

    @classmethod
    def around(cls, base: Controller, *, feedback: bool = False) -> "Compensated":
        """Returns the layer around a controller, with its sensors, motors and ranges.

        Around a controller that has a layer, it is that around the one within.
        """
        inner = base.design.base if isinstance(base.design, Compensated) else base
        own = inner.design
        return cls(own.sensors, own.motors, ranges=own.ranges, base=inner, feedback=feedback)

    @property
    def hidden(self) -> int:
        """Number of hidden neurons of the controller within."""
        return self.base.design.hidden

    @property
    def reads(self) -> bool:
        """Whether the controller within uses the readings."""
        return self.base.design.reads

    @property
    def observes(self) -> tuple[str, ...]:
        """Signals of the controller within, and of the feedback."""
        own = FEEDBACK if self.feedback else ()
        return tuple(dict.fromkeys([*self.base.design.observes, *own]))

    @property
    def neutral(self) -> tuple[float, ...]:
        """Neutral commands of the controller within."""
        return self.base.design.neutral

    @property
    def function(self) -> str:
        """That of the controller within."""
        return self.base.design.function

    @property
    def velocity(self) -> tuple[float, ...] | None:
        """That of the controller within, without a shift."""
        return self.base.design.velocity

    @property
    def weights(self) -> int:
        """Length of a genome."""
        per_motor = 2 + (RESPONSES if self.feedback else 0)
        return per_motor * len(self.motors) + len(self.velocity or ())

    @property
    def description(self) -> str:
        """Number of its numbers, and the controller within, as text."""
        return f"a layer of {self.weights} numbers around {self.base.design.description}"

    def summary(self, genome: FloatArray) -> str:
        """Returns the largest changes as text, such as ``FL_thigh: gain 1.40, offset -0.12``."""
        if not genome.any():
            return self.base.design.summary(self.base.genome)
        layer = self.decode(genome[np.newaxis])
        gain, offset = layer.gain[0], layer.offset[0]
        size = np.abs(offset) + np.abs(np.log(gain))
        changes = [
            f"{self.motors[k]}: gain {gain[k]:.2f}, offset {offset[k]:+.2f}"
            for k in np.argsort(-size, kind="stable")[:3]
            if size[k]
        ]
        if layer.shift.any():
            changes.append(f"velocity {', '.join(f'{one:+.2f}' for one in layer.shift[0])}")
        if layer.response.any():
            changes.append("responses to tilt and turning")
        return f"{self.description}: {'; '.join(changes)}"

    def decode(self, genomes: FloatArray) -> "Layer":
        """Returns the numbers of genomes, ``(n, weights)``."""
        motors, half = len(self.motors), np.array([half for _, half in self.ranges])
        ends = np.cumsum([motors, motors, len(self.velocity or ())])
        offset, gain, shift, response = np.split(genomes, ends, axis=1)
        felt = motors if self.feedback else 0
        scale = np.array([TILT, TILT, TURN, TURN, TURN])
        return Layer(
            offset=OFFSET * half * offset,
            gain=GAIN**gain,
            shift=SHIFT * shift,
            response=half[:felt, np.newaxis]
            * scale
            * response.reshape(len(genomes), felt, RESPONSES),
        )

    def layer_file(self, genome: FloatArray) -> str:
        """Returns the numbers of a genome by name as TOML, to the last bit, for other software."""
        layer, within = self.decode(genome[np.newaxis]), self.base
        text = HEADER.format(within=" ".join(within.design.summary(within.genome).split()))
        text += f"\nvelocity_shift = {layer.shift[0].tolist()}\n\n[motors]\n"
        for k, (motor, (centre, half)) in enumerate(zip(self.motors, self.ranges, strict=True)):
            numbers = {
                "gain": layer.gain[0, k].tolist(),
                "offset": layer.offset[0, k].tolist(),
                "neutral": float(self.neutral[k]),
                "low": float(centre - half),
                "high": float(centre + half),
                **({"response": layer.response[0, k].tolist()} if self.feedback else {}),
            }
            values = ", ".join(f"{key} = {value!r}" for key, value in numbers.items())
            text += f"{json.dumps(motor)} = {{ {values} }}\n"
        return text

    def batch(self, genomes: FloatArray, silent: Sequence[AbstractSet[int]]) -> "CompensatedBatch":
        """Returns the batch of the layers of some genomes; see ``Design.batch``."""
        within = self.base.design.batch(np.tile(self.base.genome, (len(genomes), 1)), silent)
        return CompensatedBatch(self, within, self.decode(genomes))


@dataclass(frozen=True, eq=False)
class Layer:
    """The numbers of layers.

    Attributes:
        offset: Added to each command, ``(n, motors)``, in the motor's unit.
        gain: Factor of each command about the neutral one, ``(n, motors)``.
        shift: Added to the commanded velocity, ``(n, 3)`` m/s and rad/s, or ``(n, 0)``.
        response: Change of each command per unit of gravity's direction (x, y) and per rad/s,
            ``(n, motors, 5)``, or ``(n, 0, 5)``.
    """

    offset: FloatArray
    gain: FloatArray
    shift: FloatArray
    response: FloatArray


class CompensatedBatch:
    """The layers of many robots; a ``ControllerBatch``."""

    def __init__(self, design: Compensated, within: ControllerBatch, layer: Layer) -> None:
        self._within, self._layer = within, layer
        self.readings = within.readings
        rows = len(within.readings)
        own = {"base_orientation": 4, "base_angular_velocity": 3} if design.feedback else {}
        missing = {key: np.zeros((rows, n)) for key, n in own.items() if key not in within.observed}
        self.observed: Mapping[str, FloatArray] = {**within.observed, **missing}
        if isinstance(within, PolicyBatch) and layer.shift.size:
            within.velocity = within.velocity + layer.shift
        self._neutral = np.array(design.neutral)
        self._low, self._high = (
            np.array([centre + side * half for centre, half in design.ranges]) for side in (-1, 1)
        )

    def step(self, targets: FloatArray) -> None:
        """Writes the commands of the next control step; see ``ControllerBatch``."""
        layer = self._layer
        self._within.step(targets)
        # Written as a change, so that the identity changes no bit: it adds -0, which keeps a -0.
        change = (targets - self._neutral) * (layer.gain - 1) + layer.offset
        if layer.response.size:
            turning = self.observed["base_angular_velocity"]
            gravity = -directions(self.observed["base_orientation"])[:, 2:4]
            felt = np.concatenate([gravity, turning], axis=1)
            # einsum sums each row by itself, in an order that the number of rows does not change.
            change += np.einsum("nmk,nk->nm", layer.response, felt)
        targets += np.where(change == 0, -0.0, change)
        np.clip(targets, self._low, self._high, out=targets)

    def end(self, running: IndexArray) -> None:
        """Notes which robots are still stepped; see ``ControllerBatch``."""
        self._within.end(running)
