"""Promises of the score of following a joint trajectory."""

import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.recovery.scores import Reference, tracking
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
