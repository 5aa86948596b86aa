"""A watch is silent while the robot is healthy, and notices, dates and names a fault."""

import json
from dataclasses import replace

import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.robot.robot import Robot
from selfmodel.trials.trajectory import Sample
from selfmodel.watching import Finding, Watch
from tests.watching.conftest import stream, trial_of

pytestmark = pytest.mark.search

BEFORE = 360
"""Healthy steps before a fault."""


def findings(watch: Watch, samples: list[Sample]) -> list[Finding]:
    return [found for sample in samples for found in watch.update(sample)]


def test_a_healthy_robot_is_watched_and_nothing_else_is_said(watch: Watch, quadruped: Robot):
    other = stream(quadruped, "intact", 600)

    assert [found.status for found in findings(watch, other)] == ["watching"]


@pytest.mark.parametrize(
    ("fault", "joint"),
    [
        ("break:front_left_knee", ""),
        ("jam:back_right_knee=0.3", "back_right_knee"),
        ("motor:front_right_knee=0.3", "front_right_knee"),
        ("sensor:back_left_touch", "back_left_touch"),
    ],
)
def test_a_fault_is_noticed_dated_and_named(
    watch: Watch, quadruped: Robot, healthy: list[Sample], fault: str, joint: str
):
    failed = stream(quadruped, fault, BEFORE + 400)[BEFORE:]
    first, alarm, *_, last = findings(watch, [*healthy[:BEFORE], *failed])
    onset = BEFORE * quadruped.control_timestep

    assert (first.status, alarm.status, last.status) == ("watching", "changed", "explained")
    assert onset < alarm.time <= onset + 2.0
    assert alarm.earliest <= onset <= alarm.latest
    assert any(joint in name for name in alarm.shown_by)
    assert str(last.remaining[0].hypothesis).startswith(fault.partition("=")[0])
    assert json.loads(json.dumps(last.to_dict()))["remaining"][0]["hypothesis"].startswith(
        fault[:3]
    )
    assert last.remaining[0].hypothesis.words in str(last)


def test_nothing_is_said_after_a_cause_until_the_watch_begins_anew(
    watch: Watch, quadruped: Robot, healthy: list[Sample]
):
    failed = stream(quadruped, "jam:back_right_knee=0.3", 800)
    assert findings(watch, failed[:600])[-1].status == "explained"

    assert findings(watch, failed[600:]) == []
    watch.restart()
    assert [found.status for found in findings(watch, healthy[:200])] == ["watching"]


def test_a_gait_that_no_healthy_trial_has_is_not_judged(watch: Watch, quadruped: Robot):
    (found,) = findings(watch, stream(quadruped, "intact", 400, frequency=2.0))

    assert found.status == "not judged"
    assert "in the healthy trials at" in found.reason


def test_steps_without_the_state_are_not_judged(watch: Watch, healthy: list[Sample]):
    unknown = {"base_orientation": np.full(4, np.nan)}
    blind = [replace(one, values={**one.values, **unknown}) for one in healthy[200:400]]
    said = findings(watch, [*healthy[:200], *blind])

    assert [found.status for found in said] == ["watching", "not judged"]
    assert "base_orientation" in said[-1].reason


def test_healthy_trials_that_are_too_short_are_refused(quadruped: Robot, healthy: list[Sample]):
    with pytest.raises(InputError, match=r"healthy trials of 19 s or more together.*record more"):
        Watch(quadruped, trial_of(quadruped, healthy[:600]), calibrate=False)
