"""A watch is silent while the robot is healthy, and notices, dates and names a fault."""

import json
from dataclasses import replace

import numpy as np
import pytest

from selfmodel.diagnosis.losses import LossTable
from selfmodel.errors import InputError
from selfmodel.robot.robot import Robot
from selfmodel.trials.trajectory import Sample
from selfmodel.trials.trial import TrialPart
from selfmodel.watching import Finding, Watch, bank
from selfmodel.watching.bank import Bank
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


def test_a_log_that_ends_soon_after_a_change_is_answered_by_its_end(
    watch: Watch, quadruped: Robot, healthy: list[Sample]
):
    failed = stream(quadruped, "jam:back_right_knee=0.3", BEFORE + 54)[BEFORE:]
    *_, before = findings(watch, [*healthy[:BEFORE], *failed])
    last = watch.finish()[-1]

    assert (before.status, before.remaining) == ("changed", ())
    assert str(last.remaining[0].hypothesis).startswith("jam:back_right_knee")
    assert watch.finish() == ()


def test_a_watch_whose_segments_lack_a_signal_after_a_change_ends_and_says_so(
    watch: Watch, quadruped: Robot, healthy: list[Sample]
):
    failed = stream(quadruped, "jam:back_right_knee=0.3", BEFORE + 640)[BEFORE:]
    lost = {"base_orientation": np.full(4, np.nan)}
    blind = [replace(one, values={**one.values, **lost}) for one in failed[24:]]
    _, alarm, *_, last = findings(watch, [*healthy[:BEFORE], *failed[:24], *blind])

    assert (alarm.status, last.status) == ("changed", "unexplained")
    assert "base_orientation" in last.reason


def test_a_segment_in_which_all_simulations_diverge_is_left_out_alone(
    watch: Watch, quadruped: Robot, healthy: list[Sample], monkeypatch: pytest.MonkeyPatch
):
    of_table, added = LossTable.losses, list[object]()

    def losses(table: LossTable, some: list[object], parts: list[object]) -> np.ndarray:
        found = of_table(table, some, parts)  # type: ignore[arg-type]
        added.extend(part for part in parts if part not in added)
        bad = [k for k, part in enumerate(parts) if added.index(part) % 4 == 3]
        found[:, bad] = np.inf
        return found

    monkeypatch.setattr(LossTable, "losses", losses)
    compared, add = list[int](), Bank.add

    def counted(bank: Bank, part: TrialPart) -> None:
        compared.append(bank.segments)
        add(bank, part)

    monkeypatch.setattr(Bank, "add", counted)
    failed = stream(quadruped, "jam:back_right_knee=0.3", BEFORE + 400)[BEFORE:]
    *_, last = findings(watch, [*healthy[:BEFORE], *failed])

    assert last.status == "explained"
    assert str(last.remaining[0].hypothesis).startswith("jam:back_right_knee")
    assert len(compared) * 3 / 4 - max(compared) <= 2  # of each four, one says nothing


def test_causes_that_are_simulated_one_at_a_time_keep_up_with_the_segments(
    watch: Watch, quadruped: Robot, healthy: list[Sample], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(bank, "AT_ONCE", 1)
    failed = stream(quadruped, "jam:back_right_knee=0.3", BEFORE + 400)[BEFORE:]
    *_, last = findings(watch, [*healthy[:BEFORE], *failed])

    assert last.status == "explained"
    assert last.time < BEFORE * quadruped.control_timestep + 2.0  # 3.5 s at one in each step


def test_late_steps_of_healthy_trials_are_no_part_of_what_is_healthy(
    quadruped: Robot, healthy: list[Sample]
):
    trial = trial_of(quadruped, healthy)
    late = (np.arange(trial.trajectory.steps) > 600) & (np.arange(len(healthy)) % 12 == 5)
    disturbed = replace(trial, trajectory=replace(trial.trajectory, late=late))

    with pytest.raises(InputError, match=r"50 segments without late steps, got 4"):
        Watch(quadruped, disturbed, calibrate=False)


def test_healthy_trials_that_are_too_short_are_refused(quadruped: Robot, healthy: list[Sample]):
    with pytest.raises(InputError, match=r"healthy trials of 7 s or more together.*record more"):
        Watch(quadruped, trial_of(quadruped, healthy[:600]), calibrate=False)
