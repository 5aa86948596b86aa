"""Promises of encoders: they stand or move, and those of detached limbs may follow their motor."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from selfmodel.comparators.encoders import (
    LooseEncoders,
    encoder_motion_loss,
    hinge_losses,
    logged_motion,
    loose_encoders,
    with_loose_encoders,
)
from selfmodel.trials.signals import HINGE_ERROR_SCALES, Signal
from selfmodel.trials.trajectory import Trajectory
from tests.helpers.gaits import LEGS, changed, gait

HORIZON, STEPS, HINGES = 12, 961, 4
STARTS = np.arange(0, STEPS - HORIZON, HORIZON)
STAND = 0.3


def swinging(amplitude: float) -> np.ndarray:
    """Angles of joints that swing at 1.5 Hz, each out of step, ``(steps, hinges)``."""
    time = np.arange(STEPS)[:, np.newaxis] * 0.01
    return amplitude * np.sin(2 * np.pi * 1.5 * time + np.arange(HINGES))


def with_hinge(angles: np.ndarray, column: np.ndarray | float) -> np.ndarray:
    """The angles, with other ones of the first hinge."""
    changed = angles.copy()
    changed[:, 0] = column
    return changed


def noisy(angles: np.ndarray, deviation: float) -> np.ndarray:
    """The angles with noise."""
    return angles + np.random.default_rng(0).normal(0, deviation, angles.shape)


def segments(angles: np.ndarray) -> np.ndarray:
    """A prediction of every segment, ``(segments, horizon + 1, hinges)``."""
    return angles[STARTS[:, np.newaxis] + np.arange(HORIZON + 1)]


def mean_loss(predicted: np.ndarray, logged: np.ndarray, *, detaches: bool = False) -> float:
    """The mean loss of one prediction of angles ``(steps, hinges)``.

    A hinge that stands is welded, and the first one detached if the hypothesis detaches it.
    """
    stands = np.ptp(predicted, axis=0) == 0
    first = np.arange(HINGES) == 0
    simulated = Trajectory(
        gait().names,
        np.arange(HORIZON + 1) * 0.01,
        {"joint_positions": segments(predicted)[np.newaxis]},
        welded=(stands & ~(first & detaches))[np.newaxis],
        detached=(first & detaches)[np.newaxis],
    )
    return float(encoder_motion_loss(simulated, logged_motion(logged, STARTS, HORIZON)).mean())


@given(st.floats(0, 1), st.floats(0, 0.1))
def test_the_motion_of_the_log_itself_has_no_loss(amplitude: float, deviation: float):
    logged = noisy(swinging(amplitude), deviation)

    assert mean_loss(logged, logged) == 0


@pytest.mark.parametrize("deviation", [0, 0.01, 0.02])
def test_a_jam_is_contradicted_by_a_knee_that_swings_a_sixth_of_a_radian(deviation: float):
    logged = noisy(swinging(0.085), deviation)
    moving, jammed = swinging(0.085), with_hinge(swinging(0.085), 0.05)

    assert mean_loss(jammed, logged) > mean_loss(moving, logged) + 0.1


@pytest.mark.parametrize("deviation", [0, 0.01, 0.02])
def test_a_moving_joint_is_contradicted_by_an_encoder_that_stands(deviation: float):
    logged = noisy(with_hinge(swinging(0.4), STAND), deviation)
    jammed, moving = with_hinge(swinging(0.4), STAND + 0.01), swinging(0.4)

    assert mean_loss(moving, logged) > 3 * mean_loss(jammed, logged)
    assert mean_loss(moving, logged) > 0.1


def test_the_encoder_of_a_detached_joint_counts_neither_for_nor_against():
    for column in (STAND, swinging(0.4)[:, 0], swinging(0.4)[:, 1]):
        logged = with_hinge(swinging(0.4), column)
        detached = with_hinge(swinging(0.4), np.median(logged[STARTS, 0]))

        assert mean_loss(detached, logged, detaches=True) == pytest.approx(0, abs=1e-12)


SEGMENTS, STEP_COUNT, COLUMNS = 3, 12, 4
COMPARED = np.array([3, 6, 9, 12])
MOTION = np.linspace(0, 1, SEGMENTS * (STEP_COUNT + 1) * COLUMNS).reshape(1, SEGMENTS, -1, COLUMNS)


def predicted(
    positions: np.ndarray = MOTION,
    velocities: np.ndarray = MOTION,
    detached: np.ndarray | None = None,
) -> Trajectory:
    signals: dict[Signal, np.ndarray] = {
        "joint_positions": positions,
        "joint_velocities": velocities,
    }
    return Trajectory(gait().names, np.arange(STEP_COUNT + 1) * 0.01, signals, detached=detached)


def losses(
    prediction: Trajectory, positions: np.ndarray = MOTION, velocities: np.ndarray = MOTION
) -> np.ndarray:
    logged: dict[Signal, np.ndarray] = {
        "joint_positions": positions[0][:, COMPARED],
        "joint_velocities": velocities[0][:, COMPARED],
    }
    return hinge_losses(prediction, logged, COMPARED)


def shifted(values: np.ndarray, hinge: int, change: float) -> np.ndarray:
    changed = values.copy()
    changed[..., hinge] += change
    return changed


@given(st.integers(0, COLUMNS - 1), st.floats(1e-3, 1))
def test_an_error_of_one_hinge_is_a_loss_of_this_hinge_alone(hinge: int, error: float):
    found = losses(predicted(shifted(MOTION, hinge, error)))

    expected = np.log1p((error / HINGE_ERROR_SCALES["joint_positions"]) ** 2)
    assert found[..., hinge] == pytest.approx(np.full((1, SEGMENTS), expected))
    assert not np.delete(found, hinge, axis=2).any()


def test_an_unknown_angle_is_no_evidence_and_an_unknown_velocity_leaves_the_angle():
    unknown = shifted(MOTION, 2, np.nan)

    assert np.isnan(losses(predicted(), positions=unknown)[..., 2]).all()
    assert losses(predicted(shifted(MOTION, 2, 0.1)), velocities=unknown)[..., 2].all()
    assert not np.isnan(losses(predicted(), velocities=unknown)).any()


def test_a_hinge_that_the_hypothesis_detaches_has_no_loss():
    lost = np.array([[False, True, False, False]])

    assert np.isnan(losses(predicted(detached=lost))).all(axis=(0, 1)).tolist() == lost[0].tolist()


def test_unknown_angles_are_no_evidence():
    logged = with_hinge(swinging(0.4), np.nan)

    assert mean_loss(with_hinge(swinging(0.4), STAND), logged) == 0
    assert mean_loss(swinging(0.4), np.full_like(logged, np.nan)) == 0


RNG = np.random.default_rng(0)


def walks() -> np.ndarray:
    """Commands without a rhythm, each different: sums of sines, ``(steps, motors)`` rad."""
    time = np.arange(STEPS)[:, np.newaxis] * 0.01
    frequencies = np.array([[0.7, 1.3, 2.1], [0.9, 1.7, 2.6], [0.5, 1.1, 2.3], [0.8, 1.9, 2.9]])
    waves = np.sin(2 * np.pi * time[..., np.newaxis] * frequencies + frequencies)
    return np.asarray(0.3 * waves.sum(axis=2))


COMMANDS = walks()


def lagging(commands: np.ndarray, constant: float) -> np.ndarray:
    """Commands after a motor without a load, as its encoder has them, ``(steps,)``."""
    angles = np.empty_like(commands)
    angles[0] = commands[0]
    for k in range(1, len(commands)):
        gain = 1 - np.exp(-1 / constant) if constant else 1.0
        angles[k] = angles[k - 1] + gain * (commands[k - 1] - angles[k - 1])
    return angles


def under_load(commands: np.ndarray) -> np.ndarray:
    """Angles of a joint that carries a limb: commands beside a motion of the limb's own."""
    own = np.sin(2 * np.pi * 3.3 * np.arange(len(commands)) * 0.01)
    return np.asarray(0.5 * lagging(commands, 3.0) + 0.4 * own)


def trajectory_of(*angles: np.ndarray, sensors: np.ndarray | None = None) -> Trajectory:
    run = gait(steps=STEPS)
    positions = np.stack(angles, axis=1)
    return changed(
        run,
        commands=COMMANDS,
        joint_positions=positions,
        joint_velocities=np.gradient(positions, run.time, axis=0),
        sensors=run["sensors"] if sensors is None else sensors,
    )


LOADED = [under_load(column) for column in COMMANDS.T]


def one_loose(first: np.ndarray, sensors: np.ndarray | None = None) -> LooseEncoders | None:
    """Loose encoders of a robot whose first encoder has given angles."""
    return loose_encoders(trajectory_of(first, *LOADED[1:], sensors=sensors), STARTS, HORIZON)


@settings(max_examples=6)
@given(
    constant=st.sampled_from([0.0, 0.5, 1.5, 2.5, 5.0, 8.0]),
    gain=st.sampled_from([-1.0, 0.4, 1.0]),
    offset=st.floats(-1, 1),
    noise=st.sampled_from([0.0, 0.01]),
)
def test_an_encoder_that_follows_its_motor_with_a_lag_is_recognised(
    constant: float, gain: float, offset: float, noise: float
):
    clean = offset + gain * lagging(COMMANDS[:, 0], constant)
    found = one_loose(clean + RNG.normal(0, noise, STEPS))

    assert found is not None
    assert found.hinges.tolist() == [0]
    rows = STARTS[:, np.newaxis] + np.arange(HORIZON + 1)
    spread = clean.std()
    assert np.abs(found.angles[..., 0] - clean[rows]).max() < 0.35 * spread
    if constant in (0.0, 8.0) and not noise:
        np.testing.assert_allclose(found.angles[..., 0], clean[rows], atol=1e-9)


@pytest.mark.parametrize(
    "angles",
    [
        lambda: np.full(STEPS, 0.3),
        lambda: np.full(STEPS, 0.3) + RNG.normal(0, 1e-4, STEPS),
        lambda: np.full(STEPS, np.nan),
        lambda: RNG.normal(0, 0.3, STEPS),
        lambda: LOADED[0],
    ],
    ids=["frozen", "frozen with noise", "lost", "noise", "under load"],
)
def test_other_encoders_do_not_follow_commands(angles: Callable[[], np.ndarray]):
    assert one_loose(angles()) is None


def test_readings_derived_from_the_angle_follow_it_and_others_stay():
    angles = lagging(COMMANDS[:, 0], 3.0)
    sensors = gait(steps=STEPS)["sensors"].copy()
    sensors[:, 1] = 0.2 - 0.5 * angles
    found = one_loose(angles, sensors)

    assert found is not None
    assert (found.sensors.tolist(), found.source.tolist()) == ([1], [0])
    np.testing.assert_allclose(found.readings[..., 0], 0.2 - 0.5 * found.angles[..., 0])


def simulated(detached: bool) -> Trajectory:  # noqa: FBT001  # of a table
    """Predictions of a hypothesis about the first leg, ``(1, segments, horizon + 1, width)``."""
    run = trajectory_of(np.zeros(STEPS) if detached else LOADED[0], *LOADED[1:])
    rows = STARTS[:, np.newaxis] + np.arange(HORIZON + 1)
    signals = {name: values[rows][np.newaxis] for name, values in run.signals.items()}
    mask = np.array([[detached, *[False] * (LEGS - 1)]])
    return Trajectory(run.names, run.time[: HORIZON + 1], signals, detached=mask)


@pytest.mark.parametrize("detached", [True, False])
def test_predictions_change_only_for_hypotheses_that_detach_the_hinge(detached: bool):  # noqa: FBT001  # of a table
    angles = lagging(COMMANDS[:, 0], 3.0)
    sensors = gait(steps=STEPS)["sensors"].copy()
    sensors[:, 1] = angles
    loose = one_loose(angles, sensors)
    assert loose is not None
    before = simulated(detached)
    after = with_loose_encoders(before, loose)

    for signal, column in (("joint_positions", 0), ("joint_velocities", 0), ("sensors", 1)):
        others = np.arange(LEGS) != column
        np.testing.assert_array_equal(
            after[signal][..., others], before[signal][..., others], err_msg=signal
        )
        is_same = np.array_equal(after[signal][..., column], before[signal][..., column])
        assert is_same != detached
    if detached:
        np.testing.assert_array_equal(after["joint_positions"][0, ..., 0], loose.angles[..., 0])
        np.testing.assert_array_equal(
            after["joint_velocities"][0, ..., 0], loose.velocities[..., 0]
        )
        np.testing.assert_array_equal(after["sensors"][0, ..., 1], loose.readings[..., 0])
    np.testing.assert_array_equal(after["base_position"], before["base_position"])
