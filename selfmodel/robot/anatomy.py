"""What a robot has: its joints, sensors, motors and hinges by name, and its control delay.

This module needs no MuJoCo, as little as notation and comparators, which import it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

from selfmodel.trials.signals import Names

if TYPE_CHECKING:
    from mujoco import MjModel, MjSpec


@dataclass(frozen=True)
class Joint:
    """A joint that fails as a unit: one hinge, or several hinges of the same body.

    Attributes:
        name: Name in notation, such as ``front_left_knee``.
        hinges: Hinge joints of the model that form the joint.
        motors: Actuators that drive the joint; an actuator that moves several joints through a
            tendon belongs to the first of them.
        servos: Those of the motors with position feedback.
        bodies: Bodies that are detached when the joint breaks: the body that the joint moves, and
            all its descendants.
        descendants: Joints and sensors on ``bodies``, without the joint itself.
        limits: Lower and upper angle per hinge, rad; -pi and pi for an unlimited hinge.
        motors_lost_if_broken: Actuators without effect once the joint is broken.
        motors_lost_if_jammed: Actuators without effect once the joint is welded.
    """

    name: str
    hinges: tuple[str, ...]
    motors: tuple[str, ...]
    servos: tuple[str, ...]
    bodies: frozenset[str]
    descendants: frozenset[str]
    limits: tuple[tuple[float, float], ...]
    motors_lost_if_broken: frozenset[str]
    motors_lost_if_jammed: frozenset[str]


@dataclass(frozen=True)
class Sensor:
    """A sensor whose reading the controller receives.

    Attributes:
        name: Name in notation and in the model, such as ``front_left_touch``.
        kind: Kind of the reading. ``touch`` is 1 while the contact force is above zero, else 0.
            ``angle`` is the angle of a hinge from ``centre`` divided by ``half_range``: from -1 to
            1 over the range of the hinge.
        body: Body that carries the sensor; for an angle, the body that the hinge moves.
        hinge: Hinge whose angle is measured; "" for touch.
        half_range: Distance from the centre to the angle with the reading 1, rad; 1 for touch.
        centre: Angle with the reading 0, rad; 0 for touch.
    """

    name: str
    kind: Literal["touch", "angle"]
    body: str
    hinge: str
    half_range: float
    centre: float

    def reading(self, angle: float) -> float:
        """Returns the normalised reading of an angle, rad."""
        return (angle - self.centre) / self.half_range


@dataclass(frozen=True)
class Anatomy:
    """The joints, sensors and motors of a robot.

    Attributes:
        joints: Joints that can break or jam.
        sensors: Inputs of the controller in its order, touch before angle.
        motors: Actuators that the controller commands, in its order.
        hinges: Hinges of the model except those of the root body, in the order of the model.
        floating_base: Name of the root body; "" for a fixed base.
    """

    joints: tuple[Joint, ...]
    sensors: tuple[Sensor, ...]
    motors: tuple[str, ...]
    hinges: tuple[str, ...]
    floating_base: str

    def joint(self, name: str) -> Joint:
        """Returns the joint of that name, or raises ``KeyError``."""
        return {joint.name: joint for joint in self.joints}[name]

    def sensor(self, name: str) -> Sensor:
        """Returns the sensor of that name, or raises ``KeyError``."""
        return {sensor.name: sensor for sensor in self.sensors}[name]

    @cached_property
    def limbs(self) -> Mapping[str, tuple[Joint, ...]]:
        """Chains of joints without branches by name, the joint nearest to the root body first.

        A limb has the name that its joints share, such as ``front_left``, or else that of its first
        joint. A joint with two chain ends beyond it belongs to no limb.
        """
        joints = {joint.name: joint for joint in self.joints}
        beyond = {name: joint.descendants & joints.keys() for name, joint in joints.items()}
        ends = [name for name in joints if not beyond[name]]
        chains = []
        for end in ends:
            chain = [one for one in joints if one == end or beyond[one].intersection(ends) == {end}]
            chain.sort(key=lambda name: -len(beyond[name]))
            chains.append(chain)
        shared = _shared_words([*joints]) if len(chains) > 1 else []
        words = [
            "_".join(word for word in _shared_words(chain) if word not in shared)
            for chain in chains
        ]
        names = [
            word if word and words.count(word) == 1 else chain[0]
            for word, chain in zip(words, chains, strict=True)
        ]
        if len(set(names)) < len(names):
            names = [chain[0] for chain in chains]
        limbs = [tuple(joints[name] for name in chain) for chain in chains]
        return dict(zip(names, limbs, strict=True))

    @property
    def names(self) -> Names:
        """Column names of this robot's trajectories."""
        return Names(tuple(sensor.name for sensor in self.sensors), self.motors, self.hinges)


def _shared_words(names: Sequence[str]) -> list[str]:
    """Returns the words that all names have, in the order of the first one."""
    words = [name.split("_") for name in names]
    return [word for word in words[0] if all(word in others for others in words)]


CONTROL_DELAY = "selfmodel_control_delay"
"""Name of the custom numeric, which a calibration writes into the MJCF, with the control delay: the
time from a command to its effect, in control steps; 0 by default. It may be a part of a control
step, as long as it is a whole number of physics steps."""

FITTED_CONTACTS = "selfmodel_fitted_contacts"
"""Name of the custom numeric of a model with contacts that a calibration changed. Logs of version
0.1 may have a third, ``selfmodel_hidden_neurons``, which is ignored: their controllers have it."""

UNKNOWN_GROUND = "selfmodel_unknown_ground"
"""Name of the custom numeric of a model that was imported from a file without a ground."""

MAX_CONTROL_DELAY = 5
"""Largest control delay, in control steps: segments contain that many commands before their
start."""

_DELAY_TOLERANCE = 1e-4
"""Rounding error of a control delay in an MJCF of six digits, in physics steps."""


def control_delay(model: "MjModel", substeps: int) -> float:
    """Returns the control delay of a model, in control steps; see ``as_delay``.

    Raises:
        ValueError: The custom numeric is not from 0 to ``MAX_CONTROL_DELAY``, not a whole number of
            physics steps, or not a whole number of control steps in a model with activations.
    """
    delay = custom_numeric(model, CONTROL_DELAY) or 0.0
    allowed = 1 if model.na else substeps
    valid = 0 <= delay <= MAX_CONTROL_DELAY  # not for NaN, which cannot be rounded
    if not valid or abs(delay * allowed - round(delay * allowed)) > _DELAY_TOLERANCE:
        parts = "a whole number" if allowed == 1 else f"a multiple of 1/{allowed}"
        raise ValueError(
            f"{CONTROL_DELAY} must be {parts} from 0 to {MAX_CONTROL_DELAY}, got {delay:g}"
        )
    return as_delay(round(delay * allowed), allowed)


def write_control_delay(spec: "MjSpec", delay: float) -> None:
    """Writes a control delay, in control steps, into a specification."""
    for numeric in spec.numerics:
        if numeric.name == CONTROL_DELAY:
            spec.delete(numeric)
    spec.add_numeric(name=CONTROL_DELAY, data=[float(delay)])


def as_delay(parts: int, substeps: int) -> float:
    """Returns a delay in physics steps in control steps; an ``int`` if they are whole."""
    return parts // substeps if parts % substeps == 0 else parts / substeps


def split_delay(delay: float, substeps: int) -> tuple[int, int]:
    """Returns a control delay as whole control steps and the physics steps beyond them."""
    return divmod(round(delay * substeps), substeps)


def added_steps(delay: float, added: float) -> int:
    """Returns the whole control steps by which a control delay grows under a fault.

    The severity of the fault is rounded, so that the sum is at most ``MAX_CONTROL_DELAY``.
    """
    return min(round(added), math.floor(MAX_CONTROL_DELAY - delay))


def custom_numeric(model: "MjModel", name: str) -> float | None:
    """Returns the first value of a custom numeric; None if the model does not contain it."""
    values = (model.numeric(i) for i in range(model.nnumeric))
    return next((float(value.data[0]) for value in values if value.name == name), None)
