"""Promises of ``gait-pattern``: it sees what a gait is like, and not when a stride begins."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from selfmodel.comparators import GAIT_PATTERN
from selfmodel.comparators.gait_pattern import LARGE_DIFFERENCES
from selfmodel.testing import check_comparator
from selfmodel.trials.trajectory import Trajectory
from tests.helpers.comparators import distances_of
from tests.helpers.gaits import TROT, WALK, batch, changed, gait, logged

GROUP = list(LARGE_DIFFERENCES)


@settings(max_examples=8)
@given(
    frequency=st.floats(1.2, 2.5), late=st.floats(0.0, 1.0), phases=st.permutations(WALK).map(tuple)
)
def test_when_the_strides_begin_does_not_matter(
    frequency: float, late: float, phases: tuple[float, ...]
):
    trial = logged(gait(phases, frequency=frequency))
    same, slower = (
        gait(phases, frequency=frequency, late=late),
        gait(phases, frequency=frequency - 0.3, late=late),
    )

    shifted, other = distances_of(GAIT_PATTERN.prepare(trial), batch(same, slower))

    # A reading comes on at a step, so a duty is known to a step in a stride.
    assert shifted < 0.035
    assert shifted < other / 3


@pytest.mark.parametrize(
    ("group", "different"),
    [
        ("duty", gait(duty=0.8)),
        ("sequence", gait((0.0, 0.75, 0.5, 0.25))),
        ("phase", gait(TROT)),
        ("rhythm", gait(frequency=2.5)),
        ("excursion", gait(swing=0.2)),
        ("posture", changed(gait(), joint_positions=gait()["joint_positions"] + 0.2)),
    ],
)
def test_each_group_sees_what_it_is_there_for(group: str, different: Trajectory):
    losses = GAIT_PATTERN.prepare(logged(gait())).losses(batch(gait(), different))
    by_group = losses.reshape(2, -1, len(LARGE_DIFFERENCES))

    assert np.all(by_group[0] == 0)
    assert np.all(by_group[1, :, GROUP.index(group)] > 0.2)


def still() -> Trajectory:
    """A robot that lies still, its feet in the air."""
    walking = gait()
    return changed(
        walking,
        sensors=np.zeros_like(walking["sensors"]),
        joint_positions=np.zeros_like(walking["joint_positions"]),
    )


@pytest.mark.parametrize("shown", [gait(), still(), gait(steps=30), gait(steps=2), gait(steps=1)])
def test_degenerate_trials_keep_the_contract(shown: Trajectory):
    runs = [shown, gait(TROT, steps=shown.steps), gait(frequency=3, steps=shown.steps)]
    if shown.steps == 1000:
        runs.append(still())

    check_comparator(GAIT_PATTERN, logged(shown), batch(*runs))


def test_a_robot_without_touch_is_compared_by_its_joints():
    walking = gait()
    unknown = changed(walking, sensors=np.full_like(walking["sensors"], np.nan))
    trial = logged(unknown)

    assert GAIT_PATTERN.prepare(trial).request.record == ("joint_positions",)
    same, trot = distances_of(GAIT_PATTERN.prepare(trial), batch(gait(late=0.2), gait(TROT)))
    assert same < trot / 10


def test_a_window_that_was_not_observed_does_not_dilute_the_others():
    walking, trot = gait(), gait(TROT)
    half = {
        signal: np.where(np.arange(1000)[:, np.newaxis] < 500, walking[signal], np.nan)
        for signal in ("sensors", "joint_positions")
    }

    whole = distances_of(GAIT_PATTERN.prepare(logged(walking)), batch(trot))
    part = distances_of(GAIT_PATTERN.prepare(logged(changed(walking, **half))), batch(trot))

    np.testing.assert_allclose(part, whole, rtol=0.1)
