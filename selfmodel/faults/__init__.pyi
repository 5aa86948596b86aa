from .build import build as build
from .hypothesis import INTACT as INTACT, Hypothesis as Hypothesis
from .hypothesis_space import HypothesisSpace as HypothesisSpace
from .joints import (
    BROKEN as BROKEN,
    DAMPED_JOINT as DAMPED_JOINT,
    ENCODER_OFFSET as ENCODER_OFFSET,
    ENCODER_SLIP as ENCODER_SLIP,
    JAMMED as JAMMED,
    JAMMED_AT_ANGLE as JAMMED_AT_ANGLE,
    JOINT_FRICTION as JOINT_FRICTION,
    LOADED_LINK as LOADED_LINK,
    LOCKED_LEG as LOCKED_LEG,
    LOST_GRIP as LOST_GRIP,
    SERVO_GAIN as SERVO_GAIN,
    WEAK_MOTOR as WEAK_MOTOR,
)
from .kind import (
    ENVIRONMENT as ENVIRONMENT,
    Fault as Fault,
    FaultKind as FaultKind,
)
from .registry import ALL_KINDS as ALL_KINDS, KINDS as KINDS, PAPER_KINDS as PAPER_KINDS
from .sensors import (
    FAILED_SENSOR as FAILED_SENSOR,
    SENSOR_BIAS as SENSOR_BIAS,
    SENSOR_GAIN as SENSOR_GAIN,
    SENSOR_NOISE as SENSOR_NOISE,
    SILENT_NEURON as SILENT_NEURON,
)
from .world import (
    CROSSWIND as CROSSWIND,
    FRICTION as FRICTION,
    GROWN_DELAY as GROWN_DELAY,
    PAYLOAD as PAYLOAD,
    ROUGHNESS as ROUGHNESS,
    SLOPE as SLOPE,
    WIND as WIND,
)
