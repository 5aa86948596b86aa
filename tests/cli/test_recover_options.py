"""What a recovery, and the trials and diagnoses around it, make of their options."""

import json
import os
from pathlib import Path

import pytest

from selfmodel.cli.commands import Recover
from selfmodel.cli.recover import experiment_of
from selfmodel.logs import read_log
from selfmodel.logs.journal import is_calibrated
from selfmodel.logs.repertoires import save_repertoire
from selfmodel.robot.robot import Robot
from tests.helpers.command import SMALL, printed, refused, selfmodel, succeeds
from tests.helpers.drivers import random_repertoire
from tests.helpers.policies import save_policy

TINY = ("--population", "4", "--generations", "1")
FEW = (*TINY, "--kinds", "paper", "--trials", "1", "--steps", "60", "--no-calibrate", "--json")
QUICK = (
    *("recover", "quadruped", "--case", "1", *FEW, "--comparator", "forward-displacement"),
    *("--diagnostic-search", "ea"),
)


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
        ("quadruped --case 11", "unknown case of quadruped '11'"),
        (
            "suite-fish-swim --case 1",
            "case 1 of Table I, a lower leg breaks off, does not apply to suite-fish-swim: it",
        ),
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
                ("--repair paper --search cma-es", "leave search and repertoire out"),
                ("--search repertoire", "got the search repertoire without a repertoire"),
                ("--repertoire none.npz", "none.npz"),
                ("--repertoire gaits.npz --controller cpg", "the controllers to evolve, a cpg"),
                ("--repertoire gaits.npz --search ea", "got the search ea with a repertoire"),
                ("--repertoire gaits.npz --repair paper", "leave search and repertoire out"),
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
    given = ("--steps", "30", "--gap", "0.05", *options, "--out", "run")
    found = printed(*QUICK, *given, cwd=tmp_path)

    assert found["score"]["name"] == score
    assert found["repair"] == ("paper" if "paper" in options else "robust")
    before, after, recovery = found["trials"]
    assert before["predicted_score"] is not None
    assert after["predicted_score"] is after["robust_mean"] is None
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
    given = ("--repair", "paper", "--score", "my_scores:HEALTHY_ONLY", "--out", "run")
    done = selfmodel(*QUICK, *given, cwd=tmp_path)
    told = " ".join(done.stderr.split())

    assert done.returncode == 2, told
    assert "the score 'my_scores:HEALTHY_ONLY': expected one number for each of" in told
    assert told.endswith("; the finished trials are in run")
    assert (tmp_path / "run" / "trials" / "01-after.mcap").exists()
    assert json.loads((tmp_path / "run" / "searches.json").read_text())


def test_a_recovery_begins_from_a_repertoire(tmp_path: Path, folder: Path):
    found = [
        printed(*QUICK, *given, "--out", name, cwd=tmp_path)
        for name, given in {"with": ("--repertoire", folder / "gaits.npz"), "without": ()}.items()
    ]
    recovered = [one["trials"][2]["displacement"] for one in found]
    assert [one["search"] for one in found] == ["repertoire", "cma-es"]
    assert [one["repertoire"] is None for one in found] == [False, True]
    assert found[0]["repertoire"]["robot"] == "quadruped"
    assert recovered[0] != recovered[1]


@pytest.mark.parametrize(
    ("given", "steps"),
    [({"score": "return"}, 1001), ({"score": "return", "steps": 80}, 80), ({}, 1000)],
)
def test_a_trial_of_a_return_has_an_episode_and_the_last_sample(given: dict, steps: int):
    experiment = experiment_of(Recover(robot="quadruped", case=1, **given))
    assert experiment.settings.steps == steps


@pytest.mark.search
def test_a_recovery_evolves_oscillators_that_drive_other_trials_too(tmp_path: Path):
    asked = ("--case", "3", "--controller", "cpg", "--out", "run")
    told = printed("recover", "quadruped", *asked, *FEW, cwd=tmp_path)
    drivers = [read_log(tmp_path / one["log"]).trial.plan.controller for one in told["trials"]]
    given = ("--controller", told["trials"][0]["log"], "--damage", "break:back_left_knee")
    succeeds("trial", "quadruped", *given, "--out", "broken.mcap", cwd=tmp_path)
    truth = ("--hypothesis", "break:back_left_knee", "--json")

    assert told["controller"] == "cpg"
    assert len(drivers) == 3
    assert all(driver.design.name == "cpg" for driver in drivers)
    assert drivers[0] == drivers[1] != drivers[2]
    assert printed("replay", "broken.mcap", *truth, cwd=tmp_path)["identical"] is True
    assert "a CPG of" in selfmodel("logs", "info", "broken.mcap", cwd=tmp_path).stdout


def test_a_trial_takes_random_cpgs_or_a_random_network_of_any_size(tmp_path: Path):
    for number, asked in enumerate((["--controller", "cpg"], ["--neurons", "6"])):
        out = f"{number}.mcap"
        succeeds("trial", "quadruped", *asked, "--steps", "9", "--out", out, cwd=tmp_path)
    rhythmic, large = (read_log(tmp_path / f"{k}.mcap").trial.plan.controller for k in (0, 1))

    assert rhythmic.design.name == "cpg"
    assert large.design.hidden == 6


@pytest.mark.search
def test_a_recovery_s_network_has_as_many_neurons_as_are_asked_for(tmp_path: Path):
    asked = ("--neurons", "5", "--damage", "neuron:4", "--out", "run")
    told = printed("recover", "quadruped", *asked, *FEW, cwd=tmp_path)
    log = read_log(tmp_path / told["trials"][-1]["log"])

    assert told["neurons"] == 5
    assert told["controller"] == "network"
    assert told["calibration"] is None
    assert not is_calibrated(tmp_path / Path(told["trials"][-1]["log"]).parents[1])
    assert log.trial.plan.controller.design.hidden == 5


def test_a_controller_of_another_size_is_refused_by_what_differs(tmp_path: Path):
    few = ("--steps", "9", "--out", "6.mcap")
    succeeds("trial", "quadruped", "--neurons", "6", *few, cwd=tmp_path)
    done = refused(
        *("trial", "quadruped", "--controller", "6.mcap", "--neurons", "3", "--out", "3.mcap"),
        said="6 hidden neurons and 8 motors; this robot needs one for",
        cwd=tmp_path,
    )

    assert "3 hidden neurons" in done.stderr


EXAMPLES = Path(__file__).parents[2] / "examples"
PATH = os.pathsep.join(filter(None, (str(EXAMPLES), os.environ.get("PYTHONPATH"))))
"""Where the examples can be imported from."""


def words(diagnosis: list[dict]) -> set[str]:
    """The words of all terms of a ranking."""
    terms = "+".join(one["hypothesis"] for one in diagnosis).split("+")
    return {term.partition("=")[0].partition(":")[0] for term in terms}


@pytest.mark.search
def test_a_recovery_and_a_diagnosis_of_its_logs_consider_the_kinds_that_are_chosen(tmp_path: Path):
    kinds = ("--kinds", "gravity:GRAVITY,friction,jam", "--json")
    asked = ("--damage", "gravity=3.7+friction=0.4", *SMALL, "--steps", "60", "--trials", "1")
    given = (*asked, *kinds, "--out", "run")
    told = printed("recover", "quadruped", *given, cwd=tmp_path, PYTHONPATH=PATH)
    logs = [trial["log"] for trial in told["trials"]]
    found = printed("diagnose", *logs, *kinds, cwd=tmp_path, PYTHONPATH=PATH)

    assert told["truth"] == "friction=0.4+gravity=3.7"
    assert found["kinds"] == told["kinds"] == ["gravity", "friction", "jam"]
    assert {"gravity", "friction"} & words(told["diagnosis"])
    assert words(told["diagnosis"]) <= {*told["kinds"], "intact"}
    assert found["diagnosis"] == told["diagnosis"]


def test_a_trial_and_its_replay_name_a_kind_of_ones_own(tmp_path: Path):
    own = ("--kinds", "gravity:GRAVITY")
    fault = ("--hypothesis", "gravity=3.7", *own)
    _, again, _ = (
        succeeds(*command, cwd=tmp_path, PYTHONPATH=PATH)
        for command in (
            ("trial", "quadruped", "--damage", fault[1], *own, "--steps", "60", "--out", "a.mcap"),
            ("replay", "a.mcap", *fault, "--json"),
            ("render", "a.mcap", *fault, "--out", "a.png"),
        )
    )

    assert json.loads(again.stdout)["identical"]
    refused("replay", "a.mcap", "--hypothesis", "gravity=3.7", said="gravity", cwd=tmp_path)
