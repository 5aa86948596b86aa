"""Promises of the scores of following a joint trajectory and a commanded velocity."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.recovery.scores import check_measurable
from selfmodel.recovery.tracking import Reference, following, tracking
from selfmodel.robot.robot import Robot
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.drivers import random_cpgs
from tests.helpers.robots.arms import arm

HINGES = arm().anatomy.hinges
TIME = np.arange(50) * arm().control_timestep


def ramp(rates: np.ndarray) -> np.ndarray:
    return TIME[:, np.newaxis] * rates


def moved(positions: np.ndarray) -> Trajectory:
    return Trajectory(arm().anatomy.names, TIME, {"joint_positions": positions})


@pytest.mark.parametrize(("offset", "joint"), [(-2.0, 0), (0.5, 5), (0.0, 3)])
def test_the_score_is_the_negative_rms_error_of_the_joints(offset: float, joint: int):
    positions = ramp(np.arange(6.0))
    away = positions.copy()
    away[:, joint] += offset
    score = tracking(Reference(HINGES, TIME, positions), arm())
    found = score.of(arm(), INTACT, moved(np.stack([positions, away])))
    assert found[0] == 0
    assert found[1] == pytest.approx(-abs(offset) / np.sqrt(6), abs=1e-12)
    assert score.unit == "rad"


def test_a_reference_of_other_times_is_interpolated_and_its_end_is_the_last_step():
    rates = np.arange(6.0)
    coarse = np.array([-1.0, 0.13, TIME[40]])
    score = tracking(Reference(HINGES, coarse, coarse[:, np.newaxis] * rates), arm())
    positions = ramp(rates)
    positions[41:] = 9
    assert score.of(arm(), INTACT, moved(positions[None]))[0] == pytest.approx(0, abs=1e-12)


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


# ---------------------------------------------------------------- a commanded velocity

COMMANDED = (0.8, -0.3, 0.4)
STEPS = 200
TURNED = Rotation.from_euler("z", 2.0)


def walked(robot: Robot, velocity: tuple[float, ...] = COMMANDED, **signals: object) -> Trajectory:
    """A run of a robot that has turned, and moves in its own frame as told."""
    forward, left, turn = velocity
    rows = {
        "base_position": (0.0, 0.0, robot.standing_height),
        "base_orientation": TURNED.as_quat(scalar_first=True),
        "base_linear_velocity": TURNED.apply((forward, left, 0.0)),
        "base_angular_velocity": (0.0, 0.0, turn),
    }
    every = {name: np.tile(row, (1, STEPS, 1)) for name, row in rows.items()} | signals
    return Trajectory(robot.anatomy.names, np.arange(STEPS) * robot.control_timestep, every)


@pytest.mark.parametrize(
    ("velocity", "expected"),
    [
        (COMMANDED, 1.0),
        ((0.3, -0.3, 0.4), (math.exp(-1) + 0.5) / 1.5),
        ((0.8, 0.2, 0.4), (math.exp(-1) + 0.5) / 1.5),
        ((0.8, -0.3, -0.6), (1 + 0.5 * math.exp(-4)) / 1.5),
        ((-9.0, 0.0, 9.0), 0.0),
    ],
)
def test_the_score_of_a_velocity_is_the_mean_reward_of_training(
    quadruped: Robot, velocity: tuple[float, ...], expected: float
):
    score = following(COMMANDED)
    (found,) = score.of(quadruped, INTACT, walked(quadruped, velocity))

    assert found == pytest.approx(expected, abs=1e-9)
    assert (score.name, score.unit, score.grows_with_time) == ("velocity", "", True)


def test_steps_after_a_fall_earn_nothing_and_those_without_a_measurement_are_left_out(
    quadruped: Robot,
):
    position = np.tile((0.0, 0.0, quadruped.standing_height), (1, STEPS, 1))
    position[:, 50:, 2] = 0.0
    fallen = walked(quadruped, base_position=position)
    turn = np.tile((0.0, 0.0, COMMANDED[2]), (1, STEPS, 1))
    turn[:, 100:] = np.nan

    assert following(COMMANDED).of(quadruped, INTACT, fallen) == pytest.approx(50 / STEPS)
    seen = walked(quadruped, base_angular_velocity=turn)
    assert following(COMMANDED).of(quadruped, INTACT, seen) == pytest.approx(1)
    none = walked(quadruped, base_angular_velocity=turn * np.nan)
    assert np.isnan(following(COMMANDED).of(quadruped, INTACT, none))


def test_the_velocity_of_a_robot_without_odometry_or_with_a_fixed_base_is_refused(
    quadruped: Robot,
):
    score, seen = following(COMMANDED), set(SIGNALS) - {"base_linear_velocity"}
    check_measurable(score, quadruped)
    with pytest.raises(InputError, match=r"base_linear_velocity.*velocity.*--score"):
        check_measurable(score, quadruped, seen)
    with pytest.raises(InputError, match="fixed"):
        check_measurable(score, arm())
