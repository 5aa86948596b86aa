"""Jams at the angles at which encoders stand: candidates that need no search over angles."""

from collections.abc import Sequence

import numpy as np

from selfmodel.diagnosis.direct_evidence import MIN_COMMANDED, DirectEvidence, JointEvidence
from selfmodel.faults.jammed import JAMMED_AT_ANGLE
from selfmodel.faults.kind import Fault
from selfmodel.robot.anatomy.anatomy import Anatomy

MAX_SPREAD = 0.05
"""Largest difference between the mean angles of a jam in several trials and hinges, rad."""


def observed_jams(evidence: Sequence[DirectEvidence], anatomy: Anatomy) -> tuple[Fault, ...]:
    """Returns a jam for every joint that stands at one angle in all trials, although commanded.

    The coarse levels of a jam's angle are tenths of a radian apart. Between two of them, a motor
    without torque predicts a short segment better than the jam: each segment begins at the logged
    angle. The encoder contains the angle.

    Args:
        evidence: Direct evidence of the trials; see ``direct_evidence``.
        anatomy: The robot's parts.

    Returns:
        Faults of the kind ``jam-angle``, in the order of the joints.
    """
    jams = []
    for joint in JAMMED_AT_ANGLE.parts(anatomy):
        found = [one for trial in evidence for one in trial.joints if one.joint == joint]
        angle = _common_angle(found)
        if angle is not None:
            lows, highs = zip(*anatomy.joint(joint).limits, strict=True)
            jams.append(Fault(JAMMED_AT_ANGLE, joint, min(max(angle, *lows), *highs)))
    return tuple(jams)


def _common_angle(found: Sequence[JointEvidence]) -> float | None:
    """Returns the mean angle of hinges that all stand, commanded, at one angle; otherwise None."""
    angles = [one.angle for one in found if one.motion == "stands" and one.angle is not None]
    is_commanded = any(one.commanded >= MIN_COMMANDED for one in found)
    if not angles or len(angles) < len(found) or not is_commanded:
        return None
    return round(float(np.mean(angles)), 3) + 0.0 if np.ptp(angles) <= MAX_SPREAD else None
