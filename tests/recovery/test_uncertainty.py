"""Promises of the uncertainty of a self-model: what healthy trials tell about noise."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import selfmodel
from selfmodel.recovery.uncertainty import (
    BODIES,
    CONTACTS,
    assumed_uncertainty,
    estimated_uncertainty,
    noise_of_gap,
)
from selfmodel.robot.parameters import nominal, with_parameters
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration import Calibration, calibrate
from selfmodel.simulation.model_distribution import LogNormal
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial
from tests.helpers.drivers import random_controllers


def healthy_trial(robot: Robot, gap: float, folder: Path, steps: int = 600) -> Trial:
    physical = selfmodel.simulated_robot(robot, gap=gap, seed=1)
    (walk,) = random_controllers(robot, 1, seed=3)
    return selfmodel.run_trial(
        physical, walk, folder / "walk.mcap", robot=robot, steps=steps, stage="before"
    )


def fitted(robot: Robot, trial: Trial) -> tuple[Simulator, Calibration]:
    calibration = calibrate(robot, [trial], 1)
    return Simulator(calibration.robot, 1), calibration


@pytest.mark.parametrize("level", [0.05, 0.1])
def test_the_noise_of_the_readings_is_that_of_the_physical_robot(
    quadruped: Robot, level: float, tmp_path: Path
):
    trial = healthy_trial(quadruped, level, tmp_path)
    simulator, calibration = fitted(quadruped, trial)
    found = estimated_uncertainty(simulator, [trial], calibration)
    touch = np.array([sensor.kind == "touch" for sensor in quadruped.anatomy.sensors])

    np.testing.assert_allclose(found.reading_noise[~touch], level, rtol=0.25)
    assert found.wrong_touches[touch].mean() == pytest.approx(level / 2, rel=0.5)
    assert not found.reading_noise[touch].any()
    assert not found.wrong_touches[~touch].any()
    assert 0.2 * level / 2 < found.start.angles < 0.2 * level * 2.2
    np.testing.assert_allclose(found.models.factors, 0.65 * calibration.deviations)
    assert found.models.bodies.max() == BODIES


def test_contacts_are_uncertain_where_the_calibration_changed_them(
    quadruped: Robot, tmp_path: Path
):
    """A later calibration of a model with fitted contacts does not make them certain."""
    trial = healthy_trial(quadruped, 0.05, tmp_path)
    _, calibration = fitted(quadruped, trial)
    other = with_parameters(quadruped, replace(nominal(quadruped), contact_damping=0.5))
    later = with_parameters(other, replace(nominal(other), delay=1))

    assert calibration.contacts == ()
    for robot, expected in ((calibration.robot, 0.0), (other, CONTACTS), (later, CONTACTS)):
        found = estimated_uncertainty(Simulator(robot, 1), [trial], calibration)
        assert isinstance(found.models, LogNormal)
        assert found.models.contacts == expected


def test_a_robot_that_equals_its_model_has_no_uncertainty(quadruped: Robot, tmp_path: Path):
    trial = healthy_trial(quadruped, 0.0, tmp_path)
    simulator, calibration = fitted(quadruped, trial)
    found = estimated_uncertainty(simulator, [trial], calibration)

    assert not found.reading_noise.any()
    assert not found.wrong_touches.any()
    assert (found.start.angles, found.start.tilt) == (0.0, 0.0)
    assert not found.models.draw(np.random.default_rng(0)).differs


def test_a_base_that_was_not_observed_tilts_by_half_of_the_joints_deviation(
    quadruped: Robot, tmp_path: Path
):
    trial = healthy_trial(quadruped, 0.1, tmp_path, steps=300)
    signals = {
        signal: np.full_like(values, np.nan) if signal.startswith("base") else values
        for signal, values in trial.behaviour.signals.items()
    }
    blind = replace(trial, behaviour=replace(trial.behaviour, signals=signals))
    found = estimated_uncertainty(Simulator(quadruped, 1), [blind], None)

    assert found.start.tilt == found.start.angles / 2 > 0
    # Without a calibration, the parameters are as uncertain as before.
    assert found.models.draw(np.random.default_rng(0)).differs
    assert found.delays == assumed_uncertainty(quadruped).delays


def test_before_the_first_trial_everything_is_uncertain(robot: Robot):
    found = assumed_uncertainty(robot)
    touch = np.array([sensor.kind == "touch" for sensor in robot.anatomy.sensors])

    assert (found.reading_noise[~touch] > 0).all()
    assert (found.wrong_touches[touch] > 0).all()
    assert len(found.delays) > 1
    assert found.models.draw(np.random.default_rng(0)).differs


def test_the_noise_of_a_gap_leaves_the_model_as_it_is(quadruped: Robot):
    found = noise_of_gap(quadruped, 0.1)
    touch = np.array([sensor.kind == "touch" for sensor in quadruped.anatomy.sensors])

    assert not found.models.draw(np.random.default_rng(0)).differs
    assert set(found.reading_noise[~touch]) == {0.1}
    assert set(found.wrong_touches[touch]) == {0.05}
    assert found.delays == (0,)
