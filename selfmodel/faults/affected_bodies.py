"""Bodies of a model that a hypothesis detaches or jams, for pictures."""

from typing import TYPE_CHECKING

from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.kinds.broken import BROKEN
from selfmodel.faults.kinds.jammed import JAMMED, JAMMED_AT_ANGLE
from selfmodel.robot.anatomy import Anatomy

if TYPE_CHECKING:
    from mujoco import MjModel


def detached_bodies(anatomy: Anatomy, model: "MjModel", hypothesis: Hypothesis) -> frozenset[int]:
    """Returns the ids of the bodies that a hypothesis detaches.

    Args:
        anatomy: The robot's parts.
        model: Model with the robot's bodies.
        hypothesis: The hypothesis.
    """
    names = (
        name
        for fault in hypothesis.faults
        if fault.kind is BROKEN
        for name in anatomy.joint(fault.part).bodies
    )
    return frozenset(int(model.body(name).id) for name in names)


def jammed_bodies(anatomy: Anatomy, model: "MjModel", hypothesis: Hypothesis) -> frozenset[int]:
    """Returns the ids of the bodies at the joints that a hypothesis jams.

    Args:
        anatomy: The robot's parts.
        model: Model with the robot's hinges.
        hypothesis: The hypothesis.
    """
    hinges = (
        hinge
        for fault in hypothesis.faults
        if fault.kind in (JAMMED, JAMMED_AT_ANGLE)
        for hinge in anatomy.joint(fault.part).hinges
    )
    return frozenset(int(model.joint(hinge).bodyid[0]) for hinge in hinges)
