"""A fault kind of your own: mass added to the torso, or removed from it.

Usage:
  PYTHONPATH=examples selfmodel recover quadruped --damage payload=2 --kinds jam,payload:PAYLOAD
"""

from typing import TYPE_CHECKING

import mujoco

from selfmodel.faults.kind import Fault, FaultKind, uniform_bounds, uniform_levels
from selfmodel.robot.anatomy.anatomy import Anatomy

if TYPE_CHECKING:
    from selfmodel.robot.editing.embodiment import Embodiment


def load(embodiment: "Embodiment", _anatomy: Anatomy, fault: Fault) -> None:
    """Adds a point mass at the centre of mass of the body that moves freely."""
    model = embodiment.model
    (free,) = (model.jnt_type == mujoco.mjtJoint.mjJNT_FREE).nonzero()[0]
    model.body_mass[model.jnt_bodyid[free]] += fault.severity


PAYLOAD = FaultKind(
    name="payload",
    keyword="payload",
    apply=load,
    severity_bounds=uniform_bounds(-2.0, 10.0),
    levels=uniform_levels(-2.0, -1.0, -0.5, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0),
    degenerates_to={0.0: None},
    unit="kg",
)
