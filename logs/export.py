"""A diagnosis for other software: the damaged model, the status of each joint, ranges of faults.

``status.json`` has what fault-tolerant policies take as an input, and what a training framework
randomises; ``model.xml`` is the robot with the best hypothesis.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.faults import joints
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.registry import KINDS, limbs
from selfmodel.logs.files import create_file, make_folder, refuse_existing
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.robot import Robot

MODEL, STATUS = "model.xml", "status.json"
"""Files in the folder of a diagnosis for other software, beside the meshes of the model."""

LOST = (joints.BROKEN, joints.JAMMED, joints.JAMMED_AT_ANGLE, joints.MOTOR_OFF)
"""Kinds that leave a joint without a torque that moves it."""

WEAK = (joints.WEAK_MOTOR, joints.SERVO_GAIN)
"""Kinds whose severity is the share of a motor that is left."""


def check_folder(folder: Path) -> None:
    """Raises ``InputError`` if a folder has the files of a diagnosis for other software."""
    for name in (MODEL, STATUS):
        refuse_existing(folder / name)


def export_diagnosis(diagnosis: Diagnosis, robot: Robot, folder: Path) -> dict[str, Any]:
    """Writes a diagnosis for other software, and returns the content of ``status.json``.

    Args:
        diagnosis: The diagnosis.
        robot: The self-model.
        folder: Folder for ``model.xml``, its meshes and ``status.json``; made if it is missing.

    Raises:
        InputError: The folder has such a file.
        LogWriteError: A file could not be written.
    """
    from selfmodel.faults.build import edited_mjcf  # noqa: PLC0415  # logs import without MuJoCo

    check_folder(folder)
    content = status_of(diagnosis, robot)
    files = {MODEL: edited_mjcf(robot, diagnosis.best).encode(), **robot.assets}
    files[STATUS] = (json.dumps(content, indent=1) + "\n").encode()
    make_folder(folder)
    for name, data in files.items():
        with create_file(folder / name) as file:
            file.write(data)
    return content


def status_of(diagnosis: Diagnosis, robot: Robot) -> dict[str, Any]:
    """Returns the content of ``status.json``; see the page ``how-to/use-a-diagnosis``."""
    anatomy, best = robot.anatomy, diagnosis.best
    order = [joint.name for joint in anatomy.joints]
    rows = [[joint.name for joint in limb] for limb in limbs(anatomy)]
    rows.sort(key=lambda row: order.index(row[0]))
    status, within = joint_status(best, anatomy), {name for row in rows for name in row}
    return {
        "robot": robot.name,
        "hypothesis": str(best),
        "verdict": diagnosis.verdict,
        "joints": rows,
        "status": [[status[name] for name in row] for row in rows],
        "other_joints": {name: status[name] for name in order if name not in within},
        "not_in_model": [
            str(one)
            for one in best.faults
            if not one.kind.affects_dynamics or one.kind == joints.ENCODER_OFFSET
        ],
        "hypotheses": [
            {"hypothesis": str(one), "probability": diagnosis.probability.get(str(one))}
            for one in (best, *diagnosis.indistinguishable)
        ],
        "ranges": list(_ranges(diagnosis, anatomy)),
    }


def joint_status(hypothesis: Hypothesis, anatomy: Anatomy) -> dict[str, float]:
    """Returns what each joint can still do: 1 if it works, 0 if it is lost, a share if it is weak.

    A limb that has come off has lost all its joints. Faults that leave the torque do not count.
    """
    status = {joint.name: 1.0 for joint in anatomy.joints}
    for fault in hypothesis.faults:
        if fault.kind in LOST:
            beyond = anatomy.joint(fault.part).descendants if fault.kind == joints.BROKEN else ()
            status |= dict.fromkeys((fault.part, *(status.keys() & beyond)), 0.0)
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
    for (kind, part), severities in found.items():
        levels = _levels(kind, part, anatomy)
        least, most = min(severities), max(severities)
        low = (least + max((one for one in levels if one < least), default=least)) / 2
        high = (most + min((one for one in levels if one > most), default=most)) / 2
        if kind.nominal is not None and len(severities) < len(named):
            low, high = min(low, kind.nominal), max(high, kind.nominal)
        yield _range(kind, part, low, high, is_found=True)
    for one in diagnosis.detectable:
        own = KINDS.get(one.kind)  # not of a plug-in
        if own is not None and (own, one.part) not in found:
            levels = _levels(own, one.part, anatomy)
            low = levels[0] if one.below is None else one.below
            high = levels[-1] if one.above is None else one.above
            yield _range(own, one.part, low, high, is_found=False)


def _levels(kind: FaultKind, part: str, anatomy: Anatomy) -> list[float]:
    """Returns the severities that a search compares, and the nominal one."""
    return sorted({*kind.levels_at(anatomy, part), *kind.degenerates_to})


def _range(
    kind: FaultKind, part: str, low: float, high: float, *, is_found: bool
) -> dict[str, Any]:
    return {
        "kind": kind.name,
        "part": part,
        "low": round(low, 6),
        "high": round(high, 6),
        "nominal": kind.nominal,
        "unit": kind.unit,
        "found": is_found,
    }
