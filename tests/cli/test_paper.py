"""``selfmodel paper``: the experiment in a folder that is continued, and wrong input."""

import json
from pathlib import Path

import pytest

from tests.helpers.command import SMALL, selfmodel

TINY = ("--robots", "quadruped", "--comparator", "forward-displacement", *SMALL)
TINY += ("--steps", "60", "--trials", "1", "--workers", "1", "--out", "out")


@pytest.mark.process
@pytest.mark.search
def test_an_experiment_ends_with_tables_and_figures_and_is_continued(tmp_path: Path):
    first = selfmodel("paper", *TINY, "--case", "1", "--json", cwd=tmp_path)
    second = selfmodel("paper", *TINY, "--case", "7,1", cwd=tmp_path, COLUMNS="120")

    assert (first.returncode, second.returncode) == (0, 0), first.stderr + second.stderr
    found = json.loads(first.stdout)
    assert [row["case"] for row in found["table_2"]] == [1]
    assert found["failures"] == []
    assert "1 of 1 were done before" in second.stderr  # the gait
    assert "2 of 4 were done before" in second.stderr  # the recovery and the control
    assert "not restored" in second.stdout
    for name in ("paper.md", "figure-1.png", "figure-5.pdf", "figure-6.png", "table-2.csv"):
        assert f"out/{name}" in second.stdout
        assert (tmp_path / "out" / name).stat().st_size > 0

    other = selfmodel("paper", *TINY, "--case", "1", "--steps", "61", cwd=tmp_path)

    assert other.returncode == 2
    assert "the paper's experiment with other settings (settings.steps is 60 there" in other.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--robots", "quadrped"), "did you mean quadruped?"),
        (("--case", "11"), "unknown case of Table I '11'"),
        (("--case", "one"), "--case needs whole numbers"),
        (("--comparator", "nope"), "unknown comparator 'nope'"),
    ],
)
def test_wrong_input_is_refused_before_anything_is_written(
    tmp_path: Path, arguments: tuple[str, ...], message: str
):
    done = selfmodel("paper", *TINY, *arguments, cwd=tmp_path)

    assert done.returncode == 2
    assert message in done.stderr
    assert list(tmp_path.iterdir()) == []
