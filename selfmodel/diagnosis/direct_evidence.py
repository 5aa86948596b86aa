"""Evidence on faults that a trial contains without any simulation.

It is a report beside a diagnosis: ``segment-prediction`` uses the motion of the encoders as a term
of its loss, and the readings and commands as before.
"""

from collections.abc import Iterator, Mapping, Sequence
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
    """A sensor whose reading never changed.

    Attributes:
        sensor: Name of the sensor.
        reading: Its reading.
    """

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

    Args:
        trials: Trials of the robot; unknown values (NaN) are no evidence.
        anatomy: The robot's parts.
        names: Names of the trials, by path; see ``trial_names``.
    """
    return tuple(_evidence_of(trial, anatomy, names[trial.path]) for trial in trials)


def _evidence_of(trial: Trial, anatomy: Anatomy, name: str) -> DirectEvidence:
    commanded = _commanded(trial)
    joints = tuple(_joints(trial, anatomy, commanded))
    return DirectEvidence(
        trial=name,
        joints=joints,
        constant_sensors=tuple(_constant_sensors(trial)),
        commands_without_effect=tuple(_without_effect(joints, anatomy, commanded)),
    )


def _commanded(trial: Trial) -> dict[str, float]:
    """Returns the range of the known commands of each motor."""
    columns = trial.behaviour["commands"].T
    known = (column[np.isfinite(column)] for column in columns)
    ranges = [float(np.ptp(column)) if len(column) else 0.0 for column in known]
    return dict(zip(trial.behaviour.names.motors, ranges, strict=True))


def _joints(trial: Trial, anatomy: Anatomy, commanded: dict[str, float]) -> Iterator[JointEvidence]:
    positions = trial.behaviour["joint_positions"]
    angles = np.where(np.isfinite(positions), positions, np.nan)
    columns = {hinge: column for column, hinge in enumerate(trial.behaviour.names.hinges)}
    tolerances = np.hypot(PLAY, NOISE_RATIO * encoder_noise(angles))
    for joint in anatomy.joints:
        largest = max((commanded[motor] for motor in joint.motors), default=0.0)
        for hinge in joint.hinges:
            column = columns[hinge]
            yield _hinge(joint.name, hinge, angles[:, column], tolerances[column], largest)


def _hinge(
    joint: str, hinge: str, angles: FloatArray, tolerance: float, commanded: float
) -> JointEvidence:
    known = angles[np.isfinite(angles)]
    if len(known) < MIN_KNOWN:
        return JointEvidence(joint, hinge, None, None, commanded, "unknown")
    deviation = float(known.std())
    motion: Motion = "stands" if deviation <= tolerance else "moves"
    return JointEvidence(joint, hinge, float(known.mean()), deviation, commanded, motion)


def _constant_sensors(trial: Trial) -> Iterator[ConstantSensor]:
    readings = trial.behaviour["sensors"]
    for name, column in zip(trial.behaviour.names.sensors, readings.T, strict=True):
        known = column[np.isfinite(column)]
        if len(known) >= MIN_KNOWN and np.ptp(known) == 0:
            yield ConstantSensor(name, float(known[0]))


def _without_effect(
    joints: Sequence[JointEvidence], anatomy: Anatomy, commanded: dict[str, float]
) -> Iterator[str]:
    for joint in anatomy.joints:
        motions = {one.motion for one in joints if one.joint == joint.name}
        if motions == {"stands"}:
            yield from (motor for motor in joint.motors if commanded[motor] >= MIN_COMMANDED)
