"""Promises of the scores ``energy`` and ``tracking``, and of the checks of a plug-in's score."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, strategies as st

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.recovery.scores import (
    DISPLACEMENT,
    ENERGY,
    LARGEST,
    UPRIGHT,
    WORK_WEIGHT,
    Reference,
    Score,
    checked,
    joint_work,
    tracking,
)
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.drivers import random_controllers, random_cpgs
from tests.helpers.robots.arms import arm


def test_work_is_power_over_time_in_either_direction(quadruped: Robot):
    hinges = len(quadruped.anatomy.hinges)
    effort, velocity = np.zeros((1, 3, hinges)), np.ones((1, 3, hinges))
    effort[0, 0, 0], effort[0, 1, 1], effort[0, 2, 2] = 2.0, -3.0, np.nan
    names, time = quadruped.anatomy.names, np.arange(3) * quadruped.control_timestep
    run = Behaviour(names, time, {"joint_efforts": effort, "joint_velocities": velocity})
    np.testing.assert_allclose(joint_work(quadruped, run), [5 * quadruped.control_timestep])
    unknown = {"joint_efforts": np.full_like(effort, np.nan), "joint_velocities": velocity}
    assert np.isnan(joint_work(quadruped, Behaviour(names, time, unknown))).all()


def test_the_score_is_the_upright_displacement_less_the_work_over_the_weight(quadruped: Robot):
    drivers = random_controllers(quadruped, 4)
    lost = parse("break:front_left_shoulder", quadruped.anatomy)
    for hypothesis in (INTACT, lost):
        runs = [(hypothesis, driver) for driver in drivers]
        run = Simulator(quadruped, 1).run(runs, 100, ENERGY.record).behaviour
        spent = UPRIGHT.of(quadruped, hypothesis, run) - ENERGY.of(quadruped, hypothesis, run)
        weight = joint_work(quadruped, run) * WORK_WEIGHT / spent
        gravity = np.linalg.norm(quadruped.model.opt.gravity)
        masses = weight / gravity
        np.testing.assert_allclose(masses, masses[0])
        whole = quadruped.model.body_mass.sum()
        assert masses[0] < whole if hypothesis == lost else np.isclose(masses[0], whole)


HINGES = arm().anatomy.hinges
TIME = np.arange(50) * arm().control_timestep


def ramp(rates: np.ndarray) -> np.ndarray:
    return TIME[:, np.newaxis] * rates


def moved(positions: np.ndarray) -> Behaviour:
    return Behaviour(arm().anatomy.names, TIME, {"joint_positions": positions})


@given(offset=st.floats(-3, 3), joint=st.integers(0, 5))
def test_the_score_is_the_negative_rms_error_of_the_joints(offset: float, joint: int):
    positions = ramp(np.arange(6.0))
    away = positions.copy()
    away[:, joint] += offset
    score = tracking(Reference(HINGES, TIME, positions), arm())
    found = score.of(arm(), INTACT, moved(np.stack([positions, away])))
    assert found[0] == 0
    assert found[1] == pytest.approx(-abs(offset) / np.sqrt(6), abs=1e-12)
    assert score.unit == "rad"


def test_a_reference_of_other_times_is_interpolated():
    rates = np.arange(6.0)
    coarse = np.array([-1.0, 0.13, 5.0])
    score = tracking(Reference(HINGES, coarse, coarse[:, np.newaxis] * rates), arm())
    assert score.of(arm(), INTACT, moved(ramp(rates)[None]))[0] == pytest.approx(0, abs=1e-12)


def test_steps_after_the_reference_do_not_count():
    positions = ramp(np.zeros(6))
    positions[10:] = 1.0
    score = tracking(Reference(HINGES, TIME[:10], np.zeros((10, 6))), arm())
    assert score.of(arm(), INTACT, moved(positions[None]))[0] == 0


def test_joints_that_only_one_of_robot_and_reference_has_do_not_count():
    named = ("camera_pan", "joint3")
    score = tracking(Reference(named, TIME, np.ones((50, 2)) * [5, 1]), arm())
    positions = np.zeros((1, 50, 6))
    positions[..., 2] = 1.0
    assert score.of(arm(), INTACT, moved(positions))[0] == 0


def test_joints_of_a_detached_limb_do_not_count_unless_no_joint_remains():
    score = tracking(Reference(HINGES, TIME, np.zeros((50, 6))), arm())
    positions = np.zeros((1, 50, 6))
    positions[..., 4:] = 1.0
    broken = parse("break:joint5", arm().anatomy)
    assert score.of(arm(), broken, moved(positions))[0] == 0
    whole = parse("break:joint1", arm().anatomy)
    assert score.of(arm(), whole, moved(positions)) == score.of(arm(), INTACT, moved(positions))


def test_values_that_a_physical_robot_did_not_observe_do_not_count():
    score = tracking(Reference(HINGES, TIME, np.zeros((50, 6))), arm())
    (driver,) = random_cpgs(arm(), 1)
    plan = TrialPlan("one", "after", driver, 50, seed=0)
    positions = np.full((50, 6), np.nan)
    assert np.isnan(score.of_trial(arm(), INTACT, Trial(plan, "arm", moved(positions), "")))
    positions[3:7, 2] = -0.5
    assert score.of_trial(arm(), INTACT, Trial(plan, "arm", moved(positions), "")) == -0.5


@pytest.mark.parametrize(
    ("hinges", "time", "positions", "sentence"),
    [
        (HINGES, TIME, np.zeros((50, 5)), "a column per joint"),
        (HINGES, TIME[:1], np.zeros((1, 6)), "two rows or more"),
        (HINGES, TIME[::-1], np.zeros((50, 6)), "strictly increasing"),
        (HINGES, TIME, np.full((50, 6), np.inf), "finite"),
        (("elbow",), TIME, np.zeros((50, 1)), "elbow.*robot has joint1"),
        (HINGES, TIME + 1, np.zeros((50, 6)), "begin at 0 s"),
    ],
)
def test_an_unusable_reference_is_refused(
    hinges: tuple[str, ...], time: np.ndarray, positions: np.ndarray, sentence: str
):
    with pytest.raises(InputError, match=sentence):
        tracking(Reference(hinges, time, positions), arm())


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
