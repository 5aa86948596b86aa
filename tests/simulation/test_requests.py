"""Tests of requests: one cut of segments, with the commands before each."""

import numpy as np

from selfmodel.simulation.requests import LEAD, command_steps, cut_segments
from tests.helpers.gaits import gait

HORIZON = 4
STARTS = np.array([0, 2, 40])


def test_segments_begin_in_the_state_at_their_start_and_continue_under_the_logged_commands():
    run = gait()
    states = {"joint_positions": run["joint_positions"]}
    segments = cut_segments(run, states, STARTS, HORIZON, ("sensors",))

    np.testing.assert_array_equal(
        segments.states["joint_positions"], run["joint_positions"][STARTS]
    )
    assert (segments.lead, segments.horizon, segments.record) == (LEAD, HORIZON, ("sensors",))
    for start, commands in zip(STARTS, segments.commands, strict=True):
        np.testing.assert_array_equal(commands[LEAD:], run["commands"][start : start + HORIZON])
        logged = run["commands"][max(start - LEAD, 0) : start]
        np.testing.assert_array_equal(commands[LEAD - len(logged) : LEAD], logged)
        assert not commands[: LEAD - len(logged)].any()


def test_all_commands_of_the_trial_are_the_past_of_its_segments():
    run = gait()
    segments = cut_segments(run, {}, STARTS, HORIZON, ("sensors",))

    assert segments.past is not None
    assert segments.past.commands is run["commands"]
    np.testing.assert_array_equal(segments.past.starts, STARTS)


def test_steps_before_the_trial_are_negative():
    assert command_steps(np.array([1]), 2).tolist() == [[*range(1 - LEAD, 3)]]
