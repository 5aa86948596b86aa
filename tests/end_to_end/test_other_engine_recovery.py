"""Trials, recoveries and tables of the robots in PyBullet."""

import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="PyBullet is in the dependency group other-engine")

from benchmarks.other_engine.environment import BulletEnvironment, physical_robot
from benchmarks.other_engine.reality import draw_reality
from benchmarks.other_engine.recovery import recovered, table, transfer_lines
from selfmodel import read_log, run_trial
from selfmodel.logs import load_controller
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.tasks import ROBOTS

BANK = Path(__file__).parents[2] / "benchmarks" / "bank"


def test_a_trial_is_logged_and_read_back(quadruped: Robot, tmp_path: Path):
    with BulletEnvironment(quadruped, draw_reality(quadruped, 0)) as environment:
        physical = physical_robot(environment, quadruped)
        log = tmp_path / "walk.mcap"
        gait = load_controller(BANK / "quadruped-0.npz")
        trial = run_trial(physical, gait, log, robot=quadruped, steps=40)

    again = read_log(log).trial
    assert again.trajectory.steps == 40
    assert np.isfinite(trial.displacement)
    np.testing.assert_array_equal(
        again.trajectory["base_position"], trial.trajectory["base_position"]
    )


@pytest.mark.search
def test_a_recovery_is_a_row_of_the_table(tmp_path: Path):
    settings = Settings(steps=60, trials=1, generations=1).scaled(4)

    row = recovered("quadruped", 1, 0, tmp_path / "run", settings=settings, threads=1)

    row = json.loads(json.dumps(row))
    assert row["truth"] == "break:front_left_knee"
    assert [trial["stage"] for trial in row["trials"]] == ["before", "after", "recovery"]
    assert row["reality"]["masses"] == list(draw_reality(ROBOTS["quadruped"].robot(), 0).masses)
    simulated = [trial["simulated"] for trial in row["trials"]]
    assert simulated[1] is None
    assert np.isfinite([simulated[0], simulated[2]]).all()
    assert row["recovered"] == row["trials"][2]["displacement"]


@pytest.mark.search
def test_gaits_of_both_engines_are_a_table(quadruped: Robot):
    lines = list(transfer_lines(quadruped, [BANK / "quadruped-2.npz"], [0]))

    name, mujoco_walk, ideal, drawn = lines[2].strip("| ").split(" | ")
    assert name == "quadruped-2"
    assert 0.5 * float(mujoco_walk) < min(float(ideal), float(drawn))


def row(*, before: float, recovered: float, correct: bool) -> dict[str, object]:
    trial = {"stage": "recovery", "displacement": recovered, "simulated": 4.0, "upright": True}
    found = {"robot": "quadruped", "case": 2, "seconds": 1.0, "after": 0.0, "trials": [trial]}
    return {**found, "before": before, "recovered": recovered, "correct": correct}


def test_the_table_counts_an_error_as_a_wrong_diagnosis_and_no_recovery():
    failed = {"robot": "quadruped", "case": 2, "seconds": 1.0, "error": "the robot stopped"}
    rows = [
        row(before=4.0, recovered=2.0, correct=True),
        row(before=-1.0, recovered=3.0, correct=False),
        failed,
    ]

    line = table(rows).splitlines()[2]

    assert "| 3 | 1/3, 33 % (6 to 79) |" in line
    assert "| 0.25 (0 to 0.5) |" in line  # no ratio to a robot that went backwards
    assert "| 2/3, 67 %" in line
