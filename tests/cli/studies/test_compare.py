"""``selfmodel compare``: paired comparisons of a study, as text, tables and figures."""

import csv
import json
from pathlib import Path

import pytest

from selfmodel.experiments.ablation import AblationRow
from selfmodel.experiments.study.files import as_csv
from selfmodel.experiments.suite.rows import SuiteRow
from tests.experiments.comparison.test_outcomes import ablation_rows
from tests.helpers.command import selfmodel


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the rows of two comparators: the first right in 12 runs, the second in none."""
    (tmp_path / "rows.csv").write_text(as_csv(AblationRow, ablation_rows()))
    return tmp_path


def test_pairs_are_printed_with_difference_interval_n_and_p(folder: Path):
    told = selfmodel("compare", "rows.csv", "-o", "out", cwd=folder)

    assert told.returncode == 0, told.stderr
    assert "quadruped, 1 trial:" in told.stdout
    assert "  a better than b: 1.000 (0.587 to 1.000), n 12, p 0.00049" in told.stdout
    assert told.stderr == ""
    assert {path.name for path in (folder / "out").iterdir()} == {
        *("rows.csv", "marginal-means.csv", "comparisons.csv"),
        *(f"differences-quadruped.{suffix}" for suffix in ("png", "pdf", "svg")),
    }
    (row,) = csv.DictReader((folder / "out" / "comparisons.csv").read_text().splitlines())
    assert (row["first"], row["n"], row["only_first"], row["better"]) == ("a", "12", "12", "a")


@pytest.mark.parametrize(
    ("name", "file"),
    [("latex", "comparisons.tex"), ("markdown", "marginal-means.md"), ("parquet", "rows.parquet")],
)
def test_tables_are_written_in_the_format_of_choice(folder: Path, name: str, file: str):
    told = selfmodel("compare", "rows.csv", "-o", "out", "--table", name, cwd=folder)

    assert told.returncode == 0, told.stderr
    assert (folder / "out" / file).stat().st_size > 100


def test_unbalanced_cells_are_a_warning_with_their_numbers(folder: Path):
    rows = [row for row in ablation_rows() if row.comparator == "a" or row.seed < 2]
    (folder / "rows.csv").write_text(as_csv(AblationRow, rows))
    told = selfmodel("compare", "rows.csv", "-o", "out", "--json", cwd=folder)
    found = json.loads(told.stdout)

    (warning,) = found["warnings"]
    assert warning.startswith("quadruped, 1 trial: the cells are unbalanced (runs: a 12, b 6)")
    assert found["comparisons"][0]["n"] == 6
    assert [mean["n"] for mean in found["marginal_means"]] == [12, 6]


def test_a_study_of_one_method_has_nothing_to_compare(tmp_path: Path):
    row = SuiteRow("ant", 1, "x", 0, "x", True, "explained", 1, 2.0, 1.0, 1.5, 0, 1.0)
    (tmp_path / "rows.csv").write_text(as_csv(SuiteRow, [row]))
    told = selfmodel("compare", "rows.csv", "-o", "out", cwd=tmp_path)

    assert "rows.csv: 1 rows of one method: nothing to compare" in told.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("rows.csv",), "rows.csv is no folder of a study: give the folder of the tables, -o DIR"),
        (("rows.csv", "-o", "out", "--table", "xls"), "table format"),
        (("missing", "-o", "out"), "expected the folder of a study"),
    ],
)
def test_a_wrong_request_is_an_error(folder: Path, arguments: tuple[str, ...], message: str):
    told = selfmodel("compare", *arguments, cwd=folder)

    assert told.returncode == 2
    assert message in told.stderr
