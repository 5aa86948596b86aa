"""``--kinds``: a diagnosis searches the given fault kinds and no others."""

import json
import os
from pathlib import Path

import pytest

from tests.helpers.command import SMALL, printed, refused, selfmodel

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
    told = printed(
        *("recover", "quadruped", "--damage", "gravity=3.7+friction=0.4", *kinds, *SMALL),
        *("--steps", "60", "--trials", "1", "--out", "run"),
        cwd=tmp_path,
        PYTHONPATH=PATH,
    )
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
    logged, again, drawn = (
        selfmodel(*command, cwd=tmp_path, PYTHONPATH=PATH)
        for command in (
            ("trial", "quadruped", "--damage", fault[1], *own, "--steps", "60", "--out", "a.mcap"),
            ("replay", "a.mcap", *fault, "--json"),
            ("render", "a.mcap", *fault, "--out", "a.png"),
        )
    )

    assert logged.returncode == drawn.returncode == 0, logged.stderr + drawn.stderr
    assert json.loads(again.stdout)["identical"]
    refused("replay", "a.mcap", "--hypothesis", "gravity=3.7", said="gravity", cwd=tmp_path)
