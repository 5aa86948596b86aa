"""``selfmodel baseline``: runs, table, and errors of usage."""

import json
from pathlib import Path

import pytest

from tests.helpers.command import selfmodel

TINY = (
    *("--robots", "quadruped", "--case", "2", "--gap", "0.1", "--methods", "random-search"),
    *("--steps", "20", "--trials", "2", "--workers", "1", "--out", "study"),
)


@pytest.mark.process
def test_a_study_is_run_and_its_table_printed_again(tmp_path: Path):
    done = selfmodel("baseline", *TINY, "--json", "--table-format", "csv", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    (row,) = told["rows"]
    again = ("--table", "--table-format", "latex", "--out", "study")
    table = selfmodel("baseline", *again, cwd=tmp_path)

    assert told["files"] == ["study/results.jsonl", "study/tables/summaries.csv"]
    assert (row["method"], len(row["best"])) == ("random-search", 2)
    assert (tmp_path / "study" / "results.jsonl").read_text().count("\n") == 1
    assert "random-search" in table.stdout
    assert f"{row['best'][0]:.2f}" in table.stdout
    assert "Medians over the seeds" in table.stdout
    assert "study/tables/summaries.tex" in table.stdout
    latex = (tmp_path / "study" / "tables" / "summaries.tex").read_text()
    assert f"quadruped & 2 & 0.1 & random-search & 1 & {row['best'][0]:.2f} &" in latex


def test_an_unknown_method_is_an_error_of_usage_before_anything_is_run(tmp_path: Path):
    done = selfmodel("baseline", *TINY, "--methods", "oracles", cwd=tmp_path)

    assert done.returncode == 2
    assert "unknown baseline 'oracles': did you mean oracle?" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_the_table_of_a_missing_study_is_an_error_of_usage(tmp_path: Path):
    done = selfmodel("baseline", "--table", "--out", "study", cwd=tmp_path)

    assert done.returncode == 2
    assert "study: expected the folder of a study with finished runs, got none" in done.stderr
    assert list(tmp_path.iterdir()) == []
