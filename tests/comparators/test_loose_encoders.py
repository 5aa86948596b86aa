"""Tests of encoders of detached limbs: those that follow their motor are recognised."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from selfmodel.comparators.encoders import LooseEncoders, loose_encoders, with_loose_encoders
from selfmodel.trials.trajectory import Trajectory
from tests.helpers.gaits import LEGS, changed, gait

HORIZON = 12
STARTS = np.arange(0, 450, 50)
STEPS = 500
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
