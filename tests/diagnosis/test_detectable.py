"""Promises of the smallest detectable weakness: the largest torque from which on all are seen."""

from collections.abc import Sequence

import numpy as np

from selfmodel.diagnosis.detectable import DetectableWeakness, detectable_weaknesses
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.jammed import JAMMED
from selfmodel.faults.kind import Fault
from selfmodel.faults.motor import WEAK_MOTOR
from selfmodel.robot.robot import Robot

NOISE = np.random.default_rng(0).normal(0, 0.1, 40)


def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
    """Losses in which a first joint shows its torque, and the others show nothing."""
    rows = []
    for one in hypotheses:
        lost = sum(1 - f.severity for f in one.faults if f.part == "front_left_knee")
        rows.append(1 + (lost + lost * NOISE if lost > 0.25 else 0 * NOISE))
    return np.array(rows)


def test_the_largest_torque_that_shows_is_named_and_what_never_shows_is_none(quadruped: Robot):
    space = HypothesisSpace.of([WEAK_MOTOR], quadruped.anatomy)
    found = {one.joint: one for one in detectable_weaknesses(INTACT, space, losses)}

    assert found["front_left_knee"] == DetectableWeakness("front_left_knee", 0.7)
    assert {one.torque for name, one in found.items() if name != "front_left_knee"} == {None}
    assert len(found) == 8


def test_joints_with_a_fault_and_spaces_without_weak_motors_are_left_out(quadruped: Robot):
    space = HypothesisSpace.of([WEAK_MOTOR], quadruped.anatomy)
    faulty = Hypothesis((Fault(WEAK_MOTOR, "front_left_knee", 0.5),))
    named = {one.joint for one in detectable_weaknesses(faulty, space, losses)}

    assert len(named) == 7
    assert "front_left_knee" not in named
    jams = HypothesisSpace.of([JAMMED], quadruped.anatomy)
    assert detectable_weaknesses(INTACT, jams, losses) == []
