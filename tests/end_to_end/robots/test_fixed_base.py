"""Commands on robots with a fixed base: an arm, and the quadruped on a stand."""

import shutil
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from tests.helpers.command import printed, refused, succeeds
from tests.helpers.robots.arms import arm_mjcf

pytestmark = [pytest.mark.process, pytest.mark.search]

KINDS = ("--kinds", "break,jam,motor,sensor")
SEARCH = ("--population", "12", "--generations", "3", *KINDS)


def run(folder: Path, *arguments: str) -> dict:
    return printed(*arguments, "--json", cwd=folder)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the MJCF of an arm and of a quadruped on a stand."""
    made = tmp_path_factory.mktemp("fixed")
    (made / "arm.xml").write_text(arm_mjcf())
    stand = files("selfmodel.tasks").joinpath("quadruped.xml").read_text()
    (made / "stand.xml").write_text(stand)
    (made / "stand.toml").write_text('base = "fixed"\n')
    return made


@pytest.mark.parametrize(
    ("robot", "fault"), [("arm", "motor:joint2=0.4"), ("stand", "jam:front_left_knee")]
)
def test_faults_are_found_in_the_logs_of_a_robot_with_a_fixed_base(
    folder: Path, robot: str, fault: str
):
    drive = (f"{robot}.xml", "--steps", "100", "--controller", "cpg", "--gap", "0.02")
    before, after = f"{robot}-before.mcap", f"{robot}-after.mcap"
    run(folder, "trial", *drive, "--stage", "before", "-o", before)
    run(folder, "trial", *drive, "--stage", "after", "--damage", fault, "-o", after)
    found = run(folder, "diagnose", before, after, *SEARCH)
    assert found["diagnosis"][0]["hypothesis"].split("=")[0] == fault.split("=", maxsplit=1)[0]


def test_a_log_of_a_stand_is_replayed_to_the_bit_drawn_and_calibrated(folder: Path):
    run(folder, "trial", "stand.xml", "--steps", "100", "-o", "exact.mcap")
    assert run(folder, "replay", "exact.mcap")["identical"]
    for command, out in (("calibrate", "stand-fit.xml"), ("render", "stand-film.png")):
        succeeds(command, "exact.mcap", "-o", out, cwd=folder)


def test_an_arm_with_a_weak_motor_follows_its_trajectory_better_than_before(folder: Path):
    found = run(
        folder,
        *("recover", "arm.xml", "--damage", "motor:joint2=0.4", "--score", "tracking"),
        *("--controller", "cpg", "--steps", "150", "--trials", "1", *KINDS, "--out", "recovery"),
        # The motion of seed 0 hardly needs the weak motor.
        *("--seed", "1", "--population", "30", "--generations", "8"),
    )
    assert found["correct"]
    score = found["score"]
    assert (score["name"], score["unit"], score["before"]) == ("tracking", "rad", 0)
    assert score["after"] < score["recovered"] < 0


def test_an_arm_learns_to_follow_a_table(folder: Path):
    time = np.arange(0, 3, 0.01)
    joints = {f"joint{n}": 0.3 * np.sin(2 * np.pi * time + n) for n in range(1, 7)}
    np.savez(folder / "wave.npz", time=time, **joints)
    found = run(
        folder,
        *("recover", "arm.xml", "--damage", "jam:joint3", "--score", "tracking"),
        *("--reference", "wave.npz", "--controller", "cpg", "--steps", "100", "--trials", "1"),
        *(*SEARCH, "--out", "wave"),
    )
    assert found["correct"]
    assert -1 < found["score"]["before"] < 0
    assert found["score"]["recovered"] < 0


def test_recover_names_the_score_of_a_fixed_base(folder: Path):
    said = "give --score tracking"
    refused("recover", "arm.xml", "--damage", "jam:joint3", said=said, cwd=folder)


def test_the_papers_comparator_refuses_a_fixed_base(folder: Path):
    run(folder, "trial", "arm.xml", "--steps", "100", "-o", "still.mcap")
    said = "is fixed: give the comparator segment-prediction"
    papers = ("--comparator", "forward-displacement")
    refused("diagnose", "still.mcap", *papers, said=said, cwd=folder)


def test_suite_run_recovers_arms_and_records_that_they_stayed_upright(folder: Path):
    shutil.rmtree(folder / "study", ignore_errors=True)
    found = run(
        folder,
        *("suite", "run", "--domains", "arm.xml", "--cases", "6", "--score", "tracking"),
        *("--controller", "cpg", "--steps", "100", "--trials", "1", *SEARCH, "--workers", "1"),
        *("--out", "study"),
    )
    (row,) = found["rows"]
    assert row["upright_best_trial"]
    assert row["before"] == 0 > row["after"]
