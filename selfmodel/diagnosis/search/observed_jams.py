"""Jams at the angles at which encoders end: candidates that need no search over angles."""

from collections.abc import Sequence

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.faults.joints import JAMMED_AT_ANGLE
from selfmodel.faults.kind import Fault
from selfmodel.robot.anatomy import Anatomy
from selfmodel.simulation.requests import END
from selfmodel.trials.trial import Trial

MAX_SPREAD = 0.05
"""Largest difference between the angles of the hinges of one jammed joint, rad."""


def observed_jams(trials: Sequence[Trial], anatomy: Anatomy) -> tuple[Fault, ...]:
    """Returns for every joint a jam at the angle at which its encoders end.

    The coarse levels of a jam's angle are tenths of a radian apart. Between two of them, a motor
    without torque predicts a short segment better than the jam: each segment begins at the logged
    angle. The encoder contains the angle, whether the joint is jammed or not.

    Args:
        trials: Trials to explain, or parts of them; the last one counts.
        anatomy: The robot's parts.

    Returns:
        Faults of the kind ``jam-angle``, in the order of the joints, without joints whose encoders
        are unknown and joints whose hinges end at different angles.
    """
    if not trials:
        return ()
    behaviour = trials[-1].behaviour
    angles = behaviour["joint_positions"][round((1 - END) * behaviour.steps) :]
    ends = dict(zip(behaviour.names.hinges, map(_median, angles.T), strict=True))
    jams = []
    for joint in JAMMED_AT_ANGLE.parts(anatomy):
        found = [ends[hinge] for hinge in anatomy.joint(joint).hinges]
        if np.isfinite(found).all() and np.ptp(found) <= MAX_SPREAD:
            lows, highs = zip(*anatomy.joint(joint).limits, strict=True)
            angle = min(max(round(float(np.mean(found)), 3) + 0.0, *lows), *highs)
            jams.append(Fault(JAMMED_AT_ANGLE, joint, angle))
    return tuple(jams)


def _median(angles: FloatArray) -> float:
    known = angles[np.isfinite(angles)]
    return float(np.median(known)) if len(known) else np.nan
