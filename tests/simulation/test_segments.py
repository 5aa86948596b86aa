"""Promises of the segments of calibration: known completely, and no more of them."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.physical.simulated import SimulatedRobot, draw_gap
from selfmodel.simulation.requests import LEAD, WARM_UP
from selfmodel.simulation.segments import (
    HORIZON,
    MAX_FOLLOWING,
    MAX_SEGMENTS,
    MIN_BASE_SHARE,
    SegmentErrors,
    observed_segments,
)
from selfmodel.tasks import ROBOTS
from selfmodel.trials.estimation import BASE, ONBOARD, STATE, estimated_states
from selfmodel.trials.signals import Signal
from selfmodel.trials.trial import Trial
from tests.helpers.drivers import moving_trial
from tests.helpers.hostile import lacking, with_value, without_encoders

STEPS = 201
QUADRUPED = ROBOTS["quadruped"].robot()
GAP = draw_gap(QUADRUPED, 0.05, np.random.default_rng(0))
SEEN = pytest.mark.parametrize("lost", [(), BASE], ids=["seen", "unseen"])


trial = partial(moving_trial, QUADRUPED, seed=3, steps=STEPS)
WHOLE = trial(SimulatedRobot(QUADRUPED))
"""A trial without noise, all of it observed."""


def lost_and_late(whole: Trial) -> Trial:
    """One joint's velocity was not observed at steps 60 to 79, and step 150 came late."""
    lost = with_value(whole, "joint_velocities", slice(60, 80), 0, np.nan)
    return replace(lost, trajectory=replace(lost.trajectory, late=np.arange(STEPS) == 150))


def starts(tried: Trial) -> np.ndarray:
    return observed_segments(QUADRUPED, tried).segments.starts


def test_where_the_base_was_seen_they_are_spread_over_the_trial_with_all_of_the_state():
    found = observed_segments(QUADRUPED, WHOLE)
    begins = found.segments.starts

    assert len(begins) == MAX_SEGMENTS
    assert (begins[0], begins[-1]) == (LEAD, STEPS - 1 - HORIZON)
    assert set(found.segments.states) == set(found.observed) == set(STATE)


@pytest.mark.parametrize("lost", [BASE[:1], BASE[1:]], ids=["place", "velocity"])
def test_where_it_was_not_they_follow_each_other_from_the_start_on(lost: tuple[Signal, ...]):
    found = observed_segments(QUADRUPED, lacking(WHOLE, lost))

    np.testing.assert_array_equal(found.segments.starts, np.arange(0, STEPS - HORIZON, HORIZON))
    assert set(found.segments.states) == set(found.observed) == set(ONBOARD)


@pytest.mark.parametrize(
    ("without", "timestep", "following"),
    [("base", 0.01, MAX_FOLLOWING), ("base", 0.02, 4.0), ("encoder", 0.01, 6.0)],
)
def test_of_a_long_trial_without_the_base_two_parts_are_used_after_they_have_warmed_up(
    without: str, timestep: float, following: float
):
    run = WHOLE.trajectory
    long = {signal: np.tile(values, (8, 1)) for signal, values in run.signals.items()}
    time = timestep * np.arange(8 * STEPS)
    tried = replace(WHOLE, trajectory=replace(run, time=time, signals=long))
    tried = lacking(tried, BASE) if without == "base" else without_encoders(tried, [3])
    found = observed_segments(QUADRUPED, tried, following)

    length = timestep * HORIZON
    count, warm_up = round(following / length), round(WARM_UP / length)
    assert (found.segments.chains, len(found.segments.starts)) == (2, count)
    assert 8 * STEPS - 2 * HORIZON <= found.segments.starts[-1] < 8 * STEPS - HORIZON
    assert not found.valid[count // 2 : count // 2 + warm_up].any()
    assert found.valid.sum() == (count - warm_up) * HORIZON


@SEEN
def test_they_contain_what_was_logged_and_commanded(lost: tuple[Signal, ...]):
    run, found = WHOLE.trajectory, observed_segments(QUADRUPED, lacking(WHOLE, lost))
    segments = found.segments

    assert segments.horizon == HORIZON
    assert segments.commands is run["commands"]
    assert set(segments.record) == set(segments.states)
    for number, k in enumerate(segments.starts):
        for signal, values in found.observed.items():
            np.testing.assert_array_equal(segments.states[signal][number], run[signal][k])
            np.testing.assert_array_equal(values[number], run[signal][k + 1 : k + HORIZON + 1])


@SEEN
def test_their_state_is_the_estimated_one(lost: tuple[Signal, ...]):
    run = lacking(trial(SimulatedRobot(QUADRUPED, gap=GAP)), lost)
    segments = observed_segments(QUADRUPED, run).segments
    estimated = estimated_states(run.trajectory, tuple(segments.states))

    for signal, values in segments.states.items():
        np.testing.assert_array_equal(values, estimated[signal][segments.starts])
    logged = run.trajectory["joint_positions"][segments.starts]
    assert np.any(segments.states["joint_positions"] != logged)


def test_where_the_base_was_seen_they_touch_nothing_that_was_not_observed_or_came_late():
    found = starts(lost_and_late(WHOLE))

    for first, last in ((60, 79), (149, 149)):
        assert np.all((found + HORIZON < first) | (found - LEAD > last))
    assert found.min() < 40
    assert found.max() > 160


def test_where_it_was_not_they_are_compared_up_to_a_late_step_and_where_observed():
    found = observed_segments(QUADRUPED, lost_and_late(lacking(WHOLE, BASE)))
    begins = found.segments.starts
    rows = begins[:, np.newaxis] + np.arange(1, HORIZON + 1)

    # What begins where the state is not known is left out; the command of step 149 stood longer.
    assert begins.tolist() == [k for k in range(0, STEPS - HORIZON, HORIZON) if k not in (60, 70)]
    late = (rows > 149) & (begins[:, np.newaxis] - LEAD <= 149)
    missing = (rows >= 60) & (rows < 80)
    np.testing.assert_array_equal(found.valid, ~late & ~missing)


@pytest.mark.parametrize(("lost", "fewest"), [((), 33), (BASE, 17)], ids=["seen", "unseen"])
def test_none_is_predicted_under_commands_that_are_not_known(lost: tuple[Signal, ...], fewest: int):
    found = starts(lacking(lacking(WHOLE, lost), ("commands",), slice(60, 62)))

    assert np.all((found + HORIZON < 60) | (found - LEAD > 61))
    assert len(found) >= fewest


@pytest.mark.parametrize("phase", [0, 7])
def test_a_log_that_is_late_every_twentieth_step_serves(phase: int):
    noisy = lacking(WHOLE, BASE)
    late = np.arange(STEPS) % 20 == phase
    late[0] = False
    run = replace(noisy.trajectory, late=late)

    valid = observed_segments(QUADRUPED, replace(noisy, trajectory=run)).valid
    assert valid.sum() >= STEPS // 10


def test_a_base_is_used_wherever_it_was_seen_for_long_enough():
    rare = observed_segments(QUADRUPED, lacking(WHOLE, ("joint_velocities",), slice(25, 190)))
    assert set(rare.observed) == set(STATE)
    assert len(rare.segments.starts) < MIN_BASE_SHARE * MAX_SEGMENTS

    first = observed_segments(QUADRUPED, lacking(WHOLE, BASE, slice(100, None)))
    assert set(first.observed) == set(STATE)
    assert first.segments.starts.max() + HORIZON < 100

    moment = lacking(lacking(WHOLE, BASE, slice(0, 100)), BASE, slice(130, None))
    assert set(observed_segments(QUADRUPED, moment).observed) == set(ONBOARD)


@pytest.mark.parametrize("steps", [16, 17, 40])
def test_a_short_trial_has_each_segment_once(steps: int):
    short = trial(SimulatedRobot(QUADRUPED), steps=steps)

    assert starts(short).tolist() == list(range(LEAD, steps - HORIZON))
    unseen = starts(lacking(short, BASE)).tolist()
    assert unseen == list(range(0, steps - HORIZON, HORIZON))


def test_a_trial_without_a_usable_segment_is_refused_by_what_it_lacks():
    late = replace(WHOLE.trajectory, late=np.arange(STEPS) > 0)
    # All of it is seen at some time, and together after five steps only.
    blinking = lacking(WHOLE, (*BASE, "base_orientation"), slice(6, None))
    numb = lacking(WHOLE, (*BASE, "base_angular_velocity"))
    mute = with_value(numb, "commands", slice(None), 3, np.nan)
    refused = {
        "16 steps or more.* and the trial has 15: leave": trial(
            SimulatedRobot(QUADRUPED), steps=15
        ),
        "without late steps, .* the log has no such segment": replace(WHOLE, trajectory=late),
        r"3\.mcap: .* the log has no such segment: leave": blinking,
        f"never has base_angular_velocity, commands of {WHOLE.trajectory.names.motors[3]}": mute,
    }
    for message, tried in refused.items():
        with pytest.raises(InputError, match=message):
            observed_segments(QUADRUPED, tried)


@SEEN
def test_a_hinge_without_an_encoder_is_unknown_and_the_others_are_used(lost: tuple[Signal, ...]):
    run = lacking(WHOLE, lost)
    found = observed_segments(QUADRUPED, without_encoders(run, [3]))

    assert np.isnan(found.segments.states["joint_positions"][:, 3]).all()
    assert set(np.diff(found.segments.starts)) == {HORIZON}
    assert found.valid.all()
    assert set(found.observed) == set(observed_segments(QUADRUPED, run).observed)
    for signal in ("joint_positions", "joint_velocities"):
        assert found.compared[signal].all(axis=(0, 1)).tolist() == [k != 3 for k in range(8)]


def test_an_encoder_that_was_lost_late_costs_only_the_segments_after():
    found = observed_segments(QUADRUPED, without_encoders(WHOLE, [3], slice(100, None)))

    assert found.segments.starts.max() + HORIZON < 100
    assert all(np.isfinite(values).all() for values in found.segments.states.values())


@pytest.mark.parametrize(("steps", "least", "most"), [(1000, 1.0, 1.0), (60, 5.0, 10.0)])
def test_segments_of_a_long_trial_share_no_step_and_those_of_a_short_one_do(
    steps: int, least: float, most: float
):
    found = observed_segments(QUADRUPED, trial(SimulatedRobot(QUADRUPED), steps=steps))

    assert least <= SegmentErrors(QUADRUPED, [found], 1).overlap <= most
