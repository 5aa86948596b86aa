"""Payload: a mass on the root body, at its centre of mass or at its front or back end.

The severity is a fraction of the mass of the healthy robot, from 0 to 1. The parts are the places,
along the forward direction of the initial pose: no part is the centre of mass, ``front`` and
``back`` are the ends of the box of even density with the inertia of the root body. A severity of 0
is nominal. A robot with a fixed base has no payload, because its root body does not move. A robot
has at most one payload: two of them are one elsewhere. No fault absorbs a payload: no joint carries
it.
"""

from typing import TYPE_CHECKING

from selfmodel.faults.kind import (
    ENVIRONMENT,
    Fault,
    FaultKind,
    uniform_bounds,
    uniform_levels,
)
from selfmodel.robot.anatomy import Anatomy

if TYPE_CHECKING:
    from selfmodel.robot.embodiment import Embodiment

PLACES = {ENVIRONMENT: 0.0, "front": 1.0, "back": -1.0}
"""Places of a payload by part: forward from the centre of mass, 1 at the end of the body."""


def _parts(anatomy: Anatomy) -> tuple[str, ...]:
    return tuple(PLACES) if anatomy.floating_base else ()


def _apply(embodiment: "Embodiment", anatomy: Anatomy, fault: Fault) -> None:
    embodiment.load_body(anatomy.floating_base, fault.severity, PLACES[fault.part])


PAYLOAD = FaultKind(
    name="payload",
    keyword="payload",
    parts=_parts,
    apply=_apply,
    severity_bounds=uniform_bounds(0.0, 1.0),
    levels=uniform_levels(0.1, 0.2, 0.4, 0.8),
    degenerates_to={0.0: None},
    is_single=True,
    unit="of the robot's mass",
)
