"""A weak motor: it has a part of its torque."""

from typing import TYPE_CHECKING

from selfmodel.faults.kind import Fault, Kind, between, grid
from selfmodel.robot.anatomy import Anatomy

if TYPE_CHECKING:
    from selfmodel.robot.embodiment import Embodiment


def _strike(embodiment: "Embodiment", anatomy: Anatomy, fault: Fault) -> None:
    motors = [anatomy.motors.index(motor) for motor in anatomy.joint(fault.part).motors]
    embodiment.weaken_motors(motors, fault.degree)


def _joints_with_motors(anatomy: Anatomy) -> tuple[str, ...]:
    """One motor may move several joints through a tendon, and counts to the first."""
    return tuple(joint.name for joint in anatomy.joints if joint.motors)


WEAK_MOTOR = Kind(
    name="motor",
    word="motor",
    parts=_joints_with_motors,
    strike=_strike,
    degrees=between(0.0, 1.0),
    levels=grid(0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9),
    special={1.0: None},
    unit="of its torque",
)
