"""Promises of the warning about a trial that falls short of its prediction: the likely cause."""

import math
import re

import pytest

from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.recovery.result import TrialScore, shortfall
from selfmodel.recovery.scores import DISPLACEMENT
from selfmodel.robot.robot import Robot
from tests.helpers.gaits import gait, logged

STEP = 0.00125
"""A quarter of the time step of the quadruped, s."""


@pytest.mark.parametrize(
    ("walked", "fine", "fall", "tried", "cause"),
    [
        (5.7, 11.0, None, "intact", None),
        (math.nan, 11.0, None, "intact", None),
        (1.5, 9.2, None, "intact", "its motors, contacts or mass differ from the robot's"),
        (
            1.5,
            4.1,
            None,
            "intact",
            f"predicts 4.100 m at a quarter .* timestep={STEP}, or armature",
        ),
        (1.5, math.nan, None, "intact", "the self-model flatters"),
        (1.5, 4.1, 30, "intact", "the robot fell at step 30$"),
        (1.5, 4.1, None, "break:front_left_knee", "break:front_left_knee, and is intact with this"),
    ],
)
def test_half_of_what_was_predicted_is_said_with_the_likely_cause(
    quadruped: Robot,
    *,
    walked: float,
    fine: float,
    fall: int | None,
    tried: str,
    cause: str | None,
):
    trial = logged(gait(steps=20))
    found = TrialScore(trial, INTACT, DISPLACEMENT, walked, fall)

    def simulated(robot: Robot) -> float:
        return 11.3 if robot is quadruped else fine

    hypothesis = parse(tried, quadruped.anatomy)
    said = shortfall(found, 11.3, hypothesis, quadruped, simulated)
    assert (said is None) == (cause is None)
    if said is not None and cause is not None:
        assert said.startswith(
            f"trial {trial.plan.name}: displacement 1.500 m, where 11.300 m was predicted: "
        )
        assert re.search(cause, said)


@pytest.mark.parametrize("predicted", [math.nan, -1.0, 0.0])
def test_a_score_that_was_not_predicted_to_be_large_is_no_shortfall(
    quadruped: Robot, predicted: float
):
    trial = logged(gait(steps=20))
    found = TrialScore(trial, INTACT, DISPLACEMENT, -2.0, None)
    assert shortfall(found, predicted, INTACT, quadruped, lambda _: 0.0) is None
