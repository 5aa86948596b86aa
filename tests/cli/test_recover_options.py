"""Promises of `selfmodel recover` about repairs, searches, scores and falls."""

import json
from pathlib import Path

import pytest

from selfmodel.logs.repertoires import save_repertoire
from selfmodel.robot.robot import Robot
from tests.helpers.command import SMALL, printed, refused, selfmodel
from tests.helpers.drivers import random_repertoire


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--repair", "papers"), "unknown repair 'papers': did you mean paper"),
        (("--search", "cma"), "unknown search 'cma': did you mean cma-es"),
        (("--repair", "paper", "--search", "cma-es"), "leave --search and --repertoire out"),
        (("--search", "repertoire"), "got the search repertoire without a repertoire"),
        (("--repertoire", "none.npz"), "none.npz"),
        (("--score", "energy", "--max-joint-speed", "9"), "limits of --score upright, got energy"),
        (("--max-joint-torque", "3", "--reference", "none.csv"), "--reference is a trajectory"),
        (("--max-joint-torque", "0"), "expected --max-joint-torque above 0 N m, got 0: give the"),
        (("--max-joint-speed", "-1"), "expected --max-joint-speed above 0 rad/s, got -1: give the"),
        (
            ("--max-self-collision", "-0.01"),
            "--max-self-collision of 0 m or above, got -0.01: give",
        ),
        (("--score", "energy", "--max-self-collision", "0"), "limits of --score upright"),
        (("--score", "speed"), "score 'speed'"),
        (("--score", "math:pi"), "'math:pi' is no score"),
    ],
)
def test_a_name_that_is_unknown_is_refused_before_any_work(
    tmp_path: Path, options: tuple[str, ...], message: str
):
    run = ("recover", "quadruped", "--case", "1", *options, "--out", "run")
    refused(*run, said=message, cwd=tmp_path)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("options", "score"),
    [
        ((), "upright"),
        (("--max-joint-torque", "8"), "upright within 8 N m"),
        (("--repair", "paper"), "displacement"),
        (("--search", "ea", "--score", "selfmodel.recovery.scores:ENERGY"), "energy"),
    ],
)
def test_the_score_is_that_of_the_repair_unless_another_is_given(
    tmp_path: Path, options: tuple[str, ...], score: str
):
    found = printed(
        *("recover", "quadruped", "--case", "1", *SMALL, "--steps", "30", "--trials", "1"),
        *("--comparator", "forward-displacement", "--kinds", "paper", "--no-calibrate"),
        *("--gap", "0.05", *options, "--out", "run", "--json"),
        cwd=tmp_path,
    )

    assert found["score"]["name"] == score
    assert found["repair"] == ("paper" if "paper" in options else "robust")
    before, after, recovery = found["trials"]
    assert before["predicted_score"] is not None
    assert after["predicted_score"] is None
    assert recovery["predicted_score"] is not None
    assert recovery["steps"] == 30
    assert found["fell"] == (recovery["fell_at_step"] is not None)


def test_an_error_after_a_trial_names_the_folder_of_the_finished_trials(tmp_path: Path):
    text = """
from dataclasses import replace
from selfmodel.recovery import DISPLACEMENT

def of(robot, hypothesis, trajectory):
    values = DISPLACEMENT.of(robot, hypothesis, trajectory)
    return values if hypothesis.faults == () else values * float("nan")

HEALTHY_ONLY = replace(DISPLACEMENT, name="healthy-only", of=of)
"""
    (tmp_path / "my_scores.py").write_text(text)
    done = selfmodel(
        *("recover", "quadruped", "--case", "1", *SMALL, "--steps", "60", "--trials", "1"),
        *("--comparator", "forward-displacement", "--kinds", "paper", "--no-calibrate"),
        *("--repair", "paper", "--score", "my_scores:HEALTHY_ONLY", "--out", "run"),
        cwd=tmp_path,
    )
    told = " ".join(done.stderr.split())

    assert done.returncode == 2, told
    assert "the score 'my_scores:HEALTHY_ONLY': expected one number for each of" in told
    assert told.endswith("; the finished trials are in run")
    assert (tmp_path / "run" / "trials" / "01-after.mcap").exists()
    assert json.loads((tmp_path / "run" / "searches.json").read_text())


@pytest.fixture(scope="module")
def gaits(tmp_path_factory: pytest.TempPathFactory, quadruped: Robot) -> Path:
    """A small repertoire of the quadruped."""
    path = tmp_path_factory.mktemp("repertoire") / "gaits.npz"
    save_repertoire(path, random_repertoire(quadruped))
    return path


def test_a_recovery_begins_from_a_repertoire(tmp_path: Path, gaits: Path):
    run = (
        *("recover", "quadruped", "--case", "1", *SMALL, "--steps", "60", "--trials", "1"),
        *("--comparator", "forward-displacement", "--kinds", "paper", "--no-calibrate", "--json"),
    )
    found = [
        printed(*run, *options, "--out", name, cwd=tmp_path)
        for name, options in {"given": ("--repertoire", str(gaits)), "without": ()}.items()
    ]
    recovered = [one["trials"][2]["displacement"] for one in found]
    assert [one["search"] for one in found] == ["repertoire", "cma-es"]
    assert [one["repertoire"] is None for one in found] == [False, True]
    assert found[0]["repertoire"]["robot"] == "quadruped"

    assert recovered[0] != recovered[1]


@pytest.mark.parametrize(
    ("robot", "options", "message"),
    [
        ("hexapod", (), "expected a repertoire of hexapod"),
        (
            "quadruped",
            ("--controller", "cpg"),
            "expected gaits of the controllers to evolve, a cpg",
        ),
        ("quadruped", ("--search", "ea"), "got the search ea with a repertoire"),
        ("quadruped", ("--repair", "paper"), "leave --search and --repertoire out"),
    ],
)
def test_a_repertoire_that_the_recovery_cannot_use_is_refused(
    tmp_path: Path, gaits: Path, robot: str, options: tuple[str, ...], message: str
):
    run = ("recover", robot, "--case", "1", "--repertoire", str(gaits), *options, "--out", "run")
    refused(*run, said=message, cwd=tmp_path)
    assert not (tmp_path / "run").exists()
