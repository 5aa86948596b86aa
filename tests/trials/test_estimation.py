"""Promises of estimates: states exact without noise, nearer to the truth with it; velocities."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from selfmodel.controllers.controller import CommandSource
from selfmodel.controllers.playback import played_back
from selfmodel.faults.notation import parse
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import ROBOTS, entry
from selfmodel.trials.estimation import (
    JOINTS,
    PLAY,
    STATE,
    encoder_noise,
    estimated_states,
    known_steps,
    lacks_joint_velocities,
    standing_tolerance,
    with_joint_velocities,
)
from selfmodel.trials.signals import SIGNALS, Names, Signal
from selfmodel.trials.trajectory import Trajectory
from tests.helpers.drivers import random_controllers, random_motion
from tests.helpers.gaits import changed

QUADRUPED = ROBOTS["quadruped"].robot()
REACH = {"joint_positions": 3, "base_position": 6}
"""Steps to either side that an average takes in."""


def runs(
    robot: Robot, text: str, drivers: Sequence[CommandSource], steps: int = 300
) -> list[Trajectory]:
    hypothesis = parse(text, robot.anatomy)
    pairs = [(hypothesis, driver) for driver in drivers]
    batch = Simulator(robot, 1).run(pairs, steps, SIGNALS).trajectory
    return [batch.run(number) for number in range(len(drivers))]


def smooth(robot: Robot, count: int, steps: int = 300) -> list[CommandSource]:
    """Drivers that move every joint once a second."""
    motors = robot.anatomy.motors
    return [played_back(motors, random_motion(robot, steps, seed)) for seed in range(count)]


(RUN,) = runs(QUADRUPED, "intact", smooth(QUADRUPED, 1))


@pytest.mark.parametrize("text", ["intact", "break:front_left_knee"])
def test_without_noise_the_state_is_what_was_logged_to_the_bit(text: str):
    for run in runs(QUADRUPED, text, smooth(QUADRUPED, 2, 200), 200):
        assert set(estimated_states(run)) == set(STATE)
        assert is_as_logged(run)


def test_without_noise_a_jerky_or_trembling_run_is_what_was_logged_too():
    drivers = random_controllers(QUADRUPED, 4)
    assert all(is_as_logged(run) for run in runs(QUADRUPED, "intact", drivers))
    for name in ("suite-cheetah-run", "suite-swimmer-swimmer6"):
        robot = entry(name).robot()
        motors = robot.anatomy.motors
        to_and_fro = np.where(np.arange(300)[:, np.newaxis] % 2, 1.0, -1.0) * np.ones(len(motors))
        (run,) = runs(robot, "intact", [played_back(motors, to_and_fro)])
        assert is_as_logged(run)


def is_as_logged(run: Trajectory) -> bool:
    states = estimated_states(run)
    return all(states[signal].tobytes() == run[signal].tobytes() for signal in STATE)


@given(seed=st.integers(0, 2**32), level=st.floats(0.02, 0.3))
@settings(max_examples=15, deadline=None)
def test_with_noise_positions_are_nearer_to_the_truth_than_what_was_logged(seed: int, level: float):
    rng = np.random.default_rng(seed)

    def noisy(signal: Signal, scale: float) -> np.ndarray:
        return RUN[signal] + level * scale * rng.standard_normal(RUN[signal].shape)

    run = changed(
        RUN,
        joint_positions=noisy("joint_positions", 0.5),
        joint_velocities=noisy("joint_velocities", 2.0),
        base_position=noisy("base_position", 0.1),
        base_linear_velocity=noisy("base_linear_velocity", 0.5),
    )
    states = estimated_states(run)
    for signal in REACH:
        error = np.std(states[signal] - RUN[signal])

        assert error < 0.8 * np.std(run[signal] - RUN[signal]), signal
    for signal in set(STATE) - set(REACH):
        assert states[signal].tobytes() == run[signal].tobytes(), signal


@given(
    seed=st.integers(0, 2**32),
    lost=st.lists(st.integers(0, RUN.steps - 1), max_size=5),
    of=st.sampled_from(["base_position", "base_linear_velocity"]),
)
@settings(max_examples=15, deadline=None)
def test_a_state_is_unknown_where_what_it_is_made_of_was_not_observed(
    seed: int, lost: list[int], of: Signal
):
    rng = np.random.default_rng(seed)
    position = RUN["base_position"] + 0.01 * rng.standard_normal(RUN["base_position"].shape)
    run = changed(RUN, base_position=position)
    values = run[of].copy()
    values[lost] = np.nan
    state = estimated_states(changed(run, **{of: values}))["base_position"]
    near = np.zeros(RUN.steps, dtype=bool)
    for step in lost:
        near[max(step - 6, 0) : step + 7] = True

    assert np.isnan(state[near]).all()
    assert np.isfinite(state[~near]).all()


def test_what_was_never_observed_stays_unknown():
    unknown = np.full_like(RUN["base_position"], np.nan)
    states = estimated_states(changed(RUN, base_position=unknown, base_linear_velocity=unknown))

    assert np.isnan(states["base_position"]).all()
    assert states["joint_positions"].tobytes() == RUN["joint_positions"].tobytes()


def test_a_lost_encoder_leaves_the_estimates_of_the_others_and_a_lost_velocity_the_position():
    noisy = RUN["joint_positions"] + np.random.default_rng(0).normal(0, 0.01, (300, 8))
    complete = estimated_states(changed(RUN, joint_positions=noisy), JOINTS)["joint_positions"]
    positions, velocities = noisy.copy(), RUN["joint_velocities"].copy()
    positions[:, 5] = velocities[:, [3, 5]] = np.nan
    run = changed(RUN, joint_positions=positions, joint_velocities=velocities)
    found = estimated_states(run, JOINTS)["joint_positions"]

    others = ~np.isin(np.arange(8), (3, 5))
    assert np.all(np.any(complete != noisy, axis=0))
    np.testing.assert_array_equal(found[:, others], complete[:, others])
    np.testing.assert_array_equal(found[:, 3], noisy[:, 3])
    assert np.isnan(found[:, 5]).all()


@given(columns=st.sets(st.integers(0, 7)), step=st.integers(0, 299))
def test_a_step_is_known_if_some_hinge_is(columns: set[int], step: int):
    angles, base = np.zeros((300, 8)), np.zeros((300, 3))
    angles[step, sorted(columns)] = np.nan
    known = known_steps({"joint_positions": angles, "base_position": base})
    assert known.sum() == 300 - (len(columns) == 8)

    base[step, 0] = np.nan
    assert not known_steps({"joint_positions": angles, "base_position": base})[step]


@pytest.mark.parametrize("substeps", [1, 15])
def test_noise_is_smoothed_with_any_number_of_physics_steps_in_a_control_step(substeps: int):
    h = 0.01 / substeps
    velocity = 8 * np.sin(np.arange(300 * substeps + 1)[:, np.newaxis] * h * 30 + np.arange(3))
    position = np.cumsum(velocity[1:] * h, axis=0)  # the velocity at the end of a physics step
    rng = np.random.default_rng(0)
    true = position[substeps - 1 :: substeps]
    logged = true + 0.004 * rng.standard_normal(true.shape)
    names = Names((), (), ("a", "b", "c"))
    signals = {"joint_positions": logged, "joint_velocities": velocity[substeps::substeps]}
    run = Trajectory(names, 0.01 * np.arange(300), signals, substeps=substeps)

    assert np.std(estimated_states(run, JOINTS)["joint_positions"] - true, axis=0).max() < 0.003


TIME = np.arange(200) * 0.005
NAMES = Names((), ("motor",), ("hinge", "other"))


def trajectory(**more: object) -> Trajectory:
    positions = np.stack([1 + 2 * TIME - 3 * TIME**2 + TIME**3, np.cos(6 * TIME)], axis=1)
    return Trajectory(NAMES, TIME, {"joint_positions": positions}, **more)


def test_the_velocity_of_a_cubic_is_exact():
    found = with_joint_velocities(trajectory())["joint_velocities"]

    np.testing.assert_allclose(found[:, 0], 2 - 6 * TIME + 3 * TIME**2, atol=1e-9)
    np.testing.assert_allclose(found[:, 1], -6 * np.sin(6 * TIME), atol=0.1)


def test_logged_velocities_are_kept():
    logged = {**trajectory().signals, "joint_velocities": np.full((200, 2), np.nan)}
    logged["joint_velocities"][7, 1] = 3.0
    known = dataclasses.replace(trajectory(), signals=logged)

    assert with_joint_velocities(known) is known
    assert not lacks_joint_velocities(known)
    assert lacks_joint_velocities(trajectory())


def test_velocities_near_unknown_positions_and_late_steps_are_unknown():
    late = np.zeros(200, dtype=bool)
    late[150] = True
    lost = trajectory(late=late)
    lost.signals["joint_positions"][50, 0] = np.nan
    unknown = np.isnan(with_joint_velocities(lost)["joint_velocities"])

    assert np.flatnonzero(unknown[:, 0]).tolist() == [*range(40, 61), *range(140, 161)]
    assert np.flatnonzero(unknown[:, 1]).tolist() == list(range(140, 161))


STEPS = 1000
SWING = 0.4 * np.sin(np.arange(STEPS) * 0.01 * 2 * np.pi * 1.5)


@pytest.mark.parametrize("deviation", [0.003, 0.02])
@pytest.mark.parametrize("motion", [np.zeros(STEPS), SWING])
def test_white_noise_is_estimated_on_standing_and_on_moving_joints(
    motion: np.ndarray, deviation: float
):
    noise = np.random.default_rng(0).normal(0, deviation, STEPS)

    assert encoder_noise((motion + noise)[:, np.newaxis])[0] == pytest.approx(deviation, rel=0.15)


def test_a_swinging_joint_has_no_noise_and_a_flickering_encoder_that_of_rounding():
    flickering = np.where(np.arange(STEPS) % 50, 0.0, 0.02)
    swinging, rounded = encoder_noise(np.stack([SWING, flickering], axis=1))

    assert swinging < 1e-3
    assert rounded == pytest.approx(0.02 / np.sqrt(12))


def test_unknown_angles_are_left_out_and_a_column_without_angles_has_no_noise():
    angles = np.full((STEPS, 2), np.nan)
    angles[:, 0] = 0.3 + np.random.default_rng(0).normal(0, 0.01, STEPS)
    angles[::40, 0] = np.nan

    known, unknown = encoder_noise(angles)
    assert known == pytest.approx(0.01, rel=0.2)
    assert unknown == 0
    assert standing_tolerance(angles)[1] == PLAY
