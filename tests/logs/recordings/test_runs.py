"""A clock that restarts makes several runs, of which one is imported, and never a mixture."""

import json
from itertools import chain
from pathlib import Path

import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.robot.robot import Robot
from tests.logs.recordings.bags import T0, joint_state, write_bag, write_ros1
from tests.logs.recordings.conftest import JOINTS, JOINTS_ONLY, imported
from tests.logs.recordings.table_files import MAPPING as OF_TABLE, columns, write_npz


def test_a_table_of_two_runs_is_refused_until_one_is_chosen(biped: Robot, tmp_path: Path):
    first, second = columns(80), columns(60)
    both = {name: np.concatenate([first[name], second[name] + (name != "time")]) for name in first}
    path = write_npz(tmp_path / "t.npz", both)

    with pytest.raises(InputError, match=r"t\.npz: .* 2 runs of 0\.395, 0\.295 s: .*--run 1"):
        imported(path, biped, OF_TABLE)
    with pytest.raises(InputError, match=r"2 runs of .* got --run 3"):
        imported(path, biped, OF_TABLE, 3)
    for run, rows in ((1, first), (2, {name: column + 1 for name, column in second.items()})):
        alone = imported(write_npz(tmp_path / f"{run}.npz", rows), biped, OF_TABLE).trajectory
        found = imported(path, biped, OF_TABLE, run)
        for signal, values in alone.signals.items():
            np.testing.assert_array_equal(found.trajectory[signal], values)
        assert json.loads(found.facts()["topics"])["table"]["messages"] == len(rows["time"])
        assert (
            found.notes[0] == f"the clock restarts: this is run {run} of 2 runs of 0.395, 0.295 s"
        )
    with pytest.raises(InputError, match=r"1\.npz: its clock does not restart"):
        imported(tmp_path / "1.npz", biped, OF_TABLE, 2)


@pytest.mark.parametrize(("rare", "ros1"), [(True, False), (False, False), (False, True)])
def test_every_topic_of_a_bag_has_its_own_part_of_a_run(
    *, rare: bool, ros1: bool, biped: Robot, tmp_path: Path
):
    """The clock of a simulation restarts; a rare topic has too few messages to show it."""
    every = 40 if rare else 2
    runs = [
        [
            item
            for k in range(steps)
            for item in [
                ("/joint_states", k * 5_000_000, joint_state(0, JOINTS, [number + k / 1000] * 4)),
                ("/commands", k * 5_000_000 + 1, joint_state(0, JOINTS, [number + k / 100] * 4)),
            ]
            if item[0] == "/joint_states" or k % every == 0
        ]
        for number, steps in ((0, 200), (10, 300))
    ]
    # The writer sorts by log time: the runs are files of one bag.
    bag = tmp_path / "bag"
    bag.mkdir()
    for number, items in enumerate(runs):
        (file,) = write_bag(tmp_path / f"{number}", items).glob("*.mcap")
        file.rename(bag / f"part_{number}.mcap")
    if ros1:
        bag = write_ros1(tmp_path / "a.bag", chain(*runs), key=lambda _: 0)

    with pytest.raises(InputError, match=r"2 runs of 0\.995, 1\.495 s"):
        imported(bag, biped, JOINTS_ONLY)
    for run, low in ((1, 0), (2, 10)):
        found = imported(bag, biped, JOINTS_ONLY, run).trajectory
        for signal in ("joint_positions", "commands"):
            values = found[signal][:, 0]
            assert low <= values.min() <= values.max() < low + 4
        assert found.steps == (100 if run == 1 else 150)


@pytest.mark.parametrize(
    "change", ["late rows", "swapped parts", "backwards", "one wrong time", "in absolute time"]
)
def test_a_clock_that_does_not_restart_has_one_run(change: str, biped: Robot, tmp_path: Path):
    rows = columns(80)
    order = np.arange(80)
    match change:
        case "late rows":
            order = np.r_[0:30, 38:46, 30:38, 46:75, 76:80, 75]
        case "swapped parts":
            order = np.r_[40:80, 0:40]
        case "backwards":
            order = order[::-1]
        case "one wrong time":
            rows["time"][40] = 0.9
        case "in absolute time":
            rows["time"] = np.r_[rows["time"][:40], rows["time"][40:] + 100] + 1.7e9
    path = write_npz(tmp_path / "t.npz", {name: column[order] for name, column in rows.items()})

    assert imported(path, biped, f"duration = 0.1\n{OF_TABLE}").trajectory.steps == 10


def test_runs_of_the_time_stamps_are_found_too(biped: Robot, tmp_path: Path):
    """The robot's computer set its clock back by 20 s, the recording one did not."""
    items = []
    for k in range(400):
        stamp = T0 + k * 5_000_000 - (20 * 10**9 if k >= 150 else 0)
        state = joint_state(stamp, JOINTS, [k / 1000] * 4)
        items += [(topic, T0 + k * 5_000_000, state) for topic in ("/joint_states", "/commands")]
    path = write_ros1(tmp_path / "a.bag", items)

    with pytest.raises(InputError, match=r"2 runs of 0\.745, 1\.245 s"):
        imported(path, biped, JOINTS_ONLY)
    assert imported(path, biped, JOINTS_ONLY, 2).trajectory["joint_positions"][0, 0] == 0.15
    assert imported(path, biped, f'clock = "log"\n{JOINTS_ONLY}').trajectory.steps == 200
