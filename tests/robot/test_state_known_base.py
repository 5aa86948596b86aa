"""Tests of the base of a fixed robot in a log that does not have it."""

import numpy as np

from selfmodel.comparators.segment_prediction import SEGMENT_PREDICTION
from selfmodel.diagnosis.losses import LossTable
from selfmodel.faults.hypothesis import INTACT
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import BASE_SIGNALS, with_known_base
from selfmodel.simulation.calibration import calibrate
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import ROBOTS
from selfmodel.trials.behaviour import Behaviour, collect
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.drivers import random_cpgs
from tests.helpers.robots.arms import arm


def trial_of(robot: Robot, steps: int = 200) -> Trial:
    (driver,) = random_cpgs(robot, 1)
    behaviour = collect(robot.anatomy.names, SimulatedRobot(robot).run(driver, steps))
    plan = TrialPlan("one", "before", driver, steps, seed=0)
    return Trial(plan, robot.name, behaviour, "one.mcap")


def without_base(trial: Trial) -> Trial:
    behaviour = trial.behaviour
    unknown = {signal: np.full_like(behaviour[signal], np.nan) for signal in BASE_SIGNALS}
    signals = {**behaviour.signals, **unknown}
    blind = Behaviour(behaviour.names, behaviour.time, signals)
    return Trial(trial.plan, trial.robot, blind, "blind.mcap")


def test_the_unobserved_base_of_an_arm_is_that_of_its_model():
    trial = trial_of(arm())
    found = with_known_base(arm(), without_base(trial).behaviour)
    for signal in BASE_SIGNALS:
        assert np.array_equal(found[signal], trial.behaviour[signal]), signal


def test_an_observed_base_and_a_floating_base_are_unchanged():
    behaviour = trial_of(arm()).behaviour
    moved = {**behaviour.signals, "base_position": behaviour["base_position"] + 0.01}
    seen = Behaviour(behaviour.names, behaviour.time, moved)
    assert np.array_equal(with_known_base(arm(), seen)["base_position"], seen["base_position"])
    floating = without_base(trial_of(ROBOTS["quadruped"].robot(), 20)).behaviour
    assert with_known_base(ROBOTS["quadruped"].robot(), floating) is floating


def test_a_log_of_an_arm_without_its_base_is_predicted_and_calibrated_exactly():
    trial = without_base(trial_of(arm()))
    evidence = LossTable(Simulator(arm(), 1), SEGMENT_PREDICTION)
    assert evidence.distances([INTACT], [trial])[0] == 0
    assert calibrate(arm(), [trial], threads=1).error_before == 0
