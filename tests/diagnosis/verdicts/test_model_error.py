"""Tests of model error: it is no fault, and no indistinguishable hypothesis depends on it."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
import pytest

from selfmodel.comparators import SEGMENT_PREDICTION
from selfmodel.controllers.controller import Controller
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.diagnosis.loss_functions import Losses, LossFunctions
from selfmodel.diagnosis.verdicts.model_error import any_fault_is_model_error, is_model_error
from selfmodel.faults import FRICTION
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.studies.experiment import draw_reality
from selfmodel.trials.trial import Stage, Trial, TrialPlan
from tests.helpers.drivers import random_controllers
from tests.helpers.memory import in_memory

PIECES = 60
SMALL = dataclasses.replace(Settings().scaled(12), generations=2, steps=400)
SLIPPERY, KNEE = "friction=0.2", "break:front_left_knee"


def of(robot: Robot, means: Mapping[str, float]) -> Losses:
    """Losses with scatter: mean 1, but for the named hypotheses."""
    scatter = 0.01 * np.random.default_rng(0).normal(size=PIECES)
    known = {parse(text, robot.anatomy): mean for text, mean in means.items()}
    return lambda hypotheses: np.array([known.get(one, 1.0) * (1 + scatter) for one in hypotheses])


def test_a_fault_that_alone_would_have_helped_before_mends(quadruped: Robot):
    anatomy = quadruped.anatomy
    both, knee = (parse(text, anatomy) for text in (f"{KNEE}+{SLIPPERY}", KNEE))
    slippery = parse(SLIPPERY, anatomy)
    space = HypothesisSpace(anatomy, PAPER_KINDS)
    after = of(quadruped, {str(both): 0.5, KNEE: 0.7, SLIPPERY: 0.8})
    losses = LossFunctions(after, after, of(quadruped, {SLIPPERY: 0.8, KNEE: 2.0}))

    assert is_model_error(both, knee, losses, space)
    assert not is_model_error(both, slippery, losses, space)
    assert any_fault_is_model_error(both, losses, space)
    assert not any_fault_is_model_error(knee, losses, space)
    assert not any_fault_is_model_error(INTACT, losses, space)


def never(_: Sequence[Hypothesis]) -> np.ndarray:
    raise AssertionError


def test_where_nothing_from_before_can_be_compared_nothing_mends(quadruped: Robot):
    knee = parse(KNEE, quadruped.anatomy)

    space = HypothesisSpace(quadruped.anatomy, PAPER_KINDS)

    assert not is_model_error(knee, INTACT, LossFunctions(never, never, None), space)


def test_of_what_would_have_done_harm_nothing_else_is_asked(quadruped: Robot):
    losses = LossFunctions(never, never, of(quadruped, {KNEE: 2.0}))

    space = HypothesisSpace(quadruped.anatomy, PAPER_KINDS)

    assert not is_model_error(parse(KNEE, quadruped.anatomy), INTACT, losses, space)


def trial(robot: Robot, truth: str, gait: Controller, stage: Stage, number: int) -> Trial:
    """A trial across a small reality gap, on slippery ground before and after the failure."""
    reality = draw_reality(robot, 3, 0.02)
    hidden = parse("+".join({truth, SLIPPERY} - {"intact"}), robot.anatomy)
    plan = TrialPlan(f"{number:02d}-{stage}", stage, gait, SMALL.steps, 0)
    return in_memory(robot)(reality.robot(robot, hidden, stream=number), plan)


def diagnosed(robot: Robot, truth: str, *, looks_back: bool) -> Diagnosis:
    gait = random_controllers(robot, 5)[2]
    search = DiagnosticSearch(
        Simulator(robot, 1),
        SEGMENT_PREDICTION,
        SMALL,
        (*PAPER_KINDS, FRICTION),
        intact=[trial(robot, "intact", gait, "before", 0)] if looks_back else (),
    )
    after = [trial(robot, truth, gait, "after", 1)]
    return search(after, [], np.random.default_rng(0), lambda _: None)


@pytest.mark.search
@pytest.mark.parametrize("truth", ["intact", "jam:front_left_knee"])
def test_ground_that_always_was_slippery_is_no_change_nor_part_of_a_rival(
    quadruped: Robot, truth: str
):
    alone = diagnosed(quadruped, truth, looks_back=False)
    found = diagnosed(quadruped, truth, looks_back=True)

    assert "friction" in str(alone.best)
    assert str(found.best) == truth
    assert not any("friction" in str(rival) for rival in found.indistinguishable)
