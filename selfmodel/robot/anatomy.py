"""What a robot is made of, as names: the parts that can fail and what hangs on them."""

from dataclasses import dataclass
from typing import Literal

from selfmodel.trials.behaviour import Names


@dataclass(frozen=True)
class Joint:
    """A joint that fails as one; it has one hinge, or several on the same body.

    Attributes:
        name: As in notation, such as ``front_left_knee``.
        hinges: The model's joints that it consists of.
        motors: The actuators that drive them; one that moves several joints through a tendon
            counts to the first of them.
        bodies: Every body that is lost when it breaks: the one it moves and all beyond.
        lost: The joints and sensors that are lost with them, without the joint itself.
        limits: Lower and upper angle of each hinge, rad; a half turn where it has none.
        slack: The motors that move nothing once it is broken.
        idle: The motors that move nothing once it is held.
    """

    name: str
    hinges: tuple[str, ...]
    motors: tuple[str, ...]
    bodies: frozenset[str]
    lost: frozenset[str]
    limits: tuple[tuple[float, float], ...]
    slack: frozenset[str]
    idle: frozenset[str]


@dataclass(frozen=True)
class Sensor:
    """One reading that the controller receives.

    Attributes:
        name: As in notation and in the model, such as ``front_left_touch``.
        kind: ``touch`` is 1 while the force is above zero, else 0; ``angle`` is the hinge's angle
            from ``centre`` divided by ``half_range``: from -1 to 1 over the hinge's range.
        body: The body it sits on; for an angle, the one that the hinge moves.
        hinge: The hinge whose angle is measured, or "" for touch.
        half_range: How far from the centre an angle reads as 1, rad; 1 for touch.
        centre: The angle that reads as 0, rad; 0 for touch.
    """

    name: str
    kind: Literal["touch", "angle"]
    body: str
    hinge: str
    half_range: float
    centre: float

    def reading(self, angle: float) -> float:
        """Returns what an angle reads as."""
        return (angle - self.centre) / self.half_range


@dataclass(frozen=True)
class Anatomy:
    """The joints, sensors and motors of one robot.

    Attributes:
        joints: What can break or jam.
        sensors: What feeds the controller, touch before angle, in its order.
        motors: What the controller commands, in its order.
        hinges: Every hinge of the model but its root's, in its order.
    """

    joints: tuple[Joint, ...]
    sensors: tuple[Sensor, ...]
    motors: tuple[str, ...]
    hinges: tuple[str, ...]

    def joint(self, name: str) -> Joint:
        """Returns the joint of that name.

        Raises:
            KeyError: There is none.
        """
        return {joint.name: joint for joint in self.joints}[name]

    def sensor(self, name: str) -> Sensor:
        """Returns the sensor of that name.

        Raises:
            KeyError: There is none.
        """
        return {sensor.name: sensor for sensor in self.sensors}[name]

    @property
    def names(self) -> Names:
        """The column names of this robot's behaviours."""
        return Names(tuple(sensor.name for sensor in self.sensors), self.motors, self.hinges)
