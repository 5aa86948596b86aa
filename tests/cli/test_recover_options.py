"""Promises of `selfmodel recover` about repairs, searches, scores and falls."""

import json
from pathlib import Path

import pytest

from selfmodel.logs.repertoires import save_repertoire
from selfmodel.robot.robot import Robot
from tests.helpers.command import SMALL, printed, refused, selfmodel
from tests.helpers.drivers import random_repertoire
from tests.helpers.policies import save_policy


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, quadruped: Robot) -> Path:
    """A folder with a small repertoire and a policy of the quadruped."""
    folder = tmp_path_factory.mktemp("given")
    save_repertoire(folder / "gaits.npz", random_repertoire(quadruped))
    save_policy(folder, quadruped)
    return folder


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("quadrupd --case 1", "unknown robot 'quadrupd': did you mean quadruped?"),
        ("quadruped", "expected either --case N or --damage NOTATION, got neither"),
        ("quadruped --case 11", "unknown case of Table I '11'"),
        ("quadruped --case x", "case"),
        ("quadruped --case 1 --damage intact", "got both"),
        ("hexapod --damage break:front_left_hp", "did you mean front_left_hip"),
        ("hexapod --damage break", "cannot read the term 'break'"),
        ("hexapod --case 1 --repertoire gaits.npz", "expected a repertoire of hexapod"),
        ("quadruped --controller cpg --case 10", "neuron:0 does not apply to a CPG"),
        *(
            (f"quadruped --case 1 {options}", said)
            for options, said in [
                ("--kinds break,frction", "unknown kind 'frction': did you mean friction, joint-f"),
                ("--comparator forward-displacment", "did you mean forward-displacement?"),
                ("--comparator no.such:thing", "cannot find"),
                ("--comparator math:pi", "is no comparator"),
                ("--population 1", "population"),
                ("--repair papers", "unknown repair 'papers': did you mean paper"),
                ("--search cma", "unknown search 'cma': did you mean cma-es"),
                ("--repair paper --search cma-es", "leave --search and --repertoire out"),
                ("--search repertoire", "got the search repertoire without a repertoire"),
                ("--repertoire none.npz", "none.npz"),
                ("--repertoire gaits.npz --controller cpg", "the controllers to evolve, a cpg"),
                ("--repertoire gaits.npz --search ea", "got the search ea with a repertoire"),
                ("--repertoire gaits.npz --repair paper", "leave --search and --repertoire out"),
                ("--score energy --max-joint-speed 9", "limits of --score upright, got energy"),
                ("--score energy --max-self-collision 0", "limits of --score upright"),
                ("--score speed", "score 'speed'"),
                ("--score math:pi", "'math:pi' is no score"),
                ("--max-joint-torque 3 --reference none.csv", "--reference is a trajectory"),
                ("--max-joint-torque 0", "--max-joint-torque above 0 N m, got 0: give the"),
                ("--max-joint-speed -1", "--max-joint-speed above 0 rad/s, got -1: give the"),
                ("--max-self-collision -0.01", "collision of 0 m or above, got -0.01: give"),
                ("--controller cpq", "unknown kind of controller 'cpq': did you mean cpg?"),
                ("--controller cpg --neurons 4", "has no hidden neurons, got --neurons 4: leave"),
                ("--neurons 101", "less than or equal to 100"),
                ("--controller policy.toml --repair robust", "the weights of a controller"),
                ("--controller policy.toml --repair paper", "the weights of a controller"),
                ("--controller policy.toml --search ea", "the repair compensate has CMA-ES"),
                ("--controller policy.toml --neurons 5", "got --neurons 5: leave --neurons out"),
                ("--controller gait.toml", "gait.toml: expected a policy file that can be read"),
                ("--controller network --repair compensate", "give --controller FILE, a policy"),
                ("--repair compensate", "a controller that walks, got the design network"),
            ]
        ),
    ],
)
def test_what_no_recovery_can_do_is_refused_in_a_sentence_before_any_work(
    folder: Path, arguments: str, said: str
):
    before = sorted(folder.iterdir())
    refused("recover", *arguments.split(), "--out", "run", said=said, cwd=folder)
    assert sorted(folder.iterdir()) == before


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


def test_a_recovery_begins_from_a_repertoire(tmp_path: Path, folder: Path):
    run = (
        *("recover", "quadruped", "--case", "1", *SMALL, "--steps", "60", "--trials", "1"),
        *("--comparator", "forward-displacement", "--kinds", "paper", "--no-calibrate", "--json"),
    )
    found = [
        printed(*run, *options, "--out", name, cwd=tmp_path)
        for name, options in {
            "given": ("--repertoire", str(folder / "gaits.npz")),
            "without": (),
        }.items()
    ]
    recovered = [one["trials"][2]["displacement"] for one in found]
    assert [one["search"] for one in found] == ["repertoire", "cma-es"]
    assert [one["repertoire"] is None for one in found] == [False, True]
    assert found[0]["repertoire"]["robot"] == "quadruped"

    assert recovered[0] != recovered[1]
