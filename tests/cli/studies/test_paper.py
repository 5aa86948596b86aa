"""``selfmodel paper``: the experiment in a folder that is continued, and wrong input."""

import json
from pathlib import Path

import pytest

from selfmodel.cli.studies import paper
from selfmodel.experiments.paper.results import PaperResults
from tests.helpers.command import SMALL, selfmodel
from tests.helpers.paper_rows import trials

TINY = ("--robots", "quadruped", "--comparator", "forward-displacement", *SMALL)
TABLES = ("tables/table-1.md", "tables/table-2.md", "tables/costs.md")
TINY += ("--steps", "60", "--trials", "1", "--workers", "1", "--out", "out")


@pytest.mark.process
@pytest.mark.search
def test_an_experiment_ends_with_tables_and_figures_and_is_continued(tmp_path: Path):
    first = selfmodel("paper", *TINY, "--case", "1", "--json", "--table", "csv", cwd=tmp_path)
    second = selfmodel(
        "paper", *TINY, "--case", "7,1", "--table", "markdown", cwd=tmp_path, COLUMNS="120"
    )

    assert (first.returncode, second.returncode) == (0, 0), first.stderr + second.stderr
    found = json.loads(first.stdout)
    assert [row["case"] for row in found["table_2"]] == [1]
    assert found["failures"] == []
    assert "out/paper.md" in found["files"]
    assert "out/tables/costs.csv" in found["files"]
    assert "3 of 5 were done before" in second.stderr  # gait, recovery and control
    assert "not restored" in second.stdout
    for name in (
        "paper.md",
        "figure-1.png",
        "figure-5.pdf",
        "figure-6.png",
        "table-2.csv",
        *TABLES,
    ):
        assert f"out/{name}" in second.stdout
        assert (tmp_path / "out" / name).stat().st_size > 0

    other = selfmodel("paper", *TINY, "--case", "1", "--steps", "61", cwd=tmp_path)

    assert other.returncode == 2
    assert "the paper's experiment with other settings (settings.steps is 60 there" in other.stderr


def test_the_table_of_costs_has_every_number_of_trials_as_the_csv_file_has():
    results = PaperResults(None, (), (), (), tuple(trials([2.0, 0.0, 1.0, 2.0])), ())

    table = paper._costs(results)

    assert [row["physical_trials"] for row in table.records] == [1, 2]
    assert [row[2] for row in table.rows] == ["1", "2"]


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
