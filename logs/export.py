"""A diagnosis for other software: the damaged model, the status of each joint, ranges of faults."""

import json
from collections.abc import Iterator
from typing import Any

from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.faults import joints
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.registry import KINDS, limbs
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.robot import Robot

MODEL, STATUS = "model.xml", "status.json"
"""The robot with the best hypothesis, and what policies and training frameworks take."""

LOST = (joints.BROKEN, joints.JAMMED, joints.JAMMED_AT_ANGLE, joints.LOCKED_LEG, joints.MOTOR_OFF)
WEAK = (joints.WEAK_MOTOR, joints.SERVO_GAIN)
"""Kinds that leave a joint no torque, and those whose severity is the share that is left."""


def files_of(diagnosis: Diagnosis, robot: Robot) -> dict[str, bytes]:
    """Returns the files of a diagnosis for other software, by name, the meshes included."""
    from selfmodel.faults.build import edited_mjcf  # noqa: PLC0415  # logs import without MuJoCo

    status = json.dumps(status_of(diagnosis, robot), indent=1)
    model = edited_mjcf(robot, diagnosis.best)
    return {**robot.assets, MODEL: model.encode(), STATUS: f"{status}\n".encode()}


def status_of(diagnosis: Diagnosis, robot: Robot) -> dict[str, Any]:
    """Returns the content of ``STATUS``; see the page ``how-to/use-a-diagnosis``."""
    anatomy, best = robot.anatomy, diagnosis.best
    status = joint_status(best, anatomy)
    order = list(status)
    rows = [[joint.name for joint in limb] for limb in limbs(anatomy)]
    rows.sort(key=lambda row: order.index(row[0]))
    within = {name for row in rows for name in row}
    own = {one.kind for one in best.faults if not one.kind.affects_dynamics}
    return {
        "robot": robot.name,
        "hypothesis": str(best),
        "verdict": diagnosis.verdict,
        "doubt": diagnosis.doubt.reason if diagnosis.doubt else None,
        "joints": rows,
        "status": [[status[name] for name in row] for row in rows],
        "other_joints": {name: status[name] for name in order if name not in within},
        "not_in_model": [
            str(one) for one in best.faults if one.kind in {*own, joints.ENCODER_OFFSET}
        ],
        "hypotheses": [
            {"hypothesis": str(one), "probability": diagnosis.probability.get(str(one))}
            for one in (best, *diagnosis.indistinguishable)
        ],
        "ranges": [] if diagnosis.doubt else list(_ranges(diagnosis, anatomy)),
    }


def joint_status(hypothesis: Hypothesis, anatomy: Anatomy) -> dict[str, float]:
    """Returns what each joint can still do: 1 if it works, 0 if it is lost, a share if it is weak.

    A limb that has come off has lost all its joints. Faults that leave the torque do not count.
    """
    status = {joint.name: 1.0 for joint in anatomy.joints}
    for fault in hypothesis.faults:
        if fault.kind in LOST:
            lost = joints.joints_at(fault, anatomy)
            beyond = lost[0].descendants if fault.kind == joints.BROKEN else ()
            names = (*(joint.name for joint in lost), *(status.keys() & beyond))
            status |= dict.fromkeys(names, 0.0)
        elif fault.kind in WEAK:
            status[fault.part] *= fault.severity
    return status


def _ranges(diagnosis: Diagnosis, anatomy: Anatomy) -> Iterator[dict[str, Any]]:
    """Yields the range of severities of each graded fault that the trials leave possible.

    It is that of the hypotheses that cannot be told apart, half way on to the next severities that
    a search compares, and up to the nominal one if one of the hypotheses lacks the fault. Of faults
    that the best hypothesis has not, it is what would not have shown, where that is known.
    """
    named = (diagnosis.best, *diagnosis.indistinguishable)
    found = dict[tuple[FaultKind, str], list[float]]()
    for fault in (fault for one in named for fault in one.faults if fault.kind.bounds):
        found.setdefault((fault.kind, fault.part), []).append(fault.severity)
    unseen = {(KINDS.get(one.kind), one.part): one for one in diagnosis.detectable}
    for kind, part in dict.fromkeys([*found, *unseen]):
        if kind is None:  # of a plug-in
            continue
        levels = sorted({*kind.levels_at(anatomy, part), *kind.degenerates_to})
        if severities := found.get((kind, part)):
            least, most = min(severities), max(severities)
            low = (least + max((one for one in levels if one < least), default=least)) / 2
            high = (most + min((one for one in levels if one > most), default=most)) / 2
            if kind.nominal is not None and len(severities) < len(named):
                low, high = min(low, kind.nominal), max(high, kind.nominal)
        else:
            one = unseen[kind, part]
            low = levels[0] if one.below is None else one.below
            high = levels[-1] if one.above is None else one.above
        yield {
            "kind": kind.name,
            "part": part,
            "low": round(low, 6),
            "high": round(high, 6),
            "nominal": kind.nominal,
            "unit": kind.unit,
            "found": bool(severities),
        }
