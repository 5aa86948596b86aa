from .build import build as build
from .hypothesis import INTACT as INTACT, Hypothesis as Hypothesis
from .hypothesis_space import HypothesisSpace as HypothesisSpace
from .kind import (
    ENVIRONMENT as ENVIRONMENT,
    Fault as Fault,
    FaultKind as FaultKind,
    uniform_bounds as uniform_bounds,
    uniform_levels as uniform_levels,
)
from .kinds.broken import BROKEN as BROKEN
from .kinds.damping import DAMPED_JOINT as DAMPED_JOINT
from .kinds.delay import GROWN_DELAY as GROWN_DELAY
from .kinds.encoder import ENCODER_OFFSET as ENCODER_OFFSET, ENCODER_SLIP as ENCODER_SLIP
from .kinds.grip import LOST_GRIP as LOST_GRIP
from .kinds.ground import FRICTION as FRICTION, SLOPE as SLOPE
from .kinds.jammed import JAMMED as JAMMED, JAMMED_AT_ANGLE as JAMMED_AT_ANGLE
from .kinds.joint_friction import JOINT_FRICTION as JOINT_FRICTION
from .kinds.motor import WEAK_MOTOR as WEAK_MOTOR
from .kinds.neuron import SILENT_NEURON as SILENT_NEURON
from .kinds.payload import PAYLOAD as PAYLOAD
from .kinds.sensor import (
    FAILED_SENSOR as FAILED_SENSOR,
    SENSOR_BIAS as SENSOR_BIAS,
    SENSOR_GAIN as SENSOR_GAIN,
    SENSOR_NOISE as SENSOR_NOISE,
)
from .kinds.terrain import ROUGHNESS as ROUGHNESS
from .kinds.wind import CROSSWIND as CROSSWIND, WIND as WIND
from .registry import ALL_KINDS as ALL_KINDS, KINDS as KINDS, PAPER_KINDS as PAPER_KINDS
