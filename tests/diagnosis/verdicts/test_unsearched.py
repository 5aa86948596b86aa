"""Tests of unsearched kinds: a significantly better fault is found and reported."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pytest

from selfmodel.comparators import SEGMENT_PREDICTION, SENSOR_SERIES
from selfmodel.controllers.controller import Controller
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.diagnosis import Diagnosis, UnsearchedFault
from selfmodel.diagnosis.loss_functions import LossFunctions
from selfmodel.diagnosis.sentences import confidence_sentence
from selfmodel.diagnosis.serialization import confidence_to_dict, ranking_to_list
from selfmodel.diagnosis.verdicts.significance import NEGLIGIBLE_LOSS
from selfmodel.diagnosis.verdicts.unsearched import best_unsearched_fault
from selfmodel.faults import ROUGHNESS
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import ALL_KINDS, PAPER_KINDS
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.studies.experiment import draw_reality
from selfmodel.trials.trial import Stage, Trial, TrialPlan
from tests.helpers.drivers import random_controllers
from tests.helpers.memory import in_memory

PIECES = 60
SMALL = dataclasses.replace(Settings().scaled(12), generations=2)


def of(robot: Robot, means: Mapping[str, float]) -> Callable[[Sequence[Hypothesis]], np.ndarray]:
    """Losses with scatter: mean 1, but for the named hypotheses."""
    scatter = 0.01 * np.random.default_rng(0).normal(size=PIECES)
    known = {parse(text, robot.anatomy): mean for text, mean in means.items()}
    return lambda hypotheses: np.array(
        [known.get(one, 1.0) + scatter * (1 + known.get(one, 1.0)) for one in hypotheses]
    )


def test_what_explains_more_is_returned(quadruped: Robot):
    after = of(quadruped, {"wind=12": 0.8, "crosswind=12": 0.9})
    found = best_unsearched_fault(
        INTACT,
        HypothesisSpace(quadruped.anatomy, PAPER_KINDS),
        LossFunctions(after, after, of(quadruped, {})),
    )

    wind, crosswind = (parse(text, quadruped.anatomy) for text in ("wind=12", "crosswind=12"))
    assert found == UnsearchedFault(wind, "wind", {"crosswind": crosswind})


def test_what_helped_before_as_well_mends_the_model_and_is_no_change(quadruped: Robot):
    after, before = (of(quadruped, {"wind=12": mean}) for mean in (0.8, 0.79))
    found = best_unsearched_fault(
        INTACT, HypothesisSpace(quadruped.anatomy, PAPER_KINDS), LossFunctions(after, after, before)
    )

    assert found is None


def never(_: Sequence[Hypothesis]) -> np.ndarray:
    raise AssertionError


def test_where_nothing_from_before_can_be_compared_nothing_is_simulated(quadruped: Robot):
    losses = LossFunctions(never, never, None)

    assert (
        best_unsearched_fault(INTACT, HypothesisSpace(quadruped.anatomy, PAPER_KINDS), losses)
        is None
    )


def test_where_nothing_is_left_to_explain_nothing_is_simulated(quadruped: Robot):
    def perfect(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        return np.full((len(hypotheses), PIECES), NEGLIGIBLE_LOSS)

    found = best_unsearched_fault(
        INTACT,
        HypothesisSpace(quadruped.anatomy, PAPER_KINDS),
        LossFunctions(perfect, never, never),
    )

    assert found is None


def test_a_best_hypothesis_that_diverges_is_not_compared(quadruped: Robot):
    def diverged(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        return np.full((len(hypotheses), PIECES), np.inf)

    losses = LossFunctions(diverged, diverged, of(quadruped, {}))

    assert (
        best_unsearched_fault(INTACT, HypothesisSpace(quadruped.anatomy, PAPER_KINDS), losses)
        is None
    )


def test_only_what_was_not_considered_is_asked_about_and_nothing_that_reshapes(quadruped: Robot):
    asked: set[Hypothesis] = set()

    def screen(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        asked.update(hypotheses)
        return of(quadruped, {})(hypotheses)

    best = parse("sensor:back_left_angle", quadruped.anatomy)
    flat = of(quadruped, {})
    found = best_unsearched_fault(
        best, HypothesisSpace(quadruped.anatomy, PAPER_KINDS), LossFunctions(flat, screen, flat)
    )
    kinds = {fault.kind for one in asked - {best} for fault in one.faults}

    assert found is None
    assert kinds >= set(ALL_KINDS) - set(PAPER_KINDS) - {ROUGHNESS}
    assert ROUGHNESS not in kinds
    # A sensor gain replaces the failed sensor; all other faults are added to it.
    assert parse("sensor:back_left_angle=gain0.5", quadruped.anatomy) in asked
    assert all(best.faults[0] in one.faults or len(one) == 1 for one in asked)


def test_with_all_kinds_considered_nothing_is_outside(quadruped: Robot):
    flat = of(quadruped, {})

    assert (
        best_unsearched_fault(
            INTACT, HypothesisSpace(quadruped.anatomy, ALL_KINDS), LossFunctions(flat, flat, flat)
        )
        is None
    )


def trial(robot: Robot, truth: str, gait: Controller, stage: Stage, number: int) -> Trial:
    """A trial across a small reality gap."""
    reality = draw_reality(robot, 3, 0.03)
    physical = reality.robot(robot, parse(truth, robot.anatomy), stream=number)
    plan = TrialPlan(f"{number:02d}-{stage}", stage, gait, SMALL.steps, 0)
    return in_memory(robot)(physical, plan)


def diagnosed(robot: Robot, truth: str, gait: Controller) -> Diagnosis:
    search = DiagnosticSearch(
        Simulator(robot, 1),
        SEGMENT_PREDICTION,
        SMALL,
        intact=[trial(robot, "intact", gait, "before", 0)],
    )
    after = [trial(robot, truth, gait, "after", 1)]
    return search(after, [], np.random.default_rng(0), lambda _: None)


@pytest.mark.parametrize(
    ("truth", "kind"),
    [
        ("wind=30", "wind"),
        pytest.param("sensor:back_left_angle=gain0.3", "sensor-gain", marks=pytest.mark.search),
        pytest.param("intact", None, marks=pytest.mark.search),
    ],
)
def test_a_weak_failure_of_another_kind_is_unexplained_and_named_across_a_gap(
    quadruped: Robot, truth: str, kind: str | None
):
    found = diagnosed(quadruped, truth, random_controllers(quadruped, 5)[2])

    assert (found.verdict == "unexplained") == (kind is not None)
    assert (found.unsearched.kind if found.unsearched else None) == kind
    told = confidence_sentence(
        {"diagnosis": ranking_to_list(found.ranked), **confidence_to_dict(found)}
    )
    assert told.startswith(
        f"Unexplained: {found.unsearched.hypothesis}" if found.unsearched else "Intact"
    )
    assert (f"add {kind} to --kinds" in told) == (kind is not None)
    assert all(fault.kind in PAPER_KINDS for one in found.ranked for fault in one.hypothesis.faults)


@pytest.mark.search
def test_comparators_of_whole_trials_ask_for_nothing_outside(quadruped: Robot):
    gait = random_controllers(quadruped, 5)[2]
    search = DiagnosticSearch(
        Simulator(quadruped, 1),
        SENSOR_SERIES,
        dataclasses.replace(SMALL, steps=300),
        intact=[trial(quadruped, "intact", gait, "before", 0)],
    )
    found = search(
        [trial(quadruped, "wind=30", gait, "after", 1)],
        [],
        np.random.default_rng(0),
        lambda _: None,
    )

    assert found.unsearched is None
