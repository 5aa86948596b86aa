"""Promises of the readings and commands in segments: what is sure, what contradicts, and noise."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, strategies as st

from selfmodel.comparators import SEGMENT_PREDICTION, SEGMENT_PREDICTION_ONBOARD
from selfmodel.comparators.encoders import encoder_motion_loss, logged_motion
from selfmodel.comparators.readings import (
    CONTRADICTION,
    command_errors,
    command_spans,
    noise_level_loss,
)
from selfmodel.comparators.segment_prediction import MIN_SEGMENTS, SegmentPrediction
from selfmodel.controllers.controller import Controller
from selfmodel.controllers.playback import Playback
from selfmodel.diagnosis.comparator import TrialRefusedError
from selfmodel.recording import load_policy
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.testing import shown
from selfmodel.trials.estimation import JOINTS
from selfmodel.trials.signals import PREDICTION_ERROR_SCALES
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial
from tests.helpers.drivers import random_controllers
from tests.helpers.gaits import changed, gait, logged
from tests.helpers.memory import trial_of

TOUCH = 0
"""The column of a sensor of touch."""


def losses(trial: Trajectory, readings: np.ndarray) -> np.ndarray:
    """The loss of each segment where only these readings, ``(segments, 13, 4)``, are predicted."""
    one = logged(trial)
    perfect = shown(SEGMENT_PREDICTION.prepare(one).request, one)
    signals = {**perfect.signals, "sensors": readings[np.newaxis]}
    found = Trajectory(perfect.names, perfect.time, signals)
    return SEGMENT_PREDICTION.prepare(one).losses(found).total[0]


def predicted(trial: Trajectory) -> np.ndarray:
    """The readings of a perfect prediction, ``(segments, 13, 4)``."""
    one = logged(trial)
    return shown(SEGMENT_PREDICTION.prepare(one).request, one)["sensors"][0].copy()


@pytest.mark.parametrize("comparator", [SEGMENT_PREDICTION, SEGMENT_PREDICTION_ONBOARD])
def test_the_encoder_of_a_detached_hinge_follows_its_command_in_each_section(
    comparator: SegmentPrediction,
):
    walking = gait(steps=2400)
    commands = np.zeros_like(walking["commands"])
    commands[:-1, 0] = walking["joint_positions"][1:, 0]
    trial = logged(changed(walking, commands=commands))
    whole = comparator.prepare(trial)
    assert bool(whole.sections) == (comparator is SEGMENT_PREDICTION_ONBOARD)
    for part in whole.sections or [whole]:
        perfect = shown(part.request, trial)
        both = {signal: values.repeat(2, axis=0) for signal, values in perfect.signals.items()}
        both["joint_positions"][..., 0] += 1.0
        detached = np.array([[True, False, False, False], [False] * 4])
        simulated = dataclasses.replace(perfect, signals=both, detached=detached)
        follows, moves = part.losses(simulated).by_signal["joint_positions"]
        assert follows.max() < 1e-9 < moves.min()


def test_a_touch_at_the_beginning_of_a_segment_is_judged_only_where_the_robot_stands():
    walking = gait()
    readings = predicted(walking)
    readings[:, 0, TOUCH] = 1 - readings[:, 0, TOUCH]

    found = losses(walking, readings)
    assert found[0] > 0
    assert not found[1:].any()


def test_a_touch_that_is_never_predicted_counts_three_times_where_it_comes():
    walking = gait()
    silent, late = predicted(walking), predicted(walking)
    silent[..., TOUCH] = 0
    # The same segments wrong in the same steps, but for one with a predicted touch.
    late[..., TOUCH] = 0
    far = int(np.flatnonzero(predicted(walking)[:, 1:, TOUCH].any(axis=1))[-1])
    late[far] = predicted(walking)[far]

    never, now_and_then = losses(walking, silent), losses(walking, late)
    others = np.arange(len(never)) != far
    assert never[others].sum() > 0
    np.testing.assert_allclose(never[others], CONTRADICTION * now_and_then[others], rtol=1e-12)
    assert CONTRADICTION == 3


def motion_loss(run: Trajectory, predicted: np.ndarray, hinges: np.ndarray) -> np.ndarray:
    """The loss of the motion of some encoders, ``(1, segments)``."""
    request = SEGMENT_PREDICTION.prepare(logged(run)).request
    angles = np.full_like(run["joint_positions"], np.nan)
    angles[:, hinges] = run["joint_positions"][:, hinges]
    time = run.time[: request.horizon + 1]
    simulated = Trajectory(run.names, time, {"joint_positions": predicted})
    return encoder_motion_loss(simulated, logged_motion(angles, request.starts, request.horizon))


@pytest.mark.parametrize("lost", [0, 3])
def test_the_loss_without_an_encoder_is_that_of_the_other_columns(lost: int):
    walking, others = gait(), [leg for leg in range(4) if leg != lost]
    joints = {signal: walking[signal].copy() for signal in JOINTS}
    for values in joints.values():
        values[:, lost] = np.nan
    trial = logged(changed(walking, **joints))
    prepared = SEGMENT_PREDICTION.prepare(trial)
    exact = shown(SEGMENT_PREDICTION.prepare(logged(walking)).request, logged(walking))
    rng = np.random.default_rng(lost)
    wrong = {signal: exact[signal] + rng.normal(0, 0.1, exact[signal].shape) for signal in JOINTS}
    simulated = Trajectory(exact.names, exact.time, {**exact.signals, **wrong})
    found = prepared.losses(simulated).total

    expected = np.zeros_like(found)
    for signal in JOINTS:
        steps = [3, 6, 9, 12]
        errors = (wrong[signal] - exact[signal])[:, :, steps][..., others]
        expected += np.log1p(np.square(errors / PREDICTION_ERROR_SCALES[signal])).mean(axis=(2, 3))
    expected += motion_loss(walking, wrong["joint_positions"], others)
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    assert not prepared.request.independent


STEPS = 60


def trial(robot: Robot, truth: str = "intact") -> Trial:
    return trial_of(robot, truth, *random_controllers(robot, 1), steps=STEPS)


def with_signals(one: Trial, **signals: np.ndarray) -> Trial:
    return dataclasses.replace(one, trajectory=changed(one.trajectory, **signals))


@pytest.mark.parametrize("truth", ["intact", "break:front_left_knee", "sensor:front_left_angle"])
def test_a_working_controller_has_errors_of_exactly_0_under_any_other_fault(
    robot: Robot, truth: str
):
    one = trial(robot, truth.replace("front_left_knee", robot.anatomy.joints[0].name))

    assert np.array_equal(command_errors(one), np.zeros((STEPS, len(robot.anatomy.motors))))


def test_command_spans_are_relative_to_the_paper_s_range(quadruped: Robot):
    one = trial(quadruped)
    network = network_for(quadruped)
    wide = dataclasses.replace(network, ranges=((0.0, np.pi / 2), *network.ranges[1:]))
    driver = Controller(wide, one.plan.controller.genome)
    other = dataclasses.replace(one, plan=dataclasses.replace(one.plan, controller=driver))

    assert np.array_equal(command_spans(one), np.ones(8))
    assert np.array_equal(command_spans(other), [2, *np.ones(7)])


def test_a_silent_neuron_causes_errors_in_every_motor_at_once(robot: Robot):
    errors = command_errors(trial(robot, "neuron:1"))

    assert np.abs(errors[0]).max() > 0.01
    assert np.all(np.abs(errors).max(axis=0) > 0.01)


def test_a_wrong_command_is_the_error_at_its_step_and_motor(quadruped: Robot):
    one = trial(quadruped)
    commands = one.trajectory["commands"].copy()
    commands[20, 3] += 0.25
    errors = command_errors(with_signals(one, commands=commands))

    assert errors[20, 3] == pytest.approx(0.25)
    errors[20, 3] = 0
    assert not errors.any()


def test_errors_are_nan_from_the_first_unobserved_reading(quadruped: Robot):
    one = trial(quadruped)
    readings = one.trajectory["sensors"].copy()
    readings[25, 2] = np.nan
    errors = command_errors(with_signals(one, sensors=readings))

    assert np.array_equal(errors[:25], np.zeros((25, len(quadruped.anatomy.motors))))
    assert np.isnan(errors[25:]).all()


def test_a_playback_has_errors_of_exactly_0(quadruped: Robot):
    one = trial(quadruped, "neuron:0")
    driver = Playback(quadruped.anatomy.motors, one.trajectory["commands"])
    played = dataclasses.replace(one, plan=dataclasses.replace(one.plan, controller=driver))

    assert np.array_equal(command_errors(played), np.zeros((STEPS, len(driver.motors))))


def test_a_policy_has_errors_of_exactly_0_whatever_it_observes(quadruped: Robot):
    terms = {"observation": [{"term": "joint_positions"}, {"term": "angular_velocity"}]}
    policy = load_policy(terms, quadruped, lambda seen: 0.3 - seen[:8])
    one = trial_of(quadruped, "intact", policy, steps=STEPS)

    assert np.ptp(one.trajectory["commands"], axis=0).all()
    assert not command_errors(one).any()


SEGMENTS, ROWS, SENSORS = 80, 13, 4
ALL = np.ones((1, SENSORS), dtype=bool)


def moving(radians_per_step: float) -> np.ndarray:
    """Readings of sensors that swing from end to end of their range, each out of step."""
    step = np.arange(SEGMENTS)[:, np.newaxis] * 7.3 + np.arange(ROWS)
    return np.sin(radians_per_step * step[..., np.newaxis] + np.arange(SENSORS))


def noisy(readings: np.ndarray, *deviations: float, seed: int = 0) -> np.ndarray:
    """The readings with noise."""
    return readings + np.random.default_rng(seed).normal(size=readings.shape) * deviations


def loss(predicted: np.ndarray, logged: np.ndarray, graded: np.ndarray = ALL) -> float:
    """Of one prediction."""
    return float(noise_level_loss(predicted[np.newaxis], logged, graded)[0])


@given(st.integers(0, 99), st.floats(0, 0.8))
def test_a_prediction_that_trembles_as_the_log_does_is_at_0(seed: int, deviation: float):
    logged = noisy(moving(0.1), 0, 0, 0, deviation, seed=seed)

    assert loss(logged, logged) == 0


@pytest.mark.parametrize("deviation", [0.2, 0.3, 0.6])
def test_the_right_noise_of_the_right_sensor_is_nearest(deviation: float):
    logged = noisy(moving(0.1), 0.05, 0.05, 0.05 + deviation, 0.05)
    predicted = {
        "right": noisy(moving(0.1), 0, 0, deviation, 0, seed=1),
        "none": moving(0.1),
        "twice": noisy(moving(0.1), 0, 0, 2 * deviation, 0, seed=1),
        "other": noisy(moving(0.1), 0, 0, 0, deviation, seed=1),
    }
    losses = {name: loss(one, logged) for name, one in predicted.items()}

    assert losses["right"] < losses["none"] / 2
    assert losses["right"] < losses["twice"] / 2
    assert losses["none"] < losses["other"]


@pytest.mark.parametrize("radians_per_step", [0.02, 0.3, 0.6])
def test_a_joint_that_swings_alone_is_no_noisy_one_up_to_ten_steps_a_swing(radians_per_step: float):
    logged = moving(radians_per_step)
    logged[..., 1:] = 0

    assert loss(np.zeros((SEGMENTS, ROWS, SENSORS)), logged) == 0


def test_what_was_not_received_does_not_count():
    whole = noisy(moving(0.1), 0.05, 0.05, 0.4, 0.05)
    holes = whole.copy()
    holes[::2, :, 2] = np.nan
    never = np.full_like(whole, np.nan)

    assert loss(moving(0.1), holes) == pytest.approx(loss(moving(0.1), whole), rel=0.1)
    assert loss(moving(0.1), never) == 0


@pytest.mark.parametrize("level", [0.05, 0.2])
def test_noise_that_all_instruments_have_is_no_fault(level: float):
    assert loss(moving(0.1), noisy(moving(0.1), level, level, level, level)) == 0


def test_sensors_of_yes_and_no_have_no_noise():
    logged = noisy(moving(0.1), 0, 0, 0.5, 0)

    assert loss(moving(0.1), logged) > 0
    assert loss(moving(0.1), logged, np.array([[True, True, False, True]])) == 0


def test_a_surrogate_whose_segments_without_late_steps_only_warm_up_refuses_the_trial():
    walking = gait()
    late = np.zeros(walking.steps, np.bool_)
    late[-60:] = True
    hasty = logged(dataclasses.replace(walking, late=late))
    cheap = SEGMENT_PREDICTION_ONBOARD.surrogate.surrogate

    assert len(cheap.prepare(logged(walking)).piece_steps) == MIN_SEGMENTS
    assert len(SEGMENT_PREDICTION_ONBOARD.prepare(hasty).piece_steps) > MIN_SEGMENTS
    with pytest.raises(TrialRefusedError, match="late"):
        cheap.prepare(hasty)
