"""Fault kinds of a controller: failed sensors, sensors with a gain, a bias or noise, neurons.

The controller receives gain times the measurement, plus bias, plus noise, in the units of readings:
touch is 0 or 1, and an angle is 1 at the end of its joint's range.
"""

from typing import TYPE_CHECKING

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.controllers.network import MAX_HIDDEN_NEURONS
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.robot.anatomy import Anatomy
from selfmodel.trials.trajectory import Trajectory

if TYPE_CHECKING:
    from selfmodel.robot.model_variant import ModelVariant


class SensorFault(FaultKind):
    """A fault of any sensor."""

    def parts(self, anatomy: Anatomy) -> tuple[str, ...]:
        """Returns the names of the sensors."""
        return anatomy.names.sensors


class FailedSensor(SensorFault):
    """A sensor that reads 0."""

    def apply(self, variant: "ModelVariant", anatomy: Anatomy, fault: Fault) -> None:
        """Sets the reading to 0."""
        variant.fix_reading(_column(anatomy, fault), 0.0)

    def contradicted(self, fault: Fault, trajectory: Trajectory) -> BoolArray:
        """Returns a mask of the steps with a known reading other than 0, ``(steps,)``."""
        readings = _readings(fault, trajectory)
        return np.asarray(np.isfinite(readings) & (readings != 0))

    def absorbs(self, fault: Fault, other: Fault, _anatomy: Anatomy) -> bool:
        """Returns whether the other fault is at the same sensor: a failed sensor reads 0."""
        return other.part == fault.part and other.kind in (SENSOR_GAIN, SENSOR_BIAS, SENSOR_NOISE)


class SensorGain(SensorFault):
    """A sensor whose reading is scaled by a factor."""

    def apply(self, variant: "ModelVariant", anatomy: Anatomy, fault: Fault) -> None:
        """Scales the reading."""
        column = _column(anatomy, fault)
        variant.gain[column] *= fault.severity
        variant.offset[column] *= fault.severity

    def contradicted(self, fault: Fault, trajectory: Trajectory) -> BoolArray:
        """Returns a mask of the steps in which a binary sensor reads 1, ``(steps,)``.

        With a gain, it reads the gain in place of 1.
        """
        return _reads_as_if_binary(fault, trajectory, 1.0)


class SensorBias(SensorFault):
    """A sensor with a constant added to its reading."""

    def apply(self, variant: "ModelVariant", anatomy: Anatomy, fault: Fault) -> None:
        """Adds the constant."""
        variant.bias[_column(anatomy, fault)] = fault.severity

    def contradicted(self, fault: Fault, trajectory: Trajectory) -> BoolArray:
        """Returns a mask of the steps in which a binary sensor reads 0, ``(steps,)``.

        With a bias, it never reads 0.
        """
        return _reads_as_if_binary(fault, trajectory, 0.0)


class SensorNoise(FaultKind):
    """An angle sensor with white noise."""

    def parts(self, anatomy: Anatomy) -> tuple[str, ...]:
        """Returns the angle sensors; additive noise has no meaning for a binary touch sensor."""
        return tuple(sensor.name for sensor in anatomy.sensors if sensor.kind == "angle")

    def apply(self, variant: "ModelVariant", anatomy: Anatomy, fault: Fault) -> None:
        """Sets the standard deviation of the noise."""
        variant.noise[_column(anatomy, fault)] = fault.severity


def _column(anatomy: Anatomy, fault: Fault) -> int:
    return anatomy.names.sensors.index(fault.part)


def _readings(fault: Fault, trajectory: Trajectory) -> FloatArray:
    return trajectory["sensors"][:, trajectory.names.sensors.index(fault.part)]


def _reads_as_if_binary(fault: Fault, trajectory: Trajectory, value: float) -> BoolArray:
    """Returns a mask of the steps with a reading, of a sensor that reads 0 and 1 only."""
    readings = _readings(fault, trajectory)
    is_known = np.isfinite(readings)
    if not np.isin(readings[is_known], (0.0, 1.0)).all():
        return np.zeros(len(readings), dtype=np.bool_)
    return np.asarray(is_known & (readings == value))


class SilentNeuron(FaultKind):
    """A silent hidden neuron: a fault of the controller, which no diagnosis may propose."""

    def parts(self, _anatomy: Anatomy) -> tuple[str, ...]:
        """Returns the neurons of the largest network: the controller of a robot is unknown."""
        return tuple(str(neuron) for neuron in range(MAX_HIDDEN_NEURONS))

    def apply(self, variant: "ModelVariant", _anatomy: Anatomy, fault: Fault) -> None:
        """Silences the neuron."""
        variant.silent_neurons.add(int(fault.part))


FAILED_SENSOR = FailedSensor(
    name="sensor", words="the sensor {part} always reads 0", affects_dynamics=False
)
SENSOR_GAIN = SensorGain(
    name="sensor-gain",
    keyword="sensor",
    prefix="gain",
    bounds=(0.0, 2.0),
    levels=(0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.2, 1.4, 1.6, 1.8, 2.0),
    degenerates_to={1.0: None},
    # With a bias, a gain of 0 is a stuck reading, which no other kind expresses.
    degenerates_alone_to={0.0: FAILED_SENSOR},
    unit="times",
    words="the sensor {part} reads {severity:.2g} times what it should",
    affects_dynamics=False,
)
SENSOR_BIAS = SensorBias(
    name="sensor-bias",
    keyword="sensor",
    prefix="bias",
    bounds=(-1.0, 1.0),
    levels=(-0.9, -0.7, -0.5, -0.35, -0.2, -0.1, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9),
    degenerates_to={0.0: None},
    unit="of the reading's range",
    words="the sensor {part} reads {amount:.0%} of its range too {side}",
    affects_dynamics=False,
)
SENSOR_NOISE = SensorNoise(
    name="sensor-noise",
    keyword="sensor",
    prefix="noise",
    bounds=(0.0, 1.0),
    levels=(0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.6, 0.8),
    degenerates_to={0.0: None},
    unit="of the reading's range",
    words="the sensor {part} has noise of {severity:.0%} of its range",
    affects_dynamics=False,
)
SILENT_NEURON = SilentNeuron(name="neuron", searchable=False)


def silent_neurons(hypothesis: Hypothesis) -> frozenset[int]:
    """Returns the indices of the hidden neurons that are silent under a hypothesis."""
    return frozenset(int(fault.part) for fault in hypothesis.faults if fault.kind == SILENT_NEURON)
