"""Tests of the kinds of a search: those that apply to the robot, and those they degenerate to."""

import dataclasses

import pytest

from selfmodel.errors import InputError
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.faults.registry import (
    ALL_KINDS,
    KIND_SETS,
    KINDS,
    PAPER_KINDS,
)
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.model_variant import ModelVariant
from selfmodel.robot.robot import Robot
from selfmodel.testing import check_fault_kind
from tests.helpers.robots.arms import arm

ANGLES = (KINDS["break"], KINDS["jam-angle"])

BARE = """\
<mujoco><option timestep="0.005"/><worldbody>
  <geom type="plane" size="0 0 1"/>
  <body name="trunk" pos="0 0 0.5"><freejoint/><geom type="box" size="0.1 0.1 0.1"/>
    <body name="leg"><joint name="hip" axis="0 1 0" range="-60 60"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02"/></body></body>
</worldbody>
<actuator><position name="hip" joint="hip" kp="50" ctrlrange="-1 1"/></actuator></mujoco>
"""
"""A robot without sensors."""


def test_what_strikes_a_robot_stays_in_its_order_and_brings_its_other_names(robot: Robot):
    assert HypothesisSpace.of(PAPER_KINDS, robot.anatomy).kinds == PAPER_KINDS
    walking = tuple(kind for kind in ALL_KINDS if kind.base != "fixed")
    assert HypothesisSpace.of(ALL_KINDS, robot.anatomy).kinds == walking
    assert HypothesisSpace.of(ANGLES, robot.anatomy).kinds == (*ANGLES, KINDS["jam"])
    gains = (KINDS["sensor-gain"], KINDS["motor"])
    assert HypothesisSpace.of(gains, robot.anatomy).kinds == (*gains, KINDS["sensor"])


def test_a_kind_that_cannot_strike_a_robot_is_passed_over_and_alone_refused():
    anatomy = Robot("bare", BARE, 0.02).anatomy

    assert HypothesisSpace.of(PAPER_KINDS, anatomy).kinds == (KINDS["break"], KINDS["jam"])
    with pytest.raises(InputError, match="sensor, sensor-gain cannot affect any part"):
        HypothesisSpace.of((KINDS["sensor"], KINDS["sensor-gain"]), anatomy)


def test_the_kinds_of_a_set_are_those_of_the_robots_base_and_others_are_searched_if_named(
    quadruped: Robot,
):
    of_ground_and_air = {"friction", "slope", "wind", "crosswind", "roughness", "grip"}
    for kinds in (KIND_SETS["default"], ALL_KINDS, (*KIND_SETS["default"], KINDS["damping"])):
        names = {kind.name for kind in HypothesisSpace.of(kinds, arm().anatomy).kinds}
        assert names.isdisjoint({*of_ground_and_air, "payload"})
        assert "motor" in names
        assert ("load" in names) == (kinds == ALL_KINDS)  # in place of a weak servo on a real one
    named = (KINDS["motor"], KINDS["wind"], KINDS["slope"])
    assert HypothesisSpace.of(named, arm().anatomy).kinds == named
    walking = HypothesisSpace.of(KIND_SETS["environment"], quadruped.anatomy).kinds
    assert {kind.name for kind in walking} == {"friction", "slope", "wind", "payload"}


def test_a_kind_that_no_diagnosis_may_propose_is_refused(robot: Robot):
    with pytest.raises(InputError, match="no diagnosis may propose neuron: leave neuron out"):
        HypothesisSpace.of((KINDS["break"], KINDS["neuron"]), robot.anatomy)


def test_kinds_that_a_fault_is_of_at_some_degree_can_be_named(quadruped: Robot):
    """Diagnoses in a journal are parsed with these kinds."""
    sticky = Stick(name="sticky")
    stick = Stick(
        name="stick", bounds=(0, 2), levels=(1.0, 2.0), degenerates_to={0.0: sticky, 0.5: None}
    )

    check_fault_kind(stick, quadruped)
    assert HypothesisSpace.of((stick,), quadruped.anatomy).kinds == (stick, sticky)
    assert str(HypothesisSpace(quadruped.anatomy, (stick,)).parse("stick=0")) == "sticky"
    for wrong in (KINDS["neuron"], KINDS["slope"]):
        with pytest.raises(ValueError, match=f"stick degenerates to {wrong.name}"):
            check_fault_kind(dataclasses.replace(stick, degenerates_to={0.0: wrong}), quadruped)


class Stick(FaultKind):
    """Friction in every joint."""

    def apply(self, variant: ModelVariant, _anatomy: Anatomy, fault: Fault) -> None:
        """Adds the friction."""
        variant.model.dof_frictionloss[6:] += 0.1 + fault.severity
