"""Tests of the smallest detectable severities, on synthetic losses."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from selfmodel.diagnosis.verdicts.detectable import DetectableSeverity, detectable_severities
from selfmodel.faults import BROKEN, FRICTION
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.joints import JAMMED, WEAK_MOTOR
from selfmodel.faults.kind import ENVIRONMENT, Fault
from selfmodel.faults.registry import KINDS
from selfmodel.faults.world import PAYLOAD
from selfmodel.robot.robot import Robot
from selfmodel.tasks import ROBOTS

ANATOMY = ROBOTS["quadruped"].robot().anatomy
NOISE = np.random.default_rng(0).normal(0, 0.1, 40)
KNEE = "front_left_knee"
Effect = Callable[[Fault], float]


def losses_of(effect: Effect) -> Callable[[Sequence[Hypothesis]], np.ndarray]:
    """Losses of 1, plus the effect of each fault with a noise of a tenth."""

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        totals = [sum(effect(fault) for fault in one.faults) for one in hypotheses]
        return np.array([1 + total * (1 + NOISE) for total in totals])

    return losses


def shows(part: str, limit: float, nominal: float) -> Effect:
    """The effect of a fault of a part that shows from a distance to the nominal severity on."""
    return lambda fault: 1.0 * (fault.part == part and abs(fault.severity - nominal) >= limit)


def found(effect: Effect, *kinds: object, best: Hypothesis = INTACT) -> list[DetectableSeverity]:
    return detectable_severities(best, HypothesisSpace.of(kinds, ANATOMY), losses_of(effect))


def test_the_largest_torque_that_shows_is_named_and_a_part_that_never_shows_has_no_limit():
    rows = {one.part: one for one in found(shows(KNEE, 0.25, 1.0), WEAK_MOTOR)}

    assert rows[KNEE] == DetectableSeverity("motor", KNEE, below=0.7, above=None)
    assert {(one.below, one.above) for part, one in rows.items() if part != KNEE} == {(None, None)}
    assert len(rows) == 8


@settings(max_examples=60)
@given(limit=st.floats(0.01, 1.2))
def test_the_bisection_finds_the_same_severity_as_a_scan_of_the_levels(limit: float):
    levels = sorted(WEAK_MOTOR.levels_at(ANATOMY, KNEE), reverse=True)
    below = [level for level in levels if level < 1.0]
    scanned = [(1.0 + below[0]) / 2, *below]
    expected = next((level for level in scanned if 1.0 - level >= limit), None)
    (row,) = [one for one in found(shows(KNEE, limit, 1.0), WEAK_MOTOR) if one.part == KNEE]

    assert row.below == expected


def test_a_bisection_asks_for_few_of_the_severities():
    asked: set[Hypothesis] = set()
    of = losses_of(shows(KNEE, 0.25, 1.0))

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        asked.update(hypotheses)
        return of(hypotheses)

    space = HypothesisSpace.of([WEAK_MOTOR], ANATOMY)
    detectable_severities(INTACT, space, losses)
    own = {one for one in asked if any(fault.part == KNEE for fault in one.faults)}

    assert 0 < len(own) <= np.ceil(np.log2(len(WEAK_MOTOR.levels_at(ANATOMY, KNEE)) + 2))


def test_both_sides_of_a_nominal_severity_have_a_limit():
    slope = KINDS["slope"]
    rows = found(shows(ENVIRONMENT, 0.1, 0.0), slope)
    levels = slope.levels_at(ANATOMY, ENVIRONMENT)

    assert [(one.kind, one.part) for one in rows] == [("slope", ENVIRONMENT)]
    assert rows[0].above == min(level for level in levels if level >= 0.1)
    assert rows[0].below == max(level for level in levels if level <= -0.1)


@pytest.mark.parametrize("true", [0.5, 0.8])
def test_the_nominal_friction_is_the_level_with_the_smallest_loss(true: float):
    """The model has its own friction, which no severity of the kind is nominal for."""
    levels = sorted(FRICTION.levels_at(ANATOMY, ENVIRONMENT))
    nominal = min(levels, key=lambda level: abs(level - true))

    def effect(fault: Fault) -> float:
        distance = abs(fault.severity - nominal)
        return 1e-7 * distance if distance < 0.19 else 1.0

    (row,) = found(effect, FRICTION)

    assert row.below is None or row.below < nominal
    assert row.above is None or row.above > nominal
    assert row.below == max((one for one in levels if one <= nominal - 0.19), default=None)
    assert row.above == min((one for one in levels if one >= nominal + 0.19), default=None)


def test_parts_with_a_fault_are_left_out():
    faulty = Hypothesis((Fault(WEAK_MOTOR, KNEE, 0.5),))
    parts = [one.part for one in found(shows(KNEE, 0.25, 1.0), WEAK_MOTOR, best=faulty)]

    assert len(parts) == 7
    assert KNEE not in parts


def test_kinds_without_a_severity_and_kinds_that_edit_the_specification_are_left_out():
    assert found(shows(KNEE, 0.25, 1.0), JAMMED, BROKEN) == []
    assert found(shows(KNEE, 0.25, 1.0), KINDS["roughness"]) == []
    parts = [(one.kind, one.part) for one in found(shows(KNEE, 0.25, 1.0), JAMMED, PAYLOAD)]
    assert parts == [("payload", part) for part in PAYLOAD.parts(ANATOMY)]


def test_a_severity_that_diverges_shows_and_a_best_that_diverges_shows_nothing():
    rows = found(lambda fault: np.inf if fault.severity < 0.5 else 0.0, WEAK_MOTOR)
    assert {one.below for one in rows} == {
        max(level for level in WEAK_MOTOR.levels_at(ANATOMY, KNEE) if level < 0.5)
    }

    space = HypothesisSpace.of([WEAK_MOTOR], ANATOMY)
    rows = detectable_severities(INTACT, space, lambda many: np.full((len(many), 40), np.inf))
    assert {one.below for one in rows} == {None}


def test_only_losses_clearly_worse_than_the_best_show(quadruped: Robot):
    """A difference of four standard errors is better than nothing, and too little to be found."""
    swing = np.resize([1.0, -1.0], 40)

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        rows = np.ones((len(hypotheses), 40))
        for row, one in zip(rows, hypotheses, strict=True):
            if one.faults:
                z = 6.0 if one.faults[0].part == KNEE else 4.0
                row += 0.01 * (z + swing * np.sqrt(39))  # noqa: PLW2901  # of an array, in place
        return rows

    space = HypothesisSpace.of([WEAK_MOTOR], quadruped.anatomy)
    rows = {one.part: one.below for one in detectable_severities(INTACT, space, losses)}

    assert rows.pop(KNEE) is not None
    assert set(rows.values()) == {None}
