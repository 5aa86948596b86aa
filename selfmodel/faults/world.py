"""Kinds of environments, and of faults of the whole robot: ground, wind, payload and delay."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from selfmodel.faults.kind import ENVIRONMENT, Fault, FaultKind
from selfmodel.robot.anatomy import Anatomy

if TYPE_CHECKING:
    from selfmodel.robot.embodiment import Embodiment

AIR_DENSITY = 1.2
"""Density of air at 20 degrees Celsius, kg/m^3; MuJoCo's default medium is a vacuum."""

AIR_VISCOSITY = 1.8e-5
"""Viscosity of air at 20 degrees Celsius, Pa s."""

PLACES = {ENVIRONMENT: 0.0, "front": 1.0, "back": -1.0}
"""Places of a payload by part: forward from the centre of mass, 1 at the end of the body."""


class Friction(FaultKind):
    """Coefficient of sliding friction between the ground and all geoms.

    No severity is nominal for every robot: the nominal friction is the model's.
    """

    def apply(self, embodiment: "Embodiment", _anatomy: Anatomy, fault: Fault) -> None:
        """Sets the friction."""
        embodiment.set_friction(fault.severity)


class Slope(FaultKind):
    """Angle of the ground along forward, uphill positive.

    The ground and the initial pose are rotated about the initial position, and gravity is
    unchanged: the world's z axis points up in every logged signal, as in odometry that is aligned
    with gravity by an IMU.
    """

    def apply(self, embodiment: "Embodiment", _anatomy: Anatomy, fault: Fault) -> None:
        """Tilts the ground and the robot."""
        embodiment.tilt_ground(fault.severity)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Wind(FaultKind):
    """Wind speed along an axis of the world; the medium is air if the model has none.

    Positive from behind or from right to left, negative against the robot or from left to right.

    Attributes:
        axis: 0 for x, 1 for y.
    """

    axis: int

    def apply(self, embodiment: "Embodiment", _anatomy: Anatomy, fault: Fault) -> None:
        """Sets the wind."""
        option = embodiment.model.opt
        if option.density == option.viscosity == 0:  # a swimmer's model has its own medium
            option.density, option.viscosity = AIR_DENSITY, AIR_VISCOSITY
        option.wind[self.axis] = fault.severity


class Payload(FaultKind):
    """A mass on the root body, at its centre of mass or at its front or back end.

    The severity is a fraction of the mass of the healthy robot, from 0 to 1. The parts are the
    places, along the forward direction of the initial pose: no part is the centre of mass,
    ``front`` and ``back`` are the ends of the box of even density with the inertia of the root
    body. A severity of 0 is nominal. A robot with a fixed base has no payload, because its root
    body does not move. A robot has at most one payload: two of them are one elsewhere. No fault
    absorbs a payload: no joint carries it.
    """

    def parts(self, anatomy: Anatomy) -> tuple[str, ...]:
        """Returns the places; none for a fixed base."""
        return tuple(PLACES) if anatomy.floating_base else ()

    def apply(self, embodiment: "Embodiment", anatomy: Anatomy, fault: Fault) -> None:
        """Adds the mass."""
        embodiment.load_body(anatomy.floating_base, fault.severity, PLACES[fault.part])


class GrownDelay(FaultKind):
    """A delay of commands: they take effect some control steps later than in the self-model.

    The severity is a number of control steps from 0 to 3, in addition to the control delay of the
    robot; 0 is nominal. Its effect is that of the nearest whole number of control steps, also of a
    fitted severity between two. The delay of the robot and of the fault together is at most
    ``MAX_CONTROL_DELAY``: segments contain that many commands before their start. The fault has no
    part, because all motors share the delay. No fault absorbs it.
    """

    def apply(self, embodiment: "Embodiment", _anatomy: Anatomy, fault: Fault) -> None:
        """Sets the added delay."""
        embodiment.added_delay[:] = fault.severity


_SPEEDS = (-30.0, -25.0, -20.0, -16.0, -12.0, -8.0, -4.0, 4.0, 8.0, 12.0, 16.0, 20.0, 25.0, 30.0)

FRICTION = Friction(
    name="friction",
    bounds=(0.01, 3.0),
    levels=(0.1, 0.13, 0.16, 0.2, 0.25, 0.32, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.2, 1.5),
    unit="(coefficient)",
)
SLOPE = Slope(
    name="slope",
    bounds=(-0.6, 0.6),
    levels=(-0.3, -0.25, -0.2, -0.15, -0.1, -0.05, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3),
    degenerates_to={0.0: None},
    unit="rad",
)
WIND, CROSSWIND = (
    Wind(
        name=name,
        axis=axis,
        bounds=(-40.0, 40.0),
        levels=_SPEEDS,
        degenerates_to={0.0: None},
        unit="m/s",
    )
    for axis, name in enumerate(("wind", "crosswind"))
)
PAYLOAD = Payload(
    name="payload",
    bounds=(0.0, 1.0),
    levels=(0.1, 0.2, 0.4, 0.8),
    degenerates_to={0.0: None},
    is_single=True,
    unit="of the robot's mass",
)
GROWN_DELAY = GrownDelay(
    name="delay",
    bounds=(0.0, 3.0),
    levels=(1.0, 2.0, 3.0),
    degenerates_to={0.0: None},
    unit="control steps",
)
