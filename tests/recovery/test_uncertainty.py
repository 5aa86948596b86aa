"""Promises of the uncertainty of a self-model: what healthy trials tell, how trials weigh it."""

import dataclasses
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import selfmodel
from selfmodel.controllers.playback import Playback
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.recovery.uncertainty import (
    BODIES,
    CONTACTS,
    GROUND,
    MIN_EFFECTIVE,
    MODELS,
    Posterior,
    assumed_uncertainty,
    estimated_uncertainty,
    flattened_weights,
    log_likelihood,
)
from selfmodel.robot.anatomy import UNKNOWN_GROUND
from selfmodel.robot.robot import Robot, mjcf_of
from selfmodel.settings import Settings
from selfmodel.simulation.calibration import Calibration, calibrate
from selfmodel.simulation.model_factors import Weighted, nominal, with_parameters
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial
from tests.helpers.calibration import late
from tests.helpers.drivers import random_controllers
from tests.helpers.hostile import lacking

pytestmark = [pytest.mark.search, pytest.mark.usefixtures("coarse_calibration")]


def trials(robot: Robot, gap: float, folder: Path, count: int = 1, steps: int = 200) -> list[Trial]:
    physical = selfmodel.simulated_robot(robot, gap=gap, seed=1)
    return [
        selfmodel.run_trial(
            physical, walk, folder / f"{number}.mcap", robot=robot, steps=steps, stage="before"
        )
        for number, walk in enumerate(random_controllers(robot, count, seed=3))
    ]


def test_the_noise_is_that_of_the_physical_robot_and_less_than_assumed_is_known(
    quadruped: Robot, tmp_path: Path
):
    level = 0.1
    (trial,) = trials(quadruped, level, tmp_path, steps=600)
    calibration = calibrate(quadruped, [trial], 1)
    found = estimated_uncertainty(Simulator(calibration.robot, 1), [trial], calibration)
    assumed = assumed_uncertainty(quadruped)
    touch = np.array([sensor.kind == "touch" for sensor in quadruped.anatomy.sensors])

    np.testing.assert_allclose(found.reading_noise[~touch], level, rtol=0.25)
    assert found.wrong_touches[touch].mean() == pytest.approx(level / 2, rel=0.5)
    assert not found.reading_noise[touch].any()
    assert not found.wrong_touches[~touch].any()
    assert 0.2 * level / 2 < found.start.angles < 0.2 * level * 2.2
    np.testing.assert_allclose(found.models.factors, 0.65 * calibration.deviations)
    assert found.models.bodies.max() == BODIES
    assert found.models.contacts == 0.0
    assert (assumed.reading_noise[~touch] > 0).all()
    assert (assumed.wrong_touches[touch] > 0).all()
    assert len(assumed.delays) > 1
    assert assumed.models.draw(np.random.default_rng(0)).differs
    # A later calibration of a model with fitted contacts does not make them certain.
    other = with_parameters(quadruped, replace(nominal(quadruped), contact_damping=0.5))
    for robot in (other, late(other, 1)):
        found = estimated_uncertainty(Simulator(robot, 1), [trial], calibration)
        assert found.models.contacts == CONTACTS


def test_a_base_that_was_not_observed_tilts_by_half_of_the_joints_deviation(
    quadruped: Robot, tmp_path: Path
):
    (trial,) = trials(quadruped, 0.1, tmp_path, steps=300)
    blind = lacking(trial, ("base_position", "base_orientation"))
    found = estimated_uncertainty(Simulator(quadruped, 1), [blind], None)

    assert found.start.tilt == found.start.angles / 2 > 0
    # Without a calibration, the parameters are as uncertain as before.
    assert found.models.draw(np.random.default_rng(0)).differs
    assert found.delays == assumed_uncertainty(quadruped).delays


def test_a_ground_that_no_file_has_is_unknown_until_a_calibration(
    quadruped: Robot,
):
    spec = quadruped.specification()
    spec.add_numeric(name=UNKNOWN_GROUND, data=[1.0])
    imported = replace(quadruped, mjcf=mjcf_of(spec))
    fitted = with_parameters(imported, nominal(imported))
    usual, wider, narrowed = (
        assumed_uncertainty(robot).models for robot in (quadruped, imported, fitted)
    )

    assert wider.factors[2] == GROUND > usual.factors[2]
    assert wider.contacts == CONTACTS > usual.contacts
    np.testing.assert_array_equal(np.delete(wider.factors, 2), np.delete(usual.factors, 2))
    np.testing.assert_array_equal(narrowed.factors, usual.factors)
    assert narrowed.contacts == usual.contacts == 0.0


@pytest.fixture(scope="module")
def healthy(quadruped: Robot, tmp_path_factory: pytest.TempPathFactory) -> list[Trial]:
    """Two trials of a healthy robot across a gap."""
    return trials(quadruped, 0.1, tmp_path_factory.mktemp("healthy"), count=2)


@pytest.fixture(scope="module")
def calibration(quadruped: Robot, healthy: list[Trial]) -> Calibration:
    """Fit of the self-model to the first trial."""
    return calibrate(quadruped, healthy[:1], 1)


def posterior(
    calibration: Calibration, healthy: list[Trial], seed: int = 0, generations: int = 2
) -> Posterior:
    """The posterior of a small sample: 12 models, or 33 of 7 generations."""
    settings = Settings(generations=generations).scaled(100)
    simulator = Simulator(calibration.robot, 1)
    return Posterior(simulator, healthy, calibration, settings, np.random.default_rng(seed))


def test_models_that_predict_the_path_weigh_more():
    repeats = np.random.default_rng(0).normal(0, 0.1, (16, 3))
    paths = np.array([[1.0, 0, 0], [0.5, 0, 0], [-1.0, 0, 0], [np.nan] * 3])
    found = log_likelihood(np.array([1.0, 0, 0]), paths, repeats, np.zeros(3))

    assert found[0] > found[1] > found[2] >= found[3]
    assert np.isfinite(found).all()
    vague = log_likelihood(np.array([1.0, 0, 0]), paths, repeats, np.full(3, 9.0))
    assert np.ptp(vague[:3]) < np.ptp(found[:3]) / 100


@pytest.mark.parametrize("spread", [0.0, 1e6])
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
    before = own.simulator.stats.runs
    found = own.after(exact, INTACT)

    assert not found.reading_noise.any()
    assert not found.wrong_touches.any()
    assert (found.start.angles, found.start.tilt) == (0.0, 0.0)
    assert not found.models.draw(np.random.default_rng(0)).differs
    assert own.simulator.stats.runs == before + 1  # the noise-free trial of the estimate


def test_a_base_that_was_missed_for_some_steps_is_interpolated(
    healthy: list[Trial], calibration: Calibration
):
    walked = healthy[0]
    gappy = lacking(walked, ("base_position", "base_orientation"), slice(50, 55))
    never = lacking(walked, ("base_position", "base_orientation"))
    own = posterior(calibration, [walked], generations=7)
    whole = own.after([walked], INTACT).models.weights
    some = own.after([dataclasses.replace(gappy, path="gappy")], INTACT).models.weights
    none = own.after([dataclasses.replace(never, path="never")], INTACT).models.weights

    assert np.ptp(whole) > 0.05
    np.testing.assert_allclose(some, whole, atol=0.02)
    np.testing.assert_allclose(none, 1 / len(none))


def test_the_healthy_trial_is_simulated_without_the_fault(
    quadruped: Robot, healthy: list[Trial], calibration: Calibration
):
    walked = healthy[0]
    # A recording of other software is a trial, too.
    played = Playback(walked.trajectory.names.motors, walked.trajectory["commands"])
    plan = dataclasses.replace(walked.plan, stage="after", controller=played)
    after = dataclasses.replace(walked, plan=plan, path="after")
    own, fault = posterior(calibration, [walked]), parse("break:front_left_knee", quadruped.anatomy)
    weights, damaged = (own.after([one], fault).models.weights for one in (walked, after))

    np.testing.assert_array_equal(weights, own.after([walked], INTACT).models.weights)
    assert not np.array_equal(weights, damaged)


def test_what_a_robot_does_after_a_fall_is_no_evidence_on_its_model(
    healthy: list[Trial], calibration: Calibration
):
    def fallen(slide: float, fall: int) -> Trial:
        position = walked.trajectory["base_position"].copy()
        position[fall:] = [slide, -slide, 0.0]
        signals = {**walked.trajectory.signals, "base_position": position}
        trajectory = dataclasses.replace(walked.trajectory, signals=signals)
        return dataclasses.replace(walked, trajectory=trajectory, path=f"{slide}, {fall}")

    walked = healthy[0]
    own = posterior(calibration, [walked])
    before = own.simulator.stats.steps
    near, far, later, lying = (
        own.after([fallen(*one)], INTACT).models.weights
        for one in ((0.0, 100), (3.0, 100), (3.0, 150), (0.0, 0))
    )

    np.testing.assert_array_equal(near, far)
    assert not np.array_equal(near, later)
    np.testing.assert_allclose(lying, 1 / len(lying))
    assert own.simulator.stats.steps - before < 3 * 200 * (12 + 16 + 1)
