"""The streams and tables of benchmarks/watching."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.foreign.cases import Fault
from benchmarks.foreign.scoring import read_rows
from benchmarks.watching.streams import FAULTS, Machine, drawn
from benchmarks.watching.tables import table

ROWS = Path(__file__).parents[2] / "docs" / "results" / "data" / "watching.jsonl"


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
