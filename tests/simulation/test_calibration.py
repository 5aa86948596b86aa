"""Promises of calibration: it finds what a robot has, and leaves alone what is right."""

import dataclasses
from functools import cache
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

import selfmodel
from selfmodel.controllers.playback import played_back
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.logs.reader import read_log
from selfmodel.logs.robots import robot_of
from selfmodel.physical.simulated import SimulatedRobot, draw_gap
from selfmodel.progress import Progress
from selfmodel.robot.robot import Robot
from selfmodel.simulation import calibration, fit, segments
from selfmodel.simulation.calibration import (
    Calibration,
    Refit,
    calibrate,
    prediction_error,
)
from selfmodel.simulation.fit import (
    EXACT_ERROR,
    UNDETERMINED_SHARE,
    consistent_information,
    is_determined,
)
from selfmodel.simulation.model_factors import (
    FACTORS,
    MAX_LOG_FACTOR,
    SHARED,
    Parameters,
    factor_names,
    nominal,
    prior_deviations,
    with_parameters,
)
from selfmodel.tasks import ROBOTS
from selfmodel.trials.estimation import BASE
from selfmodel.trials.signals import Signal
from selfmodel.trials.trajectory import collect
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.calibration import late
from tests.helpers.drivers import moving_trial
from tests.helpers.hostile import lacking, unstable
from tests.helpers.robots.arms import robot_of as arm_of

search = pytest.mark.search

STEPS = 200
SMALL = selfmodel.Settings(steps=STEPS, generations=2).scaled(4)
LOGS_OF_0_1 = Path(__file__).parents[1] / "data" / "logs-0.1"
QUADRUPED = ROBOTS["quadruped"].robot()
TRUE = Parameters(1.25, 0.9, 0.8, 1.3, (1.2, 1.0, 0.85, 1.0, 1.0, 0.8, 1.0, 1.15), delay=2)


def prior_of(robot: Robot) -> np.ndarray:
    """Returns the deviations of the prior in the order of the factors."""
    prior = prior_deviations(robot)
    return np.concatenate([prior[name] for name in (*SHARED, "motor_gains")])


PRIOR = prior_of(QUADRUPED)


def trials(robot: Robot, count: int = 1, steps: int = STEPS) -> list[Trial]:
    """Trials of a physical robot that is as that model says."""
    return [moving_trial(robot, SimulatedRobot(robot), seed, steps) for seed in range(count)]


@cache
def real() -> Robot:
    return with_parameters(QUADRUPED, TRUE)


@cache
def fitted() -> Calibration:
    """The quadruped, calibrated from trials of one that has ``TRUE``."""
    return calibrate(QUADRUPED, trials(real()), threads=1)


@search
def test_delay_and_factors_go_from_nominal_towards_the_truth():
    found, true = np.log(fitted().parameters.factors), np.log(TRUE.factors)
    motors = slice(factor_names(QUADRUPED).index("damping") + 1, None)

    assert fitted().parameters.delay == fitted().robot.control_delay == TRUE.delay
    assert found @ true / (np.linalg.norm(found) * np.linalg.norm(true)) > 0.5
    assert np.linalg.norm(found - true) < 0.9 * np.linalg.norm(true)
    assert (fitted().deviations[motors] < PRIOR[motors]).all()
    assert (fitted().deviations > 0.2 * PRIOR).all()
    assert fitted().chosen == FACTORS
    assert 0 < fitted().held_out_gain < 1
    assert fitted().to_dict()["determined"] == [row["determined"] for row in fitted().rows()]


@search
def test_the_faults_of_the_robot_in_a_trial_are_no_parameters_of_its_model():
    jam = parse("jam:back_left_knee", QUADRUPED.anatomy)
    damaged = moving_trial(real(), SimulatedRobot(real(), jam), 0)
    refit, unseen = Refit(QUADRUPED, fitted(), 1), moving_trial(real(), SimulatedRobot(real()), 7)
    knowing, unknowing = (refit([damaged], [fault]) for fault in (jam, INTACT))

    for healthy in (trials(real()), [unseen]):
        errors = [prediction_error(robot, healthy, 1) for robot in (knowing, unknowing)]
        assert errors[0] < 0.98 * errors[1]


@search
def test_a_refit_follows_further_trials_from_the_fit_with_its_delay():
    worn = with_parameters(QUADRUPED, dataclasses.replace(TRUE, friction=1.2))
    further = moving_trial(worn, SimulatedRobot(worn), 3)
    refit = Refit(QUADRUPED, fitted(), 1, (shown := list[Progress]()).append)([further], [INTACT])
    before, after = (prediction_error(robot, [further], 1) for robot in (fitted().robot, refit))

    assert after < 0.5 * before
    assert refit.control_delay == fitted().parameters.delay
    assert shown[0].done < shown[0].total / 2 < shown[-2].done <= shown[-1].done == shown[-1].total


@search
def test_friction_and_contacts_are_found_together():
    slippery = dataclasses.replace(TRUE, friction=0.4, contact_stiffness=2.0)
    found = calibrate(QUADRUPED, trials(with_parameters(QUADRUPED, slippery)), 1).parameters

    assert found.contact_stiffness == 2.0
    assert 0.4 < found.friction < 0.55


def test_no_friction_is_beyond_the_bounds():
    falling = Mock(of=lambda models: np.array([[one.friction for one in models]]))
    near, _ = fit._with_near_contacts(falling, nominal(QUADRUPED), np.ones(1))
    assert near.friction == pytest.approx(np.exp(-MAX_LOG_FACTOR), rel=0.1)


@search
def test_a_diagnosis_refits_the_robot_as_it_was_before_the_calibration(
    monkeypatch: pytest.MonkeyPatch,
):
    made = list[tuple[object, ...]]()
    monkeypatch.setattr(calibration, "Refit", lambda *given: made.append(given))
    healthy, damaged = trials(real(), 2)
    selfmodel.diagnose(damaged, healthy=healthy, robot=QUADRUPED, settings=SMALL, threads=1)
    ((robot, fit, *_),) = made
    assert robot is QUADRUPED
    assert fit.robot.mjcf != QUADRUPED.mjcf


@search
def test_a_delay_of_a_part_of_a_control_step_is_found():
    found = calibrate(QUADRUPED, trials(late(QUADRUPED, 1.5)), threads=1)

    assert found.parameters.delay == 1.5


@search
def test_the_errors_are_those_of_the_models_and_lower_in_a_trial_that_was_not_seen():
    seen, unseen = trials(real()), [moving_trial(real(), SimulatedRobot(real()), 7)]

    assert fitted().error_before == pytest.approx(prediction_error(QUADRUPED, seen, 1))
    assert fitted().error == pytest.approx(prediction_error(fitted().robot, seen, 1), rel=0.02)
    before, after = (prediction_error(r, unseen, 1) for r in (QUADRUPED, fitted().robot))
    assert after < 0.7 * before
    assert prediction_error(real(), unseen, 1) < 1e-4


@search
def test_with_a_weak_prior_the_factors_of_a_robot_without_noise_are_found(
    monkeypatch: pytest.MonkeyPatch,
):
    """As calibration is set, the prior keeps factors near nominal, for the sake of noisy logs."""
    weak = dataclasses.replace(fit.FLOATING, prior_weight=0.005, iterations=20)
    monkeypatch.setattr(fit, "FLOATING", weak)
    monkeypatch.setattr(fit, "CANDIDATE_STIFFNESSES", (1.0,))
    found = calibrate(QUADRUPED, trials(real(), 1, 400), threads=1)
    off = np.abs(np.log(found.parameters.factors) - np.log(TRUE.factors))

    assert off.max() < 0.05, dict(zip(factor_names(QUADRUPED), off, strict=True))


@search
@pytest.mark.parametrize(
    ("name", "lost"), [("quadruped", BASE), ("hexapod", ())], ids=["unseen", "seen"]
)
def test_a_model_that_is_exact_is_left_as_it_is_to_the_bit(name: str, lost: tuple[Signal, ...]):
    robot = ROBOTS[name].robot()
    found = calibrate(robot, [lacking(one, lost) for one in trials(robot, 1)], threads=1)

    assert found.robot is robot
    assert found.parameters == nominal(robot)
    assert found.deviations.tolist() == prior_of(robot).tolist()


@search
def test_long_trials_without_the_base_share_the_time_that_is_simulated_of_one(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(calibration, "MAX_CHAIN", 1.0)
    monkeypatch.setattr(calibration, "MAX_FOLLOWING", 2.0)
    cut = Mock(wraps=calibration.observed_segments)
    monkeypatch.setattr(calibration, "observed_segments", cut)
    long = [lacking(one, BASE) for one in trials(real(), 2)]
    prediction_error(QUADRUPED, long, 1)
    segments_of = [segments.observed_segments(*call.args).segments for call in cut.call_args_list]

    assert [one.horizon * len(one.starts) for one in segments_of] == [STEPS // 2, STEPS // 2]


@search
def test_what_a_refit_predicted_of_a_trial_is_not_simulated_again_by_the_next(
    monkeypatch: pytest.MonkeyPatch,
):
    given, weak = trials(real(), 2), parse("motor:back_left_knee=0.9", QUADRUPED.anatomy)
    predicted = Mock(wraps=segments.predict)
    monkeypatch.setattr(segments, "predict", predicted)

    def simulated(refit: Refit, faults: list[Hypothesis]) -> tuple[int, str]:
        predicted.reset_mock()
        found = refit(given, faults).mjcf
        return sum(len(call.args[1]) for call in predicted.call_args_list), found

    first, refit = (Refit(QUADRUPED, fitted(), 1) for _ in range(2))
    most, found = simulated(first, [INTACT, INTACT])
    _, other = simulated(refit, [INTACT, weak])

    assert simulated(refit, [INTACT, weak]) == (0, other)
    fewer, again = simulated(refit, [INTACT, INTACT])
    assert again == found != other
    assert 2 * len(PRIOR) < fewer < 0.9 * most


@search
def test_threads_of_the_physics_and_of_the_linear_algebra_do_not_matter():
    healthy = noisy(QUADRUPED, real(), 1, steps=100)

    def calibrated(threads: int) -> Calibration:
        with threadpool_limits(threads, "blas"):
            return calibrate(QUADRUPED, [healthy], threads)

    one, other = calibrated(1), calibrated(3)

    assert one.chosen == FACTORS
    assert other.robot.mjcf == one.robot.mjcf
    assert other.to_dict() == one.to_dict()
    assert np.abs(np.log(one.parameters.factors)).max() <= MAX_LOG_FACTOR
    assert ((one.deviations > 0) & (one.deviations <= PRIOR)).all()


def noisy(robot: Robot, physical: Robot, seed: int, steps: int = STEPS) -> Trial:
    """A trial of a real robot with the noise and the delay of a gap, and no other difference."""
    gap = draw_gap(QUADRUPED, 0.05, np.random.default_rng(seed))
    return moving_trial(robot, SimulatedRobot(physical, gap=gap), seed, steps)


@search
def test_contacts_that_differ_are_found_under_noise():
    other = dataclasses.replace(nominal(QUADRUPED), contact_stiffness=2.0, contact_damping=0.25)
    healthy = noisy(QUADRUPED, with_parameters(QUADRUPED, other), 3, steps=700)
    found = calibrate(QUADRUPED, [healthy], threads=2)

    assert found.parameters.contact_stiffness in {1.0, 2.0, 4.0}
    assert found.parameters.contact_damping in {0.125, 0.25, 0.5}
    assert found.contacts
    assert found.contacts[0] in repr(found)
    np.testing.assert_allclose(
        found.robot.model.geom("torso").solref,
        [-5000 * found.parameters.contact_stiffness, -300 * found.parameters.contact_damping],
    )


@search
def test_what_the_trials_do_not_show_is_as_uncertain_as_before_them_however_many_they_are():
    """A robot that floats shows nothing of the ground's friction."""
    mjcf = QUADRUPED.mjcf.replace("<option ", '<option gravity="0 0 0" ', 1)
    adrift = dataclasses.replace(QUADRUPED, mjcf=mjcf.replace('pos="0 0 0.3245"', 'pos="0 0 3"'))
    gap = draw_gap(adrift, 0.02, np.random.default_rng(0))
    friction = factor_names(adrift).index("friction")
    several = [
        moving_trial(adrift, SimulatedRobot(adrift, gap=gap, stream=k), k, 24) for k in range(2)
    ]
    found = calibrate(adrift, several, threads=1)

    np.testing.assert_allclose(found.deviations[friction], PRIOR[friction], rtol=1e-3)


@search
def test_a_robot_that_nobody_sees_is_calibrated_from_what_it_has_on_board():
    seen = [moving_trial(real(), SimulatedRobot(real()), 7)]
    found = calibrate(QUADRUPED, [lacking(one, BASE) for one in trials(real())], threads=1)
    off, true = np.log(found.parameters.factors), np.log(TRUE.factors)

    assert found.parameters.delay == TRUE.delay
    assert off @ true / (np.linalg.norm(off) * np.linalg.norm(true)) > 0.5
    assert found.error < found.error_before
    before, after = (prediction_error(r, seen, 1) for r in (QUADRUPED, found.robot))
    assert after < 0.75 * before
    # It knows no more of the factors than one that is seen.
    assert np.median(found.deviations / fitted().deviations) > 0.7
    assert (found.deviations <= PRIOR).all()


def test_trials_in_which_the_base_was_seen_and_others_are_compared_together():
    one, other = trials(real(), 2, 100)
    given = [one, lacking(other, BASE)]
    apart = [prediction_error(QUADRUPED, [each], 1) for each in given]

    assert min(apart) < prediction_error(QUADRUPED, given, 1) < max(apart)


@search
def test_factors_that_predict_left_out_segments_no_better_stay_nominal_to_the_bit():
    """A trial in the model's own physics, with noise: there is nothing to fit."""
    rng = np.random.default_rng(0)
    (exact,) = trials(QUADRUPED, 1, 40)
    velocities = exact.trajectory["joint_velocities"]
    velocities = velocities + 0.3 * rng.standard_normal(velocities.shape)
    trajectory = exact.trajectory.with_signals({"joint_velocities": velocities})
    found = calibrate(QUADRUPED, [dataclasses.replace(exact, trajectory=trajectory)], threads=1)

    assert found.error_before > EXACT_ERROR
    assert found.robot is QUADRUPED
    assert (found.chosen, found.parameters) == ("nominal", nominal(QUADRUPED))
    assert not any(row["determined"] for row in found.rows())
    assert repr(found).count("not determined by these trials") == len(PRIOR)
    assert found.suspicion is None


def test_no_trials_and_trials_that_cannot_be_used_are_refused_by_what_they_lack():
    (whole,) = trials(QUADRUPED, 1, 100)
    numb = lacking(whole, (*BASE, "base_angular_velocity"))
    early = lacking(whole, ("base_orientation",), slice(50))
    never_both = lacking(early, ("joint_velocities",), slice(49, None))
    refused = {
        "at least one trial of the healthy robot, got none": [],
        r"0\.mcap: calibration needs segments of 16 steps or more, without late steps, with "
        r"joint_positions, .* and the log never has base_angular_velocity: leave": [whole, numb],
        "the log has no such segment: leave": [never_both],
    }
    for message, given in refused.items():
        with pytest.raises(InputError, match=message):
            calibrate(QUADRUPED, given, 1)


@pytest.mark.parametrize("lost", ["base_position", "joint_velocities"])
def test_moments_that_were_not_observed_are_passed_over(lost: Signal):
    (whole,) = trials(QUADRUPED, 1)

    assert prediction_error(QUADRUPED, [lacking(whole, (lost,), slice(100, 200))], 1) < 1e-4


@search
def test_a_calibration_that_no_simulation_survives_ends_with_a_sentence():
    storm = unstable(QUADRUPED)
    with pytest.raises(InputError, match="no simulation of the healthy robot remained finite"):
        calibrate(storm, trials(QUADRUPED, 1, 20), threads=1)


@search
def test_contacts_are_not_fitted_to_the_few_steps_of_a_short_log():
    """Its 40 segments of 10 steps share 60 steps, and seem to agree on other contacts."""
    log = read_log(LOGS_OF_0_1 / "calibrated" / "before.mcap")

    assert calibrate(robot_of(log), [log.trial], threads=1).contacts == ()


ARM = """
<mujoco model="arm">
  <compiler angle="radian"/>
  <option timestep="0.005" integrator="implicitfast"/>
  <default>
    <geom contype="0" conaffinity="0" type="capsule" size="0.03"/>
    <joint axis="0 1 0" range="-2 2" damping="0.3" armature="0.01" frictionloss="0.1"/>
    <position kp="20" kv="1" ctrlrange="-1.5 1.5" forcerange="-20 20"/>
  </default>
  <worldbody>
    <body name="base" pos="0 0 1">
      <geom type="box" size="0.05 0.05 0.05"/>
      <body name="upper"><joint name="shoulder"/><geom fromto="0 0 0 0.25 0 0"/>
        <body name="lower" pos="0.25 0 0"><joint name="elbow"/><geom fromto="0 0 0 0.2 0 0"/></body>
      </body>
    </body>
  </worldbody>
  <actuator><position name="a" joint="shoulder"/><position name="b" joint="elbow"/></actuator>
</mujoco>"""
JOINTS_TRUE = {
    "motor_gains": (0.85, 1.15),
    "joint_damping": (5 / 3, 2 / 3),
    "dry_friction": (3.0, 6.0),
    "armature": (3.0, 2.0),
}
"""Factors of the damping 0.3, dry friction 0.1 and armature 0.01 of both joints."""
ARM_DELAY, ARM_STEPS, ARM_NOISE = 1.5, 300, 1e-3


@cache
def arm() -> Robot:
    return arm_of(ARM, control_timestep=0.01)


def arm_trial(physical: Robot, noise: float, amplitude: float = 1.0) -> Trial:
    """A trial with joint positions and commands only."""
    rng, time = np.random.default_rng(1), np.arange(ARM_STEPS) * 0.01
    phase = 2 * np.pi * np.stack([time * (0.4 + 0.1 * time), time * (0.9 - 0.1 * time)], axis=1)
    commands = amplitude * (0.7 * np.sin(phase) + 0.3 * np.sign(np.sin(2.7 * phase)))
    driver = played_back(physical.anatomy.motors, commands)
    whole = collect(physical.anatomy.names, SimulatedRobot(physical).run(driver, ARM_STEPS))
    signals = {name: np.full_like(values, np.nan) for name, values in whole.signals.items()}
    signals["commands"] = whole["commands"]
    signals["joint_positions"] = whole["joint_positions"] + rng.normal(0, noise, (ARM_STEPS, 2))
    trajectory = dataclasses.replace(whole, signals=signals)
    return Trial(TrialPlan("arm", "before", driver, ARM_STEPS, 0), "arm", trajectory, "arm.mcap")


@search
def test_joints_and_delay_of_an_arm_are_found_with_the_same_bits_on_any_number_of_threads():
    physical = with_parameters(arm(), Parameters(**JOINTS_TRUE, delay=ARM_DELAY))
    found, again = (calibrate(arm(), [arm_trial(physical, ARM_NOISE)], own) for own in (1, 2))
    joints, parameters = found.joints, found.parameters

    assert found.robot.mjcf == again.robot.mjcf
    assert found.to_dict() == again.to_dict()
    assert parameters.delay == found.robot.control_delay == ARM_DELAY
    assert joints is not None
    assert found.chosen == joints["set"] == "kinds"  # as many as joints: the two differ
    deviations = iter([row["deviation"] for row in joints["parameters"]])
    for quantity, true in JOINTS_TRUE.items():
        for value, factor in zip(getattr(parameters, quantity), true, strict=True):
            assert abs(np.log(value / factor)) < 3 * next(deviations) + 0.02, quantity
    assert joints["worst_joint_error"] < 3 * ARM_NOISE  # the prior is felt
    assert joints["held_out_error"] < 0.2 * joints["held_out_error_before"]
    assert found.to_dict()["joints"] == joints


@search
@pytest.mark.parametrize(("limit", "found"), [(8.0, 0.5), (200.0, None)], ids=["reached", "beyond"])
def test_a_limit_of_the_force_is_fitted_if_the_trials_reach_it(limit: float, found: float | None):
    nominal_arm = arm_of(ARM.replace("-20 20", f"-{limit} {limit}"), control_timestep=0.01)
    limits = (0.5, 0.5) if found else ()
    true = Parameters(**JOINTS_TRUE, force_limits=limits, delay=ARM_DELAY)
    trial = arm_trial(with_parameters(nominal_arm, true), ARM_NOISE)
    calibration = calibrate(nominal_arm, [trial], 1)

    assert calibration.parameters.force_limits == pytest.approx(limits, rel=0.1)
    rows = [row for row in calibration.joints["parameters"] if row["quantity"] == "force limit"]
    assert [row["name"] for row in rows] == (["a", "b"] if found else [])


@search
def test_a_refit_of_an_arm_finds_a_limit_that_the_healthy_trials_do_not_reach():
    nominal_arm = arm_of(ARM.replace("-20 20", "-8 8"), control_timestep=0.01)
    true = Parameters(**JOINTS_TRUE, force_limits=(0.5, 0.5), delay=ARM_DELAY)
    limited = with_parameters(nominal_arm, true)
    small, large = (arm_trial(limited, ARM_NOISE, amplitude) for amplitude in (0.1, 1.0))
    fit = calibrate(nominal_arm, [small], 1)
    refit = Refit(nominal_arm, fit, 1)([small, large], [INTACT, INTACT])
    before, after = (prediction_error(robot, [large], 1) for robot in (fit.robot, refit))

    assert fit.parameters.force_limits == ()
    assert after < 0.1 * before


@search
def test_an_arm_whose_truth_is_nominal_stays_nominal_and_as_uncertain_as_before():
    found = calibrate(arm(), [arm_trial(arm(), ARM_NOISE)], 1)

    assert found.robot is arm()
    assert (found.chosen, found.parameters) == ("nominal", nominal(arm()))
    assert found.deviations.tolist() == prior_of(arm()).tolist()
    assert (found.deviations > 0).all()
    assert found.undetermined == ()
    assert found.joints is not None
    assert not any(row["determined"] for row in found.joints["parameters"])
    assert all(row["value"] == row["before"] for row in found.joints["parameters"])


def test_slopes_without_their_noise_are_fisher_information():
    rng = np.random.default_rng(1)
    slopes = rng.standard_normal((100_000, 2)) * [1.0, 0.1]
    noise = rng.standard_normal((2, *slopes.shape))
    expected = slopes.T @ slopes

    np.testing.assert_allclose(consistent_information(slopes, slopes), expected, rtol=1e-9)
    found = consistent_information(slopes + noise[0], slopes + noise[1])
    np.testing.assert_allclose(np.diag(found), np.diag(expected), rtol=0.5)
    assert np.abs(consistent_information(*noise)).max() < 2000  # 0.02 of the noise squared
    assert np.linalg.eigvalsh(consistent_information(slopes, -slopes)).min() >= -1e-9


def test_a_parameter_is_determined_if_the_trials_halve_its_variance():
    prior = np.array([0.15, 0.3])

    assert is_determined(UNDETERMINED_SHARE * prior * 0.99, prior).all()
    assert not is_determined(UNDETERMINED_SHARE * prior * 1.01, prior).any()
