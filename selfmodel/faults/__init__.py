"""Fault kinds, hypotheses, and the space of hypotheses about one robot."""

from selfmodel.faults.broken import BROKEN
from selfmodel.faults.ground import FRICTION, SLOPE
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.jammed import JAMMED, JAMMED_AT_ANGLE
from selfmodel.faults.kind import ENVIRONMENT, Fault, FaultKind, uniform_bounds, uniform_levels
from selfmodel.faults.motor import WEAK_MOTOR
from selfmodel.faults.neuron import SILENT_NEURON
from selfmodel.faults.registry import ALL_KINDS, KINDS, PAPER_KINDS, notation_kinds
from selfmodel.faults.sensor import FAILED_SENSOR, SENSOR_BIAS, SENSOR_GAIN, SENSOR_NOISE
from selfmodel.faults.terrain import ROUGHNESS
from selfmodel.faults.wind import CROSSWIND, WIND

__all__ = [
    "ALL_KINDS",
    "BROKEN",
    "CROSSWIND",
    "ENVIRONMENT",
    "FAILED_SENSOR",
    "FRICTION",
    "JAMMED",
    "JAMMED_AT_ANGLE",
    "KINDS",
    "PAPER_KINDS",
    "ROUGHNESS",
    "SENSOR_BIAS",
    "SENSOR_GAIN",
    "SENSOR_NOISE",
    "SILENT_NEURON",
    "SLOPE",
    "WEAK_MOTOR",
    "WIND",
    "Fault",
    "FaultKind",
    "HypothesisSpace",
    "notation_kinds",
    "uniform_bounds",
    "uniform_levels",
]
