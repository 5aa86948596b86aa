"""Promises of logged torques: unit and scale are learned, and what is no torque is left out."""

import dataclasses

import numpy as np
import pytest

from selfmodel.comparators import SEGMENT_PREDICTION, SENSOR_SERIES
from selfmodel.comparators.efforts import effort_loss, learned_scales, mean_efforts
from selfmodel.diagnosis.choice import ChosenComparator
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.diagnosis.losses import LossTable, learned
from selfmodel.faults.notation import parse
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.drivers import random_controllers
from tests.helpers.memory import in_memory

KNEE = "front_left_knee"
WEAK = f"motor:{KNEE}=0.5"


def trial_of(robot: Robot, hidden: str) -> Trial:
    plan = TrialPlan("own", "after", random_controllers(robot, 1)[0], 120, 0)
    return in_memory(robot)(SimulatedRobot(robot, parse(hidden, robot.anatomy)), plan)


def with_efforts(trial: Trial, efforts: np.ndarray) -> Trial:
    trajectory = trial.trajectory.with_signals({"joint_efforts": efforts})
    return dataclasses.replace(trial, trajectory=trajectory)


@pytest.fixture(scope="module")
def healthy(quadruped: Robot) -> Trial:
    return trial_of(quadruped, "intact")


@pytest.fixture(scope="module")
def weak(quadruped: Robot) -> Trial:
    return trial_of(quadruped, WEAK)


def chosen(robot: Robot, healthy: Trial, comparator: Comparator = SEGMENT_PREDICTION):
    return learned(ChosenComparator(comparator, "given"), Simulator(robot, 1), [healthy])


@pytest.mark.parametrize("unit", [1.0, 0.3, -2.0])
def test_a_weak_motor_shows_in_its_torque_in_any_unit(
    unit: float, quadruped: Robot, healthy: Trial, weak: Trial
):
    logs = [with_efforts(one, unit * one.trajectory["joint_efforts"]) for one in (healthy, weak)]
    found = chosen(quadruped, logs[0])
    table = LossTable(Simulator(quadruped, 1), found.comparator)

    assert found.reason == "given"
    of_intact, of_weak = (
        table.by_signal(parse(text, quadruped.anatomy), logs[1:])["joint_efforts"].mean()
        for text in ("intact", WEAK)
    )
    assert of_weak == pytest.approx(0, abs=1e-6)
    assert of_intact > 0.1
    assert table.by_signal(parse("intact", quadruped.anatomy), logs[:1])[
        "joint_efforts"
    ].mean() == pytest.approx(0, abs=1e-6)


def test_an_effort_that_is_no_torque_is_left_out_with_a_reason(
    quadruped: Robot, healthy: Trial, weak: Trial
):
    column = quadruped.anatomy.hinges.index(KNEE)
    efforts = healthy.trajectory["joint_efforts"].copy()
    efforts[:, column] = np.random.default_rng(0).normal(size=len(efforts))
    found = chosen(quadruped, with_efforts(healthy, efforts))

    assert KNEE in found.reason
    table = LossTable(Simulator(quadruped, 1), found.comparator)
    wrong = weak.trajectory["joint_efforts"].copy()
    wrong[:, column] = 1e3
    terms = [
        table.by_signal(parse(WEAK, quadruped.anatomy), [one])["joint_efforts"]
        for one in (weak, with_efforts(weak, wrong))
    ]
    np.testing.assert_array_equal(*terms)


def test_parts_of_the_loss_have_a_number_for_each_segment_if_only_some_trials_have_efforts(
    quadruped: Robot, healthy: Trial, weak: Trial
):
    silent = with_efforts(weak, np.full_like(weak.trajectory["joint_efforts"], np.nan))
    table = LossTable(Simulator(quadruped, 1), chosen(quadruped, healthy).comparator)
    parts = table.by_signal(parse("intact", quadruped.anatomy), [silent, weak])
    without, with_them = np.split(parts["joint_efforts"], 2)

    assert len({len(part) for part in parts.values()}) == 1
    assert not without.any()
    assert with_them.any()


def test_without_logged_efforts_nothing_is_learned(quadruped: Robot, healthy: Trial):
    silent = with_efforts(healthy, np.full_like(healthy.trajectory["joint_efforts"], np.nan))

    assert chosen(quadruped, silent).comparator is SEGMENT_PREDICTION
    assert chosen(quadruped, healthy, SENSOR_SERIES).comparator is SENSOR_SERIES


def test_efforts_are_means_since_the_compared_step_before():
    efforts = np.arange(5.0)[:, np.newaxis] ** 2  # 0, 1, 4, 9, 16

    np.testing.assert_array_equal(mean_efforts(efforts, np.array([1, 4])), [[1.0], [29 / 3]])


def test_the_torque_of_a_detached_limb_is_no_evidence():
    torques = np.random.default_rng(0).normal(size=(20, 2))
    scales = learned_scales(torques, torques)
    logged = torques.reshape(5, 4, 2)
    predicted = np.stack([logged, logged])
    predicted[..., 1] += 3.0

    lost, found = effort_loss(predicted, logged, scales, np.array([[False, True], [False, False]]))
    np.testing.assert_array_equal(lost, 0.0)
    assert (found > 0.1).all()
