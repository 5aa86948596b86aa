"""A driver ended by signals at random moments: a sample of ``tests.end_to_end.stop_signals``."""

import pytest

from tests.end_to_end.stop_signals import endings


@pytest.mark.process
@pytest.mark.parametrize("watchdog", [None, 5.0])
def test_whenever_a_signal_comes_the_robot_is_stopped_last_and_the_log_verifies(
    watchdog: float | None,
):
    found = endings(2, seed=3, watchdog=watchdog)

    assert [one for one in found if one.fault] == []
