"""Promises of ``sensor-series`` and ``paper-sensors``: scale, time, chaos, and what is unknown."""

import numpy as np
import pytest

from selfmodel.comparators import PAPER_SENSORS, SENSOR_SERIES
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.errors import InputError
from selfmodel.trials.trajectory import Trajectory
from tests.helpers.comparators import distances_of
from tests.helpers.gaits import TROT, batch, changed, gait, logged

BOTH = [SENSOR_SERIES, PAPER_SENSORS]


def disturbed(start: int, stop: int) -> Trajectory:
    """The walk, its legs somewhere else for a while."""
    joints = gait()["joint_positions"].copy()
    joints[start:stop] += 0.3
    return changed(gait(), joint_positions=joints)


def test_the_unit_of_a_column_does_not_matter():
    factor = 180 / np.pi
    walking, trot = gait(swing=0.8), gait(TROT, swing=0.8)

    def scaled(run: Trajectory) -> Trajectory:
        return changed(run, joint_positions=run["joint_positions"] * factor)

    plain = distances_of(SENSOR_SERIES.prepare(logged(walking)), batch(trot))
    in_other_units = distances_of(
        SENSOR_SERIES.prepare(logged(scaled(walking))), batch(scaled(trot))
    )

    np.testing.assert_allclose(in_other_units, plain, rtol=1e-9)


@pytest.mark.parametrize("comparator", BOTH)
def test_no_difference_is_too_large_to_be_bounded(comparator: Comparator):
    walking = gait()
    away = changed(
        walking,
        **{
            signal: walking[signal] + 1e6
            for signal in ("sensors", "joint_positions", "base_position")
        },
    )
    # A still column has no spread to be scaled by, and all of the motion is far away.
    assert 0 < distances_of(comparator.prepare(logged(walking)), batch(away))[0] <= 1


def test_early_steps_count_more_than_late_ones():
    trial = logged(gait())
    early, middle, late = distances_of(
        SENSOR_SERIES.prepare(trial),
        batch(disturbed(100, 150), disturbed(500, 550), disturbed(900, 950)),
    )

    assert early > 2 * middle > 4 * late > 0


def test_a_stride_that_begins_a_little_late_is_nearly_the_same():
    little, much, trot = distances_of(
        SENSOR_SERIES.prepare(logged(gait())), batch(gait(late=0.1), gait(late=0.3), gait(TROT))
    )

    assert little < 0.1 * trot
    assert much > trot


@pytest.mark.parametrize("comparator", BOTH)
def test_a_log_with_nothing_to_compare_is_refused(comparator: Comparator):
    walking = gait()
    nothing = {signal: np.full_like(walking[signal], np.nan) for signal in walking.signals}

    with pytest.raises(InputError, match="needs at least one of"):
        comparator.prepare(logged(changed(walking, **nothing)))


def test_the_papers_sensors_are_the_readings_and_the_displacement():
    trial = logged(gait())
    further = gait()["base_position"] * 1.5
    joints = gait()["joint_positions"] + 1

    assert set(PAPER_SENSORS.prepare(trial).request.record) == {"sensors", "base_position"}
    windows = SENSOR_SERIES.prepare(trial).losses(batch(gait())).shape[1]
    losses = PAPER_SENSORS.prepare(trial).losses(
        batch(changed(gait(), base_position=further), changed(gait(), joint_positions=joints))
    )
    assert losses.shape == (2, windows + 1)
    assert np.all(losses[0, :-1] == 0)
    assert losses[0, -1] > 0
    assert np.all(losses[1] == 0)
