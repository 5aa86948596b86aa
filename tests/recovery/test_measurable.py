"""Promises about what can be scored: refused before the first trial, and what needs no odometry."""

from collections.abc import Mapping
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

import selfmodel
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT
from selfmodel.recovery.scores import (
    STEPS,
    UPRIGHT,
    check_measurable,
    observed_in,
    observed_of,
    upright_within,
)
from selfmodel.robot.robot import Robot
from selfmodel.tasks import load
from selfmodel.trials.signals import SIGNALS, Signal
from selfmodel.trials.trajectory import Trajectory
from tests.helpers.robots.arms import arm

SMALL = selfmodel.Settings(steps=60, trials=1, generations=1, diagnostic_search="ea").scaled(4)
KNEE = "break:front_left_knee"
ONBOARD: tuple[Signal, ...] = (
    *("sensors", "joint_positions", "joint_velocities"),
    *("base_orientation", "base_angular_velocity"),
)


def onboard(observation: Mapping[str, np.ndarray]) -> Mapping[str, np.ndarray]:
    return {signal: observation[signal] for signal in ONBOARD}


def robots(**options: object) -> tuple[list[Mock], list[selfmodel.EnvironmentRobot]]:
    """The resets of a healthy and a damaged walking quadruped, and these robots."""
    model, resets, physical = selfmodel.load_robot("quadruped"), [], []
    for hypothesis in ("intact", KNEE):
        env = load("quadruped", "walk", {"hypothesis": hypothesis})
        env.reset = Mock(wraps=env.reset)
        resets.append(env.reset)
        clock = env.physics.time
        physical.append(selfmodel.EnvironmentRobot(env, model, clock=clock, **options))
    return resets, physical


@pytest.mark.parametrize(
    ("options", "trials"),
    [({}, 0), ({"observe": onboard, "signals": ONBOARD}, 0), ({"observe": onboard}, 1)],
    ids=["named by the specs of its observations", "declared", "seen in the first trial"],
)
def test_a_score_that_the_robot_cannot_have_is_refused_at_the_first_sign_with_others_named(
    options: dict[str, object], trials: int, tmp_path: Path
):
    resets, physical = robots(**options)
    with pytest.raises(InputError, match=r"base_position.*upright.*--score steps or tracking"):
        selfmodel.recover(*physical, "quadruped", tmp_path / "run", settings=SMALL, kinds="paper")
    assert [each.called for each in resets] == [trials > 0, False]
    assert len(list(tmp_path.rglob("*.mcap"))) == trials


@pytest.mark.search
def test_a_robot_without_odometry_recovers_by_its_steps(tmp_path: Path):
    _, physical = robots(observe=onboard, signals=ONBOARD)
    found = selfmodel.recover(
        *physical, "quadruped", tmp_path / "run", settings=SMALL, kinds="paper", score=STEPS
    )
    assert np.isfinite(found.scores).all()
    assert observed_in(found.trials[-1]) == {*ONBOARD, "commands"}


def test_what_is_not_declared_is_taken_to_be_observed_and_limits_need_no_measurement(
    quadruped: Robot,
):
    simulated, (blind, _) = selfmodel.simulated_robot(quadruped), robots()[1]
    assert observed_of(simulated) == set(SIGNALS)
    assert observed_of(simulated, blind) == {*ONBOARD, "base_linear_velocity", "commands"}
    for score in (UPRIGHT, upright_within(5, 5, 0.01)):
        check_measurable(score, quadruped, {"base_position"})


def test_without_touch_sensors_or_joints_no_score_is_named_that_needs_them():
    with pytest.raises(InputError, match=r"base of robot is fixed.*give --score tracking"):
        check_measurable(STEPS, arm())
    with pytest.raises(InputError, match=r"base_position.*give --score package.module:object"):
        check_measurable(UPRIGHT, selfmodel.load_robot("suite-cheetah-run"), {"base_orientation"})


@pytest.mark.parametrize("seed", range(3))
def test_a_foot_that_bounces_trembles_or_is_misread_takes_one_step(quadruped: Robot, seed: int):
    rng = np.random.default_rng(seed)
    names, steps = quadruped.anatomy.names, 400
    sensors = np.zeros((2, steps, len(names.sensors)))
    for column, period in enumerate((40, 80)):  # in the air, then on the ground
        sensors[:, :, column] = np.arange(steps) // (period // 2) % 2
    sensors[:, :, 2] = np.arange(steps) % 4 < 2  # trembles
    misread = rng.random((2, steps, 2)) < 0.05
    sensors[..., :2] = np.abs(sensors[..., :2] - misread)
    sensors[rng.random(sensors.shape) < 0.05] = np.nan
    turn = np.tile([1.0, 0, 0, 0], (2, steps, 1))
    turn[1, 200:] = [0, 1, 0, 0]  # the second run falls on its back
    position = np.full((2, steps, 3), np.nan)
    signals = {"sensors": sensors, "base_orientation": turn, "base_position": position}
    trajectory = Trajectory(names, np.arange(steps) * 0.01, signals)
    np.testing.assert_array_equal(STEPS.of(quadruped, INTACT, trajectory), [15, 7])


def test_steps_are_unknown_where_no_touch_sensor_was_observed(quadruped: Robot):
    touch = [one.kind == "touch" for one in quadruped.anatomy.sensors]
    sensors = np.where(touch, np.nan, 0.1) * np.ones((50, 1))
    signals = {"sensors": sensors} | {
        signal: np.zeros((50, quadruped.anatomy.names.width(signal))) for signal in UPRIGHT.record
    }
    trajectory = Trajectory(quadruped.anatomy.names, 0.01 * np.arange(50), signals)

    assert np.isnan(STEPS.of(quadruped, INTACT, trajectory)).all()
