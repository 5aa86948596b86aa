"""``--kinds``: a diagnosis searches the given fault kinds and no others."""

import json
import os
from pathlib import Path

import pytest

from tests.helpers.command import SMALL, refused, selfmodel

EXAMPLES = Path(__file__).parents[2] / "examples"
PATH = os.pathsep.join(filter(None, (str(EXAMPLES), os.environ.get("PYTHONPATH"))))
"""Where the examples can be imported from."""


@pytest.fixture(scope="module")
def heavy(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict]:
    """A folder in which a robot in low gravity on slippery ground was recovered, and its output."""
    folder = tmp_path_factory.mktemp("heavy")
    kinds = "gravity:GRAVITY,friction,jam"
    arguments = ("--damage", "gravity=3.7+friction=0.4", "--kinds", kinds)
    done = selfmodel(
        *("recover", "quadruped", *arguments, *SMALL, "--steps", "60", "--trials", "1"),
        *("--out", "run", "--json"),
        cwd=folder,
        PYTHONPATH=PATH,
    )
    assert done.returncode == 0, done.stderr
    return folder, json.loads(done.stdout)


def words(diagnosis: list[dict]) -> set[str]:
    """The words of all terms of a ranking."""
    terms = "+".join(one["hypothesis"] for one in diagnosis).split("+")
    return {term.partition("=")[0].partition(":")[0] for term in terms}


@pytest.mark.search
def test_a_recovery_considers_the_kinds_that_are_chosen(heavy: tuple[Path, dict]):
    _, told = heavy

    assert told["truth"] == "friction=0.4+gravity=3.7"
    assert told["kinds"] == ["gravity", "friction", "jam"]
    assert {"gravity", "friction"} & words(told["diagnosis"])
    assert words(told["diagnosis"]) <= {*told["kinds"], "intact"}


@pytest.mark.search
def test_the_logs_and_the_kinds_of_a_run_give_its_ranking(heavy: tuple[Path, dict]):
    run, told = heavy
    logs = [trial["log"] for trial in told["trials"]]
    done = selfmodel(
        *("diagnose", *logs, "--kinds", "gravity:GRAVITY,friction,jam", "--json"),
        cwd=run,
        PYTHONPATH=PATH,
    )
    found = json.loads(done.stdout)

    assert found["diagnosis"] == told["diagnosis"]
    assert found["kinds"] == told["kinds"]


def test_a_trial_and_its_replay_name_a_kind_of_ones_own(tmp_path: Path):
    own = ("--kinds", "gravity:GRAVITY")
    logged = selfmodel(
        *("trial", "quadruped", "--damage", "gravity=3.7", *own, "--steps", "60"),
        *("--out", "a.mcap"),
        cwd=tmp_path,
        PYTHONPATH=PATH,
    )
    again = selfmodel(
        *("replay", "a.mcap", "--hypothesis", "gravity=3.7", *own, "--json"),
        cwd=tmp_path,
        PYTHONPATH=PATH,
    )
    drawn = selfmodel(
        *("render", "a.mcap", "--hypothesis", "gravity=3.7", *own, "--out", "a.png"),
        cwd=tmp_path,
        PYTHONPATH=PATH,
    )

    assert logged.returncode == drawn.returncode == 0, logged.stderr + drawn.stderr
    assert json.loads(again.stdout)["identical"]
    refused("replay", "a.mcap", "--hypothesis", "gravity=3.7", said="gravity", cwd=tmp_path)


@pytest.mark.parametrize("command", [["recover", "quadruped", "--case", "1"], ["diagnose", "a"]])
def test_an_unknown_kind_is_one_sentence_and_status_2(command: list[str], tmp_path: Path):
    said = "unknown kind 'frction': did you mean friction, joint-friction?"
    refused(*command, "--kinds", "break,frction", said=said, cwd=tmp_path)
    assert list(tmp_path.iterdir()) == []
