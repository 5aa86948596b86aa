"""Wind along or across the forward direction; the medium is air if the model has none."""

from typing import TYPE_CHECKING

from selfmodel.faults.kind import Fault, FaultKind, uniform_bounds, uniform_levels
from selfmodel.robot.anatomy import Anatomy

if TYPE_CHECKING:
    from selfmodel.robot.embodiment import Embodiment

AIR_DENSITY = 1.2
"""Density of air at 20 degrees Celsius, kg/m^3; MuJoCo's default medium is a vacuum."""

AIR_VISCOSITY = 1.8e-5
"""Viscosity of air at 20 degrees Celsius, Pa s."""

_BOUNDS = uniform_bounds(-40.0, 40.0)
_LEVELS = uniform_levels(
    -30.0, -25.0, -20.0, -16.0, -12.0, -8.0, -4.0, 4.0, 8.0, 12.0, 16.0, 20.0, 25.0, 30.0
)


def _blow(embodiment: "Embodiment", axis: int, speed: float) -> None:
    option = embodiment.model.opt
    if option.density == option.viscosity == 0:  # a swimmer's model has its own medium
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
"""Wind speed along the world's x axis: positive from behind, negative against the robot."""

CROSSWIND = FaultKind(
    name="crosswind",
    keyword="crosswind",
    apply=_across,
    severity_bounds=_BOUNDS,
    levels=_LEVELS,
    degenerates_to={0.0: None},
    unit="m/s",
)
"""Wind speed along the world's y axis: positive from right to left."""
