"""Promises of `selfmodel recover` about repairs, searches, scores and falls."""

import json
from pathlib import Path

import pytest

from tests.helpers.command import SMALL, selfmodel


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--repair", "papers"), "unknown repair 'papers': did you mean paper"),
        (("--search", "cma"), "unknown search 'cma': did you mean cma-es"),
        (("--repair", "paper", "--search", "cma-es"), "leave --search out"),
        (("--score", "speed"), "score 'speed'"),
        (("--score", "math:pi"), "'math:pi' is no score"),
    ],
)
def test_a_name_that_is_unknown_is_refused_before_any_work(
    tmp_path: Path, options: tuple[str, ...], message: str
):
    done = selfmodel("recover", "quadruped", "--case", "1", *options, "--out", "run", cwd=tmp_path)

    assert done.returncode == 2
    assert message in " ".join(done.stderr.split())
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("options", "score"),
    [
        ((), "upright"),
        (("--repair", "paper"), "displacement"),
        (("--search", "ea", "--score", "energy"), "energy"),
        (("--score", "selfmodel.recovery.scores.energy:ENERGY"), "energy"),
    ],
)
def test_the_score_is_that_of_the_repair_unless_another_is_given(
    tmp_path: Path, options: tuple[str, ...], score: str
):
    done = selfmodel(
        *("recover", "quadruped", "--case", "1", *SMALL, "--steps", "60", "--trials", "1"),
        *("--kinds", "paper", "--gap", "0.05", *options, "--out", "run", "--json"),
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)

    assert found["score"]["name"] == score
    assert found["repair"] == ("paper" if "paper" in options else "robust")
    before, after, recovery = found["trials"]
    assert before["predicted_score"] is not None
    assert after["predicted_score"] is None
    assert recovery["predicted_score"] is not None
    assert recovery["steps"] == 60
    assert found["fell"] == (recovery["fell_at_step"] is not None)
