"""Fault kinds, hypotheses and their notation; ``build`` applies a hypothesis to a model."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from selfmodel.faults.broken import BROKEN as BROKEN
    from selfmodel.faults.build import build as build
    from selfmodel.faults.ground import FRICTION as FRICTION, SLOPE as SLOPE
    from selfmodel.faults.hypothesis import INTACT as INTACT, Hypothesis as Hypothesis
    from selfmodel.faults.hypothesis_space import HypothesisSpace as HypothesisSpace
    from selfmodel.faults.jammed import JAMMED as JAMMED, JAMMED_AT_ANGLE as JAMMED_AT_ANGLE
    from selfmodel.faults.kind import (
        ENVIRONMENT as ENVIRONMENT,
        Fault as Fault,
        FaultKind as FaultKind,
        uniform_bounds as uniform_bounds,
        uniform_levels as uniform_levels,
    )
    from selfmodel.faults.motor import WEAK_MOTOR as WEAK_MOTOR
    from selfmodel.faults.neuron import SILENT_NEURON as SILENT_NEURON
    from selfmodel.faults.registry import (
        ALL_KINDS as ALL_KINDS,
        KINDS as KINDS,
        PAPER_KINDS as PAPER_KINDS,
    )
    from selfmodel.faults.sensor import (
        FAILED_SENSOR as FAILED_SENSOR,
        SENSOR_BIAS as SENSOR_BIAS,
        SENSOR_GAIN as SENSOR_GAIN,
        SENSOR_NOISE as SENSOR_NOISE,
    )
    from selfmodel.faults.terrain import ROUGHNESS as ROUGHNESS
    from selfmodel.faults.wind import CROSSWIND as CROSSWIND, WIND as WIND
else:
    __getattr__, __dir__, __all__ = lazy_loader.attach(
        __name__,
        submod_attrs={
            "broken": ["BROKEN"],
            "build": ["build"],
            "ground": ["FRICTION", "SLOPE"],
            "hypothesis": ["INTACT", "Hypothesis"],
            "hypothesis_space": ["HypothesisSpace"],
            "jammed": ["JAMMED", "JAMMED_AT_ANGLE"],
            "kind": ["ENVIRONMENT", "Fault", "FaultKind", "uniform_bounds", "uniform_levels"],
            "motor": ["WEAK_MOTOR"],
            "neuron": ["SILENT_NEURON"],
            "registry": ["ALL_KINDS", "KINDS", "PAPER_KINDS"],
            "sensor": ["FAILED_SENSOR", "SENSOR_BIAS", "SENSOR_GAIN", "SENSOR_NOISE"],
            "terrain": ["ROUGHNESS"],
            "wind": ["CROSSWIND", "WIND"],
        },
    )
