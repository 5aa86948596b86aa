"""Promises of the stretches that calibration predicts: what is known all along, and no more."""

from dataclasses import replace

import numpy as np
import pytest

from selfmodel.behaviour import Signal, collect
from selfmodel.estimate import BASE, ONBOARD, STATE
from selfmodel.physical import SimulatedRobot
from selfmodel.playback import played_back
from selfmodel.stretches import HORIZON, LEAD, SEGMENTS, Stretches, cut
from selfmodel.tasks import ROBOTS
from selfmodel.trial import Plan, Trial
from tests.conftest import random_motion

STEPS = 203
QUADRUPED = ROBOTS["quadruped"].robot()


@pytest.fixture(scope="module")
def whole() -> Trial:
    """A trial without noise, all of it observed."""
    driver = played_back(QUADRUPED.anatomy.motors, random_motion(QUADRUPED, STEPS, 3))
    behaviour = collect(QUADRUPED.anatomy.names, SimulatedRobot(QUADRUPED).run(driver, STEPS))
    return Trial(Plan("made-up", "before", driver, STEPS, 0), QUADRUPED.name, behaviour, "a.mcap")


def lacking(trial: Trial, signals: tuple[Signal, ...], steps: slice = slice(None)) -> Trial:
    """The trial with signals that were not observed at some steps."""
    run = trial.behaviour
    lost = {signal: run[signal].copy() for signal in signals}
    for values in lost.values():
        values[steps] = np.nan
    return replace(trial, behaviour=replace(run, signals={**run.signals, **lost}))


def starts(found: Stretches) -> np.ndarray:
    past = found.segments.past
    assert past is not None
    return past.starts


def test_where_the_base_was_seen_they_are_spread_over_the_trial_with_all_of_the_state(whole: Trial):
    found = cut(whole)

    assert len(starts(found)) == SEGMENTS
    assert (starts(found)[0], starts(found)[-1]) == (LEAD, STEPS - 1 - HORIZON)
    assert set(found.segments.states) == set(found.observed) == set(STATE)


@pytest.mark.parametrize("lost", [BASE, BASE[:1], BASE[1:]], ids=["both", "place", "velocity"])
def test_where_it_was_not_they_follow_each_other_from_the_start_on(
    whole: Trial, lost: tuple[Signal, ...]
):
    found = cut(lacking(whole, lost))

    np.testing.assert_array_equal(starts(found), np.arange(0, STEPS - HORIZON, HORIZON))
    assert set(found.segments.states) == set(found.observed) == set(ONBOARD)


@pytest.mark.parametrize("lost", [(), BASE], ids=["seen", "unseen"])
def test_they_say_what_was_logged_and_commanded(whole: Trial, lost: tuple[Signal, ...]):
    run, found = whole.behaviour, cut(lacking(whole, lost))

    for number, k in enumerate(starts(found)):
        for signal, values in found.observed.items():
            np.testing.assert_array_equal(found.segments.states[signal][number], run[signal][k])
            np.testing.assert_array_equal(values[number], run[signal][k + 1 : k + HORIZON + 1])
        before, after = np.split(found.segments.commands[number], [LEAD])
        np.testing.assert_array_equal(after, run["commands"][k : k + HORIZON])
        np.testing.assert_array_equal(
            before[max(LEAD - k, 0) :], run["commands"][max(k - LEAD, 0) : k]
        )
        assert not before[: max(LEAD - k, 0)].any()


@pytest.mark.parametrize("lost", [(), BASE], ids=["seen", "unseen"])
def test_none_touches_what_was_not_observed_or_came_late(whole: Trial, lost: tuple[Signal, ...]):
    late = np.arange(STEPS) == 150
    trial = lacking(lacking(whole, lost), ("joint_velocities",), slice(60, 80))
    found = starts(cut(replace(trial, behaviour=replace(trial.behaviour, late=late))))

    for first, last in ((60, 79), (149, 149)):
        assert np.all((found + HORIZON < first) | (np.maximum(found - LEAD, 0) > last))
    assert found.min() < 40
    assert found.max() > 160


def test_a_base_that_was_seen_for_a_while_is_used_then(whole: Trial):
    found = cut(lacking(whole, BASE, slice(100, None)))

    assert set(found.observed) == set(STATE)
    assert starts(found).max() + HORIZON < 100
