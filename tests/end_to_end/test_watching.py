"""The streams, other methods and tables of benchmarks/watching."""

import dataclasses
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from benchmarks.foreign.cases import Fault
from benchmarks.rows import read_rows
from benchmarks.watching.monitors import METHODS, Scores
from benchmarks.watching.rivals import HOLD, alarms, parts_of
from benchmarks.watching.streams import FAULTS, Machine, drawn
from benchmarks.watching.tables import table

DATA = Path(__file__).parents[2] / "docs" / "results" / "data"
ROWS, RIVALS = DATA / "watching.jsonl", DATA / "watching-rivals.jsonl"


@cache
def trials_of(machine: Machine):
    """Returns short healthy trials, a stream for each half of the work."""
    return [machine.trial(name, 12.0, 3.0) for name in ("fitted", "seen")]


@pytest.mark.search
def test_a_stream_is_that_of_a_healthy_robot_until_the_onset_and_the_joint_jams_then():
    machine = Machine("quadruped", "moderate", 0)
    healthy, failed = (
        machine.trial("same", 1.6, 0.5, faults=faults, onset=1.0).trajectory
        for faults in ((), (Fault("jam", "back_left_knee", float("nan")),))
    )
    knee = failed.names.hinges.index("back_left_knee")

    assert np.array_equal(healthy["commands"], failed["commands"])
    assert np.array_equal(healthy["base_position"][:100, 0], failed["base_position"][:100, 0])
    assert (
        np.ptp(failed["joint_positions"][102:, knee])
        < 0.04
        < np.ptp(healthy["joint_positions"][102:, knee])
    )


@pytest.mark.parametrize("case", FAULTS)
def test_a_fault_is_at_the_part_of_its_notation(case: str):
    fault, notation = drawn("hexapod", case, np.random.default_rng(0))

    assert fault.part in notation
    assert notation.startswith(f"{case}:")


def test_the_table_counts_alarms_per_hour_and_a_fault_that_is_not_seen_is_the_latest():
    rows = read_rows(ROWS)
    faults = [row for row in rows if row["command"] == "faults" and row["case"] == "break"]
    unseen = {**faults[0], "alarm": None, "status": "watching", "named": [], "right": False}
    healthy = [row for row in rows if row["command"] == "healthy"]
    alarmed = [{**row, "alarms": [[1.0, "a"]] * 2, "judged": 600.0} for row in healthy[:1]]

    assert "inf" in table([*faults, unseen])
    assert "12.00 (1.45 to 43.35)" in table(alarmed)


@pytest.mark.search
@pytest.mark.parametrize("name", [name for name in METHODS if name != "Mahalanobis"])
def test_a_score_of_another_method_is_of_its_step_and_of_earlier_ones_alone(name: str):
    machine = Machine("quadruped", "moderate", 0)
    fitted, seen = trials_of(machine)
    scorer = METHODS[name].fitted(machine, [fitted])
    start = dataclasses.replace(seen, trajectory=seen.trajectory.first(700))

    whole, part = scorer(seen), scorer(start)

    assert part.steps[-1] <= 699
    assert np.isfinite(whole.values).all()
    assert np.array_equal(whole.steps[: len(part.steps)], part.steps)
    assert np.allclose(whole.values[: len(part.values)], part.values, rtol=1e-9)


@pytest.mark.search
@pytest.mark.parametrize("name", ["tracking error", "multiple models"])
def test_a_joint_that_does_not_follow_its_command_has_the_largest_score(name: str):
    machine = Machine("quadruped", "moderate", 0)
    fitted, seen = trials_of(machine)
    names, signals = seen.trajectory.names, dict(seen.trajectory.signals)
    knee = names.hinges.index("front_right_knee")
    for signal in ("joint_positions", "joint_velocities"):
        signals[signal] = signals[signal].copy()
        signals[signal][600:, knee] = 0.0
    failed = dataclasses.replace(
        seen, trajectory=dataclasses.replace(seen.trajectory, signals=signals)
    )

    scorer = METHODS[name].fitted(machine, [fitted])
    ratios = scorer(failed).values[-1] / scorer(seen).values.max(axis=0)

    assert scorer(failed).parts[int(ratios.argmax())] == "front_right_knee"
    assert ratios.max() > 1.0


def test_an_alarm_names_the_part_with_the_largest_ratio_and_comes_again_after_the_hold():
    values = np.zeros((1200, 2))
    values[100:, 0], values[100:, 1] = 1.5, 2.0
    scores = Scores(np.arange(1200), values, ("hip", "knee"))

    assert alarms(scores, 2.0, 0.01) == [
        (1.0, "knee"), (1.0 + HOLD, "knee"), (1.0 + 2 * HOLD, "knee")
    ]  # fmt: skip
    assert alarms(scores, 2.1, 0.01) == []


def test_of_a_lost_limb_each_joint_that_is_lost_is_right_and_of_a_jam_its_own_alone():
    lost = parts_of("quadruped", "break:front_left_shoulder")

    assert {"front_left_shoulder", "front_left_knee"} <= {*lost}
    assert parts_of("quadruped", "motor:front_left_shoulder=0.5") == ("front_left_shoulder",)


def test_the_table_of_other_methods_has_the_watches_of_their_robots_and_what_they_miss_is_late():
    rows, watches = read_rows(RIVALS), read_rows(ROWS)
    row = next(row for row in rows if row["method"] == "tracking error")
    oracle = row["thresholds"]["oracle"]
    fault = {"onset": 10.0, "early": 1, "right": True}
    seen = {case: {**fault, "delay": 0.5} for case in FAULTS[:3]}
    judged = {**oracle, **seen, FAULTS[3]: {**fault, "delay": None, "right": False}}
    made = {**row, "thresholds": {"healthy": judged, "oracle": judged}}

    lines = table([made, *watches]).splitlines()

    assert any(line.startswith("| `watch` |") for line in lines)
    line = next(line for line in lines if line.startswith("| tracking error | oracle"))
    cells = [cell.strip() for cell in line.strip("|").split("|")]
    assert cells[2] == f"{4 / (10 / 60 + 40 / 3600):.1f}"
    assert cells[3:8] == ["0.50", "0.50", "0.50", "0.50", "—"]
    assert cells[-2] == "1"
