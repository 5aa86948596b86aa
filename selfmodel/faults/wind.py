"""Wind: the medium, air where the model has none, moves along forward, or across it."""

from typing import TYPE_CHECKING

from selfmodel.faults.kind import Fault, FaultKind, uniform_bounds, uniform_levels
from selfmodel.robot.anatomy import Anatomy

if TYPE_CHECKING:
    from selfmodel.robot.embodiment import Embodiment

AIR_DENSITY = 1.2
"""Of air at 20 degrees Celsius, kg/m^3; a model that says no medium is in a vacuum."""

AIR_VISCOSITY = 1.8e-5
"""Of the same air, Pa s."""

_BOUNDS = uniform_bounds(-40.0, 40.0)
_LEVELS = uniform_levels(
    -30.0, -25.0, -20.0, -16.0, -12.0, -8.0, -4.0, 4.0, 8.0, 12.0, 16.0, 20.0, 25.0, 30.0
)


def _blow(embodiment: "Embodiment", axis: int, speed: float) -> None:
    option = embodiment.model.opt
    if option.density == option.viscosity == 0:  # what swims stays in its water
        option.density, option.viscosity = AIR_DENSITY, AIR_VISCOSITY
    option.wind[axis] = speed


def _along(embodiment: "Embodiment", _anatomy: Anatomy, fault: Fault) -> None:
    _blow(embodiment, 0, fault.severity)


def _across(embodiment: "Embodiment", _anatomy: Anatomy, fault: Fault) -> None:
    _blow(embodiment, 1, fault.severity)


WIND = FaultKind(
    name="wind",
    keyword="wind",
    apply=_along,
    severity_bounds=_BOUNDS,
    levels=_LEVELS,
    degenerates_to={0.0: None},
    unit="m/s",
)
"""Along forward: positive wind blows from behind, -5 is against the robot."""

CROSSWIND = FaultKind(
    name="crosswind",
    keyword="crosswind",
    apply=_across,
    severity_bounds=_BOUNDS,
    levels=_LEVELS,
    degenerates_to={0.0: None},
    unit="m/s",
)
"""Along the world's y axis: positive wind blows from the right to the left."""
