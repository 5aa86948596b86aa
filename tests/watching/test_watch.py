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
    assert any(joint in name for name in last.shown_by)
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


@pytest.mark.parametrize("signal", ["base_orientation", "commands"])
def test_steps_that_lack_a_signal_are_not_judged(watch: Watch, healthy: list[Sample], signal: str):
    lost = {signal: np.full_like(healthy[0].values[signal], np.nan)}
    blind = [replace(one, values={**one.values, **lost}) for one in healthy[200:400]]
    said = findings(watch, [*healthy[:200], *blind])

    assert [found.status for found in said] == ["watching", "not judged"]
    assert said[-1].reason == f"{signal} was not observed"


def test_an_encoder_that_is_lost_is_no_change(watch: Watch, healthy: list[Sample]):
    only = np.where(np.arange(8) == 2, np.nan, 1.0)
    joints = ("joint_positions", "joint_velocities")
    lost = [
        replace(one, values={**one.values, **{name: only * one.values[name] for name in joints}})
        for one in healthy[200:500]
    ]

    assert [found.status for found in findings(watch, [*healthy[:200], *lost])] == ["watching"]


def test_a_robot_without_odometry_is_watched_by_its_onboard_sensors(
    quadruped: Robot, healthy: list[Sample]
):
    unknown = {name: np.full(3, np.nan) for name in ("base_position", "base_linear_velocity")}
    seen, failed = (
        [replace(one, values={**one.values, **unknown}) for one in samples]
        for samples in (healthy, stream(quadruped, "jam:back_right_knee=0.3", BEFORE + 200))
    )
    watch = Watch(quadruped, trial_of(quadruped, seen), kinds="body", calibrate=False)
    *_, last = findings(watch, [*seen[:BEFORE], *failed[BEFORE:]])

    assert last.status == "explained"
    assert str(last.remaining[0].hypothesis).startswith("jam:back_right_knee")


def test_healthy_trials_that_are_too_short_are_refused(quadruped: Robot, healthy: list[Sample]):
    with pytest.raises(InputError, match=r"healthy trials of 7 s or more together.*record more"):
        Watch(quadruped, trial_of(quadruped, healthy[:600]), calibrate=False)
