"""Promises of the segments of calibration: known completely, and no more of them."""

from dataclasses import replace

import numpy as np
import pytest

from selfmodel.controllers.playback import played_back
from selfmodel.errors import InputError
from selfmodel.physical.gap import draw_gap
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.simulation.requests import LEAD
from selfmodel.simulation.segments import (
    HORIZON,
    MAX_SEGMENTS,
    MIN_BASE_SHARE,
    ObservedSegments,
    SegmentErrors,
    observed_segments,
)
from selfmodel.tasks import ROBOTS
from selfmodel.trials.behaviour import collect
from selfmodel.trials.estimation import BASE, ONBOARD, STATE, estimated_states
from selfmodel.trials.signals import Signal
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.drivers import random_motion
from tests.helpers.hostile import lacking, without_encoders

STEPS = 201
QUADRUPED = ROBOTS["quadruped"].robot()
GAP = draw_gap(QUADRUPED, 0.05, np.random.default_rng(0))


def trial(physical: SimulatedRobot, steps: int = STEPS) -> Trial:
    """A trial in which every joint moves."""
    driver = played_back(QUADRUPED.anatomy.motors, random_motion(QUADRUPED, steps, 3))
    behaviour = collect(QUADRUPED.anatomy.names, physical.run(driver, steps))
    return Trial(
        TrialPlan("made-up", "before", driver, steps, 0), QUADRUPED.name, behaviour, "a.mcap"
    )


@pytest.fixture(scope="module")
def whole() -> Trial:
    """A trial without noise, all of it observed."""
    return trial(SimulatedRobot(QUADRUPED))


def lost_and_late(whole: Trial) -> Trial:
    """One joint's velocity was not observed at steps 60 to 79, and step 150 came late."""
    velocities = whole.behaviour["joint_velocities"].copy()
    velocities[60:80, 0] = np.nan
    signals = {**whole.behaviour.signals, "joint_velocities": velocities}
    run = replace(whole.behaviour, signals=signals, late=np.arange(STEPS) == 150)
    return replace(whole, behaviour=run)


def starts(found: ObservedSegments) -> np.ndarray:
    past = found.segments.past
    assert past is not None
    return past.starts


def test_where_the_base_was_seen_they_are_spread_over_the_trial_with_all_of_the_state(whole: Trial):
    found = observed_segments(QUADRUPED, whole)

    assert len(starts(found)) == MAX_SEGMENTS
    assert (starts(found)[0], starts(found)[-1]) == (LEAD, STEPS - 1 - HORIZON)
    assert set(found.segments.states) == set(found.observed) == set(STATE)


@pytest.mark.parametrize("lost", [BASE, BASE[:1], BASE[1:]], ids=["both", "place", "velocity"])
def test_where_it_was_not_they_follow_each_other_from_the_start_on(
    whole: Trial, lost: tuple[Signal, ...]
):
    found = observed_segments(QUADRUPED, lacking(whole, lost))

    np.testing.assert_array_equal(starts(found), np.arange(0, STEPS - HORIZON, HORIZON))
    assert set(found.segments.states) == set(found.observed) == set(ONBOARD)


@pytest.mark.parametrize("lost", [(), BASE], ids=["seen", "unseen"])
def test_they_say_what_was_logged_and_commanded(whole: Trial, lost: tuple[Signal, ...]):
    run, found = whole.behaviour, observed_segments(QUADRUPED, lacking(whole, lost))

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
def test_all_that_they_say_can_be_recorded_and_they_know_what_was_commanded_before(
    whole: Trial, lost: tuple[Signal, ...]
):
    segments = observed_segments(QUADRUPED, lacking(whole, lost)).segments

    assert set(segments.record) == set(segments.states)
    assert segments.lead == LEAD
    assert segments.past is not None
    np.testing.assert_array_equal(segments.past.commands, whole.behaviour["commands"])


@pytest.mark.parametrize("lost", [(), BASE], ids=["seen", "unseen"])
def test_their_state_is_the_estimated_one(lost: tuple[Signal, ...]):
    run = lacking(trial(SimulatedRobot(QUADRUPED, gap=GAP)), lost)
    found = observed_segments(QUADRUPED, run)
    estimated = estimated_states(run.behaviour, tuple(found.segments.states))

    for signal, values in found.segments.states.items():
        np.testing.assert_array_equal(values, estimated[signal][starts(found)])
    assert np.any(
        found.segments.states["joint_positions"] != run.behaviour["joint_positions"][starts(found)]
    )


def test_where_the_base_was_seen_they_touch_nothing_that_was_not_observed_or_came_late(
    whole: Trial,
):
    found = starts(observed_segments(QUADRUPED, lost_and_late(whole)))

    for first, last in ((60, 79), (149, 149)):
        assert np.all((found + HORIZON < first) | (found - LEAD > last))
    assert found.min() < 40
    assert found.max() > 160


def test_where_it_was_not_they_are_judged_up_to_a_late_step_and_where_observed(whole: Trial):
    found = observed_segments(QUADRUPED, lost_and_late(lacking(whole, BASE)))
    begins = starts(found)
    rows = begins[:, np.newaxis] + np.arange(1, HORIZON + 1)

    # What begins where the state is not known is left out; the command of step 149 stood longer.
    assert begins.tolist() == [k for k in range(0, STEPS - HORIZON, HORIZON) if k not in (60, 70)]
    late = (rows > 149) & (begins[:, np.newaxis] - LEAD <= 149)
    missing = (rows >= 60) & (rows < 80)
    np.testing.assert_array_equal(found.valid, ~late & ~missing)


@pytest.mark.parametrize(("lost", "fewest"), [((), 33), (BASE, 17)], ids=["seen", "unseen"])
def test_none_is_predicted_under_commands_that_are_not_known(
    whole: Trial, lost: tuple[Signal, ...], fewest: int
):
    found = starts(
        observed_segments(QUADRUPED, lacking(lacking(whole, lost), ("commands",), slice(60, 62)))
    )

    assert np.all((found + HORIZON < 60) | (found - LEAD > 61))
    assert len(found) >= fewest


def test_a_log_that_is_late_every_twentieth_step_serves():
    noisy = lacking(trial(SimulatedRobot(QUADRUPED, gap=GAP)), BASE)
    for phase in range(20):
        late = np.arange(STEPS) % 20 == phase
        late[0] = False
        valid = observed_segments(
            QUADRUPED, replace(noisy, behaviour=replace(noisy.behaviour, late=late))
        ).valid

        assert valid.sum() >= STEPS // 10


def test_a_base_that_was_seen_is_looked_at_however_much_else_is_missing(whole: Trial):
    found = observed_segments(QUADRUPED, lacking(whole, ("joint_velocities",), slice(25, 190)))

    assert set(found.observed) == set(STATE)
    assert len(starts(found)) < MIN_BASE_SHARE * MAX_SEGMENTS


def test_a_base_that_was_seen_for_a_while_is_looked_at_then(whole: Trial):
    found = observed_segments(QUADRUPED, lacking(whole, BASE, slice(100, None)))

    assert set(found.observed) == set(STATE)
    assert starts(found).max() + HORIZON < 100


def test_a_base_that_was_seen_for_a_moment_is_not_looked_at(whole: Trial):
    found = observed_segments(
        QUADRUPED, lacking(lacking(whole, BASE, slice(0, 100)), BASE, slice(130, None))
    )

    assert set(found.observed) == set(ONBOARD)


@pytest.mark.parametrize("steps", [16, 17, 40])
def test_a_short_trial_has_each_segment_once(steps: int):
    whole = trial(SimulatedRobot(QUADRUPED), steps)

    assert starts(observed_segments(QUADRUPED, whole)).tolist() == list(
        range(LEAD, steps - HORIZON)
    )
    assert starts(observed_segments(QUADRUPED, lacking(whole, BASE))).tolist() == list(
        range(0, steps - HORIZON, HORIZON)
    )


def test_a_trial_that_is_too_short_is_refused():
    with pytest.raises(InputError, match=r"16 steps or more.* and the trial has 15: leave"):
        observed_segments(QUADRUPED, trial(SimulatedRobot(QUADRUPED), 15))


def test_a_trial_of_nothing_but_late_steps_is_refused(whole: Trial):
    run = replace(whole.behaviour, late=np.arange(STEPS) > 0)

    with pytest.raises(InputError, match=r"without late steps, .* the log has no such segment"):
        observed_segments(QUADRUPED, replace(whole, behaviour=run))


def test_a_trial_of_which_too_little_can_be_judged_is_refused(whole: Trial):
    """All of it is seen at some time, and together after five steps only."""
    blinking = lacking(whole, (*BASE, "base_orientation"), slice(6, None))

    with pytest.raises(InputError, match=r"the log has no such segment: leave"):
        observed_segments(QUADRUPED, blinking)


def test_what_was_never_observed_is_named_by_its_column_where_only_some_was_not(whole: Trial):
    run = lacking(whole, (*BASE, "base_angular_velocity")).behaviour
    commands = run["commands"].copy()
    commands[:, 3] = np.nan
    broken = replace(run, signals={**run.signals, "commands": commands})
    name = run.names.motors[3]

    with pytest.raises(InputError, match=f"never has base_angular_velocity, commands of {name}"):
        observed_segments(QUADRUPED, replace(whole, behaviour=broken))


@pytest.mark.parametrize("lost", [(), BASE], ids=["seen", "unseen"])
def test_a_hinge_without_an_encoder_is_unknown_and_the_others_are_used(
    whole: Trial, lost: tuple[Signal, ...]
):
    run = lacking(whole, lost)
    found = observed_segments(QUADRUPED, without_encoders(run, [3]))
    complete = observed_segments(QUADRUPED, run)

    assert np.isnan(found.segments.states["joint_positions"][:, 3]).all()
    assert set(np.diff(starts(found))) == {HORIZON}
    assert found.valid.all()
    assert set(found.observed) == set(complete.observed)
    for signal in ("joint_positions", "joint_velocities"):
        assert found.compared(signal).all(axis=(0, 1)).tolist() == [k != 3 for k in range(8)]


def test_an_encoder_that_was_lost_late_costs_only_the_segments_after(whole: Trial):
    found = observed_segments(QUADRUPED, without_encoders(whole, [3], slice(100, None)))

    assert starts(found).max() + HORIZON < 100
    assert all(np.isfinite(values).all() for values in found.segments.states.values())


@pytest.mark.parametrize(("steps", "least", "most"), [(1000, 1.0, 1.0), (60, 5.0, 10.0)])
def test_segments_of_a_long_trial_share_no_step_and_those_of_a_short_one_do(
    steps: int, least: float, most: float
):
    found = observed_segments(QUADRUPED, trial(SimulatedRobot(QUADRUPED), steps))

    assert least <= SegmentErrors(QUADRUPED, [found], 1).overlap <= most
