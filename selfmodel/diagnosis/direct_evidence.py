"""Evidence on faults that a trial contains without any simulation.

It is a report beside a diagnosis, and begins its search: joints that stand under commands are
jammed or lost. ``segment-prediction`` uses the motion of the encoders as a term of its loss, and
the readings and commands as before.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from selfmodel.arrays import FloatArray, median_of_known
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.joints import BROKEN, JAMMED, JAMMED_AT_ANGLE, LOCKED_LEG, joints_at
from selfmodel.faults.kind import Fault
from selfmodel.robot.anatomy import Anatomy, Joint
from selfmodel.simulation.requests import END
from selfmodel.trials.estimation import PLAY, encoder_noise
from selfmodel.trials.trial import Trial

NOISE_RATIO = 1.2
"""Largest ratio of an encoder's deviation to its noise while its joint stands. It is stricter than
the factor of the comparator, because a whole trial has many more angles than a segment."""

MIN_COMMANDED = 0.05
"""Smallest range of a command that should move its joint, in the motor's unit."""

MIN_KNOWN = 10
"""Known angles or readings that a statement about a column needs."""

MAX_JAM_SPREAD = 0.05
"""Largest difference between the angles of the hinges of one jammed joint, rad."""

Motion = Literal["stands", "moves", "unknown"]
"""Whether an encoder moves by more than its noise; unknown without enough known angles."""


@dataclass(frozen=True)
class JointEvidence:
    """Motion of one hinge of a joint, as its encoder measured it.

    Attributes:
        joint: Name of the joint.
        hinge: Name of the hinge.
        angle: Mean angle, rad; None if unknown.
        deviation: Standard deviation of the angle, rad; None if unknown.
        commanded: Largest range of the commands of the joint's motors, in the motor's unit; 0
            without a motor or known commands.
        motion: ``stands`` if the deviation is within the noise of the encoder and the play of a
            jammed joint.
    """

    joint: str
    hinge: str
    angle: float | None
    deviation: float | None
    commanded: float
    motion: Motion


@dataclass(frozen=True)
class ConstantSensor:
    """A sensor whose reading never changed, and the reading."""

    sensor: str
    reading: float


@dataclass(frozen=True)
class DirectEvidence:
    """Evidence in one trial that needs no simulation.

    Attributes:
        trial: Name of the trial.
        joints: Motion of each hinge of the joints, in the order of the anatomy.
        constant_sensors: Sensors whose reading never changed.
        commands_without_effect: Motors with commands that change, on joints whose hinges all stand.
    """

    trial: str
    joints: tuple[JointEvidence, ...]
    constant_sensors: tuple[ConstantSensor, ...]
    commands_without_effect: tuple[str, ...]


def direct_evidence(
    trials: Sequence[Trial], anatomy: Anatomy, names: Mapping[str, str]
) -> tuple[DirectEvidence, ...]:
    """Returns the evidence of each trial that needs no simulation.

    Unknown values (NaN) are no evidence. The names of the trials are by path; see ``trial_names``.
    """
    return tuple(_evidence_of(trial, anatomy, names[trial.path]) for trial in trials)


def _evidence_of(trial: Trial, anatomy: Anatomy, trial_name: str) -> DirectEvidence:
    trajectory, names = trial.trajectory, trial.trajectory.names
    commands = _known(names.motors, trajectory["commands"])
    ranges = {motor: float(np.ptp(each)) if len(each) else 0.0 for motor, each in commands.items()}
    positions = trajectory["joint_positions"]
    angles = _known(names.hinges, positions)
    noise = encoder_noise(np.where(np.isfinite(positions), positions, np.nan))
    tolerances = dict(zip(angles, np.hypot(PLAY, NOISE_RATIO * noise), strict=True))
    joints: list[JointEvidence] = []
    without_effect: list[str] = []
    for joint in anatomy.joints:
        commanded = max((ranges[motor] for motor in joint.motors), default=0.0)
        motions: set[Motion] = set()
        for hinge in joint.hinges:
            mean, deviation = None, None
            motion: Motion = "unknown"
            if len(known := angles[hinge]) >= MIN_KNOWN:
                mean, deviation = float(known.mean()), float(known.std())
                motion = "stands" if deviation <= tolerances[hinge] else "moves"
            joints.append(JointEvidence(joint.name, hinge, mean, deviation, commanded, motion))
            motions.add(motion)
        if motions == {"stands"}:
            without_effect += [motor for motor in joint.motors if ranges[motor] >= MIN_COMMANDED]
    constant = [
        ConstantSensor(sensor, float(known[0]))
        for sensor, known in _known(names.sensors, trajectory["sensors"]).items()
        if len(known) >= MIN_KNOWN and np.ptp(known) == 0
    ]
    return DirectEvidence(trial_name, tuple(joints), tuple(constant), tuple(without_effect))


def _known(names: Sequence[str], values: FloatArray) -> dict[str, FloatArray]:
    return {name: one[np.isfinite(one)] for name, one in zip(names, values.T, strict=True)}


def observed_faults(
    trials: Sequence[Trial], anatomy: Anatomy, standing: Collection[str]
) -> tuple[Fault, ...]:
    """Returns for every joint a jam at the angle at which its encoders end, and the locked legs.

    The coarse levels of a jam's angle are tenths of a radian apart. Between two of them, a motor
    without torque predicts a short segment better than the jam: each segment begins at the logged
    angle. The encoder contains the angle, whether the joint is jammed or not.

    There is none of a joint whose encoders are unknown, or whose hinges end at different angles. A
    leg may be locked if all its joints are ``standing_joints``.
    """
    trial = _end(trials[-1])  # a fault may begin during the trials
    medians = median_of_known(trial.trajectory["joint_positions"])
    ends = dict(zip(trial.trajectory.names.hinges, medians, strict=True))
    faults = []
    for name in JAMMED_AT_ANGLE.parts(anatomy):
        joint = anatomy.joint(name)
        angles = [ends[hinge] for hinge in joint.hinges]
        if np.isfinite(angles).all() and np.ptp(angles) <= MAX_JAM_SPREAD:
            lows, highs = zip(*joint.limits, strict=True)
            angle = min(max(round(float(np.mean(angles)), 3) + 0.0, *lows), *highs)
            faults.append(Fault(JAMMED_AT_ANGLE, name, angle))
    for name in LOCKED_LEG.parts(anatomy):
        if all(joint.name in standing for joint in anatomy.limbs[name]):
            hinges = LOCKED_LEG.hinges(anatomy, name).items()
            angles = [min(max(round(ends[one], 3) + 0.0, low), high) for one, (low, high) in hinges]
            faults.append(Fault(LOCKED_LEG, name, angles=tuple(map(float, angles))))
    return tuple(faults)


def standing_joints(trials: Sequence[Trial], anatomy: Anatomy) -> frozenset[str]:
    """Returns the joints that stand although their motors are commanded to move.

    They stand in a whole trial, or at its end, where a fault may have begun. The last trial that
    says so of a joint counts, whether it stands or moves.
    """
    standing = set[str]()
    for part in (each for trial in trials for each in (trial, _end(trial))):
        evidence = _evidence_of(part, anatomy, "").joints
        for joint in anatomy.joints:
            motions = [one for one in evidence if one.joint == joint.name]
            if any(one.motion == "moves" for one in motions):
                standing.discard(joint.name)
            elif all(one.motion == "stands" for one in motions):
                is_commanded = any(one.commanded >= MIN_COMMANDED for one in motions)
                standing.update([joint.name] if is_commanded else [])
    return frozenset(standing)


def evident(standing: Collection[str], space: HypothesisSpace) -> list[Hypothesis]:
    """Returns the hypotheses of a space by which the ``standing_joints`` stand, if there are any.

    Legs of which all joints stand are locked, or have come off; other joints are jammed.
    """
    anatomy = space.anatomy
    legs = [fault for fault in space.observed if fault.kind == LOCKED_LEG]
    limbs: list[Sequence[Joint]] = [anatomy.limbs[leg.part] for leg in legs]
    within = {joint.name for limb in limbs for joint in limb}
    jams = [one for one in space.observed if one.part in standing and one.part not in within]
    lost = [Fault(BROKEN, limb[0].name) for limb in limbs]
    found = dict.fromkeys(space.canonical([*some, *jams]) for some in (legs, lost))
    return [one for one in found if len(one) and space.has(one)]


def explains_standing(fault: Fault, standing: Collection[str], anatomy: Anatomy) -> bool:
    """Returns whether a fault stops joints, and these are ``standing_joints``."""
    is_stop = fault.kind in (BROKEN, JAMMED, JAMMED_AT_ANGLE, LOCKED_LEG)
    return is_stop and all(joint.name in standing for joint in joints_at(fault, anatomy))


def _end(trial: Trial) -> Trial:
    """Returns the last part of a trial, ``END``."""
    trajectory = trial.trajectory
    last = slice(round((1 - END) * trajectory.steps), None)
    return replace(trial, trajectory=trajectory.rows(last))
