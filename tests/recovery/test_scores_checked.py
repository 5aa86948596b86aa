"""Promises of the checks of a plug-in's score: a faulty one is refused by name, with the remedy."""

from collections.abc import Callable

import numpy as np
import pytest

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.recovery.scores import DISPLACEMENT, LARGEST, Score, checked
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import Behaviour

RUNS, STEPS = 3, 4


def ran(robot: Robot, x: float = 1.0) -> Behaviour:
    """Three runs, of which the last ends at ``x``."""
    position = np.ones((RUNS, STEPS, 3))
    position[-1, -1, 0] = x
    return Behaviour(robot.anatomy.names, np.arange(STEPS) * 0.01, {"base_position": position})


def scored(robot: Robot, of: Callable[[Behaviour], object], x: float = 1.0) -> FloatArray:
    """What a score of a plug-in returns once it is checked."""

    def mine(_robot: Robot, _hypothesis: Hypothesis, behaviour: Behaviour) -> FloatArray:
        return of(behaviour)  # type: ignore[return-value]

    score = checked(Score("mine", ("base_position",), mine), "my.module:SCORE")
    return score.of(robot, INTACT, ran(robot, x))


@pytest.mark.parametrize(
    "record", [("base_pos",), ("base_position", "speed"), (), "base_position", [], None]
)
def test_signals_that_are_unknown_are_refused_when_the_score_is_loaded(record: object):
    score = Score("mine", record, DISPLACEMENT.of)  # type: ignore[arg-type]

    with pytest.raises(InputError, match=r"my.module:SCORE.*record=.*expected.*base_position.*cor"):
        checked(score, "my.module:SCORE")


@pytest.mark.parametrize(
    ("of", "message"),
    [
        (
            lambda run: run["base_position"][..., 0],
            r"expected one number for each of 3 runs.*\(3, 4",
        ),
        (lambda run: run["base_position"].sum(), r"shape \(3,\), got shape \(\)"),
        (lambda _run: None, r"got shape \(\)"),
        (lambda _run: ["fast"] * RUNS, "got list .*return an array of numbers"),
        (lambda _run: [np.nan, 0, np.nan], "got nan for 2 of them"),
        (lambda _run: [np.inf, 0, 1], "got inf for 1 of them"),
        (lambda run: run["joint_efforts"], "joint_efforts was not recorded.*add the signal"),
    ],
)
def test_values_that_are_no_scores_are_refused_with_the_remedy(
    quadruped: Robot, of: Callable[[Behaviour], object], message: str
):
    with pytest.raises(InputError, match=f"the score 'my.module:SCORE'.*{message}"):
        scored(quadruped, of)


@pytest.mark.parametrize("x", [np.nan, np.inf, -2 * LARGEST])
def test_a_run_that_was_not_observed_or_diverged_may_have_no_score(quadruped: Robot, x: float):
    values = scored(quadruped, lambda _run: [1, 2, np.nan], x)
    np.testing.assert_array_equal(values, [1, 2, np.nan])
    with pytest.raises(InputError, match="got nan for 1 of them"):
        scored(quadruped, lambda _run: [np.nan, 2, np.nan], x)


def test_a_right_score_is_as_before(quadruped: Robot):
    one = checked(DISPLACEMENT, "mine")
    run = ran(quadruped, 5.0)
    assert one.of(quadruped, INTACT, run).tolist() == [0, 0, 4]
    assert (one.name, one.record, one.unit, one.grows_with_time) == (
        *("displacement", ("base_position",), "m", True),
    )
    assert scored(quadruped, lambda _run: [-np.inf, 1, 2]).tolist() == [-np.inf, 1, 2]


def test_an_error_of_the_plug_in_itself_remains(quadruped: Robot):
    with pytest.raises(KeyError, match="weights"):
        scored(quadruped, lambda _run: {}["weights"])
