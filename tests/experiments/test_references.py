"""Promises of reference trajectories: from logs, tables and controllers, with their errors."""

from pathlib import Path

import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.experiments.references import read_reference, simulated_reference
from selfmodel.logs.physical_trial import run_trial
from selfmodel.logs.records import TrialHeader
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.recovery.scores.tracking import Reference
from selfmodel.settings import Settings
from selfmodel.trials.trial import TrialPlan
from tests.helpers.drivers import random_cpgs
from tests.helpers.robots.arms import arm

(DRIVER,) = random_cpgs(arm(), 1)


def same(first: Reference, second: Reference) -> bool:
    return (
        first.hinges == second.hinges
        and np.array_equal(first.time, second.time)
        and np.array_equal(first.positions, second.positions)
    )


def test_the_reference_of_a_log_is_the_motion_of_its_robot(tmp_path: Path):
    path = tmp_path / "walk.mcap"
    plan = TrialPlan("walk", "single", DRIVER, 40, seed=0)
    run_trial(SimulatedRobot(arm()), plan, path, arm(), TrialHeader(Settings()))
    assert same(read_reference(path, arm()), simulated_reference(arm(), DRIVER, 40))


@pytest.mark.process
def test_the_reference_of_a_table_has_its_joints_from_its_first_time_on(tmp_path: Path):
    wanted = simulated_reference(arm(), DRIVER, 40)
    path = tmp_path / "walk.npz"
    joints = dict(zip(wanted.hinges, wanted.positions.T, strict=True))
    np.savez(path, time=wanted.time, **joints, temperature=np.ones(40))
    assert same(read_reference(path, arm()), wanted)
    csv = tmp_path / "part.csv"
    csv.write_text("time,joint2,other\n5.0,0.5,1\n5.5,0.75,2\n")
    part = read_reference(csv, arm())
    assert (part.hinges, part.time.tolist()) == (("joint2",), [0.0, 0.5])
    assert part.positions.tolist() == [[0.5], [0.75]]


@pytest.mark.process
@pytest.mark.parametrize(
    ("name", "text", "sentence"),
    [
        ("a.csv", "t,joint2\n0,0\n1,0\n", "expected a column time.*got t, joint2: rename"),
        ("a.csv", "time,elbow\n0,0\n1,0\n", "names of joints of robot.*got time, elbow"),
        ("a.csv", "time,joint2\n1,0\n0,0\n", "a.csv: the time .* strictly increasing"),
        ("a.txt", "", "expected a log .* or a table"),
    ],
)
def test_a_file_that_is_no_reference_is_refused(
    tmp_path: Path, name: str, text: str, sentence: str
):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InputError, match=sentence):
        read_reference(path, arm())
