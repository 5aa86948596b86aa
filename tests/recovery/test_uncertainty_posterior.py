"""Promises of the posterior of a self-model: models that predict the trials weigh more."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import selfmodel
from selfmodel.controllers.playback import Playback
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.recovery.uncertainty import (
    MIN_EFFECTIVE,
    MODELS,
    Posterior,
    _path,
    _track,
    flattened_weights,
    log_likelihood,
)
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.calibration import Calibration, calibrate
from selfmodel.simulation.model_distribution import Weighted
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial
from tests.helpers.drivers import random_controllers
from tests.helpers.hostile import lacking


def trials(robot: Robot, gap: float, folder: Path, count: int = 1) -> list[Trial]:
    physical = selfmodel.simulated_robot(robot, gap=gap, seed=1)
    return [
        selfmodel.run_trial(
            physical, walk, folder / f"{number}.mcap", robot=robot, steps=200, stage="before"
        )
        for number, walk in enumerate(random_controllers(robot, count, seed=3))
    ]


@pytest.fixture(scope="module")
def healthy(quadruped: Robot, tmp_path_factory: pytest.TempPathFactory) -> list[Trial]:
    """Two trials of a healthy robot across a gap."""
    return trials(quadruped, 0.1, tmp_path_factory.mktemp("healthy"), count=2)


@pytest.fixture(scope="module")
def calibration(quadruped: Robot, healthy: list[Trial]) -> Calibration:
    """Fit of the self-model to the first trial."""
    return calibrate(quadruped, healthy[:1], 1)


def posterior(calibration: Calibration, healthy: list[Trial], seed: int = 0) -> Posterior:
    """The posterior of a small sample: 33 models."""
    settings = Settings(generations=7).scaled(100)
    simulator = Simulator(calibration.robot, 1)
    return Posterior(simulator, healthy, calibration, settings, np.random.default_rng(seed))


def test_models_that_predict_the_path_weigh_more():
    repeats = np.random.default_rng(0).normal(0, 0.1, (16, 3))
    paths = np.array([[1.0, 0, 0], [1.5, 0, 0], [3.0, 0, 0], [np.nan] * 3])
    found = log_likelihood(np.array([1.0, 0, 0]), paths, repeats, np.zeros(3))

    assert found[0] > found[1] > found[2] >= found[3]
    assert np.isfinite(found).all()
    vague = log_likelihood(np.array([1.0, 0, 0]), paths, repeats, np.full(3, 9.0))
    assert np.ptp(vague[:3]) < np.ptp(found[:3]) / 100


@pytest.mark.parametrize("spread", [0.0, 1.0, 1e6])
def test_the_effective_size_of_the_sample_is_bounded_below(spread: float):
    likelihood = -spread * np.random.default_rng(0).random(MODELS)
    weights = flattened_weights(likelihood)

    assert weights.sum() == pytest.approx(1)
    assert 1 / np.square(weights).sum() >= MIN_EFFECTIVE * MODELS - 1e-9
    order = np.argsort(-likelihood)
    assert np.all(np.diff(weights[order]) <= 1e-12)
    if spread == 0:
        np.testing.assert_allclose(weights, 1 / MODELS)


def test_a_trial_changes_the_weights_once_and_other_random_numbers_the_sample(
    healthy: list[Trial], calibration: Calibration
):
    own = posterior(calibration, healthy[:1])
    first, again = (own.after(healthy[:1], INTACT) for _ in range(2))
    both = own.after(healthy, INTACT)

    assert isinstance(first.models, Weighted)
    np.testing.assert_array_equal(first.models.weights, again.models.weights)
    assert np.ptp(first.models.weights) > 0
    assert not np.array_equal(first.models.weights, both.models.weights)
    other = posterior(calibration, healthy[:1], seed=1).after([], INTACT)
    assert not np.array_equal(other.models.models[0].factors, first.models.models[0].factors)


def test_a_model_that_is_exact_stays_so_without_a_simulation(quadruped: Robot, tmp_path: Path):
    exact = trials(quadruped, 0.0, tmp_path)
    own = posterior(calibrate(quadruped, exact, 1), exact)
    before = own._simulator.stats.runs
    found = own.after(exact, INTACT)

    assert not found.models.draw(np.random.default_rng(0)).differs
    assert own._simulator.stats.runs == before + 1  # the noise-free trial of the estimate


def test_a_recording_of_other_software_is_a_trial_too(
    healthy: list[Trial], calibration: Calibration
):
    walked = healthy[0]
    played = Playback(walked.behaviour.names.motors, walked.behaviour["commands"])
    plan = walked.plan.__class__("played", "before", played, walked.plan.steps, 0)
    recording = Trial(plan, walked.robot, walked.behaviour, "played.mcap")
    found = posterior(calibration, [recording]).after([recording], INTACT)

    assert isinstance(found.models, Weighted)


def test_a_base_that_was_missed_for_some_steps_is_interpolated(
    healthy: list[Trial], calibration: Calibration
):
    walked = healthy[0]
    gappy = lacking(walked, ("base_position", "base_orientation"), slice(50, 55))
    never = lacking(walked, ("base_position", "base_orientation"))
    own = posterior(calibration, [walked])
    whole = own.after([walked], INTACT).models.weights
    some = own.after([dataclasses.replace(gappy, path="gappy")], INTACT).models.weights
    none = own.after([dataclasses.replace(never, path="never")], INTACT).models.weights

    assert np.ptp(whole) > 0.05
    np.testing.assert_allclose(some, whole, atol=0.02)
    np.testing.assert_allclose(none, 1 / len(none))


def test_a_path_has_forward_and_sideways_position_and_heading_at_the_marks():
    turn = np.linspace(0, 4, 101)  # more than half a turn
    position = np.column_stack([np.sin(turn), 1 - np.cos(turn), np.full(101, 0.3)])
    orientation = np.column_stack([np.cos(turn / 2), 0 * turn, 0 * turn, np.sin(turn / 2)])
    marks = slice(20, 101, 20)
    expected = [position[marks, 0], position[marks, 1], turn[marks]]
    np.testing.assert_allclose(_path(_track(position, orientation)), np.concatenate(expected))


def test_the_healthy_trial_is_simulated_without_the_fault(
    quadruped: Robot, healthy: list[Trial], calibration: Calibration
):
    walked = healthy[0]
    plan = dataclasses.replace(walked.plan, stage="after")
    after = dataclasses.replace(walked, plan=plan, path="after")
    own, fault = posterior(calibration, [walked]), parse("break:front_left_knee", quadruped.anatomy)
    weights, damaged = (own.after([one], fault).models.weights for one in (walked, after))

    np.testing.assert_array_equal(weights, own.after([walked], INTACT).models.weights)
    assert not np.array_equal(weights, damaged)
