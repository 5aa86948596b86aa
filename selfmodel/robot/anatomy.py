"""Anatomy of a robot: its joints, sensors, motors and hinges by name."""

from dataclasses import dataclass
from typing import Literal

from selfmodel.trials.signals import Names


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
        """Returns the joint of that name.

        Raises:
            KeyError: The robot has no joint of that name.
        """
        return {joint.name: joint for joint in self.joints}[name]

    def sensor(self, name: str) -> Sensor:
        """Returns the sensor of that name.

        Raises:
            KeyError: The robot has no sensor of that name.
        """
        return {sensor.name: sensor for sensor in self.sensors}[name]

    @property
    def names(self) -> Names:
        """Column names of this robot's behaviours."""
        return Names(tuple(sensor.name for sensor in self.sensors), self.motors, self.hinges)
