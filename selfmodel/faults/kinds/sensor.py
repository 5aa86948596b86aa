"""A failed sensor, and sensors with a gain, a bias or noise.

The controller receives gain times the measurement, plus bias, plus noise, in the units of readings:
touch is 0 or 1, and an angle is 1 at the end of its joint's range.
"""

from typing import TYPE_CHECKING

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.faults.kind import Fault, FaultKind, uniform_bounds, uniform_levels
from selfmodel.robot.anatomy import Anatomy
from selfmodel.trials.behaviour import Behaviour

if TYPE_CHECKING:
    from selfmodel.robot.embodiment import Embodiment


def _sensors(anatomy: Anatomy) -> tuple[str, ...]:
    return tuple(sensor.name for sensor in anatomy.sensors)


def _angle_sensors(anatomy: Anatomy) -> tuple[str, ...]:
    """Returns the angle sensors; additive noise has no meaning for a binary touch sensor."""
    return tuple(sensor.name for sensor in anatomy.sensors if sensor.kind == "angle")


def _column(anatomy: Anatomy, fault: Fault) -> int:
    return _sensors(anatomy).index(fault.part)


def _fail(embodiment: "Embodiment", anatomy: Anatomy, fault: Fault) -> None:
    embodiment.fix_reading(_column(anatomy, fault), 0.0)


def _readings(fault: Fault, behaviour: Behaviour) -> FloatArray:
    return behaviour["sensors"][:, behaviour.names.sensors.index(fault.part)]


def _reads_something(fault: Fault, behaviour: Behaviour) -> BoolArray:
    """Returns a mask of the steps with a known reading other than 0, ``(steps,)``."""
    readings = _readings(fault, behaviour)
    return np.asarray(np.isfinite(readings) & (readings != 0))


def _reads_0_or_1(fault: Fault, behaviour: Behaviour) -> BoolArray:
    """Returns a mask of the steps that exclude a gain or a bias of a binary sensor, ``(steps,)``.

    A sensor with a gain reads the gain in place of 1, one with a bias never 0.
    """
    readings = _readings(fault, behaviour)
    is_known = np.isfinite(readings)
    if not np.isin(readings[is_known], (0.0, 1.0)).all():
        return np.zeros(len(readings), dtype=np.bool_)
    return np.asarray(is_known & (readings == (1.0 if fault.kind == SENSOR_GAIN else 0.0)))


def _scale(embodiment: "Embodiment", anatomy: Anatomy, fault: Fault) -> None:
    embodiment.scale_reading(_column(anatomy, fault), fault.severity)


def _shift(embodiment: "Embodiment", anatomy: Anatomy, fault: Fault) -> None:
    embodiment.bias[_column(anatomy, fault)] = fault.severity


def _blur(embodiment: "Embodiment", anatomy: Anatomy, fault: Fault) -> None:
    embodiment.noise[_column(anatomy, fault)] = fault.severity


def _absorbs(fault: Fault, other: Fault, _anatomy: Anatomy) -> bool:
    """Returns whether the other fault is at the same sensor: a failed sensor reads 0."""
    return other.part == fault.part and other.kind in (SENSOR_GAIN, SENSOR_BIAS, SENSOR_NOISE)


FAILED_SENSOR = FaultKind(
    name="sensor",
    keyword="sensor",
    parts=_sensors,
    apply=_fail,
    contradicted=_reads_something,
    absorbs=_absorbs,
    affects_dynamics=False,
)

SENSOR_GAIN = FaultKind(
    name="sensor-gain",
    keyword="sensor",
    prefix="gain",
    parts=_sensors,
    apply=_scale,
    contradicted=_reads_0_or_1,
    affects_dynamics=False,
    severity_bounds=uniform_bounds(0.0, 2.0),
    levels=uniform_levels(0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.2, 1.4, 1.6, 1.8, 2.0),
    degenerates_to={1.0: None},
    # With a bias, a gain of 0 is a stuck reading, which no other kind expresses.
    degenerates_alone_to={0.0: FAILED_SENSOR},
    unit="times",
)

SENSOR_BIAS = FaultKind(
    name="sensor-bias",
    keyword="sensor",
    prefix="bias",
    parts=_sensors,
    apply=_shift,
    contradicted=_reads_0_or_1,
    affects_dynamics=False,
    severity_bounds=uniform_bounds(-1.0, 1.0),
    levels=uniform_levels(-0.9, -0.7, -0.5, -0.35, -0.2, -0.1, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9),
    degenerates_to={0.0: None},
    unit="of the reading's range",
)

SENSOR_NOISE = FaultKind(
    name="sensor-noise",
    keyword="sensor",
    prefix="noise",
    parts=_angle_sensors,
    apply=_blur,
    affects_dynamics=False,
    severity_bounds=uniform_bounds(0.0, 1.0),
    levels=uniform_levels(0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.6, 0.8),
    degenerates_to={0.0: None},
    unit="of the reading's range",
)
