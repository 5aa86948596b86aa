"""Evidence on faults that a trial contains without any simulation.

It is a report beside a diagnosis: ``segment-prediction`` uses the motion of the encoders as a term
of its loss, and the readings and commands as before.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot.anatomy import Anatomy
from selfmodel.trials.estimation import PLAY, encoder_noise
from selfmodel.trials.trial import Trial

NOISE_RATIO = 1.2
"""Largest ratio of an encoder's deviation to its noise while its joint stands. It is stricter than
the factor of the comparator, because a whole trial has many more angles than a segment."""

MIN_COMMANDED = 0.05
"""Smallest range of a command that should move its joint, in the motor's unit."""

MIN_KNOWN = 10
"""Known angles or readings that a statement about a column needs."""

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
    """Returns the finite values of each column."""
    return {name: one[np.isfinite(one)] for name, one in zip(names, values.T, strict=True)}
