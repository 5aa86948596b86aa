"""``selfmodel compare``: paired comparisons of a study, as text, tables and figures."""

import csv
from pathlib import Path

import pytest

from selfmodel.studies.rows import KINDS, frame_of
from selfmodel.studies.tables import csv_bytes
from tests.helpers.command import refused, succeeds
from tests.helpers.study_rows import body, diagnosis

ROWS = [
    diagnosis(name, case=case, truth=str(case), seed=seed, correct=name == "a")
    for name in "ab"
    for case in (1, 2, 3)
    for seed in range(6)
]


def write(folder: Path, rows: list[dict], name: str = "ablate") -> Path:
    (folder / "rows.csv").write_bytes(csv_bytes(frame_of(rows, KINDS[name].columns)))
    return folder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the rows of two comparators: the first right in 18 runs, the second in none."""
    return write(tmp_path, ROWS)


def test_pairs_are_printed_with_difference_interval_n_and_p(folder: Path):
    told = succeeds("compare", "rows.csv", "-o", "out", cwd=folder)

    assert "quadruped, 1 trial:" in told.stdout
    assert "  a better than b: XX" in told.stdout
    assert told.stderr == ""
    assert {path.name for path in (folder / "out").iterdir()} == {
        *("rows.csv", "marginal-means.csv", "comparisons.csv"),
        *(f"differences-quadruped.{suffix}" for suffix in ("png", "pdf", "svg")),
    }
    (row,) = csv.DictReader((folder / "out" / "comparisons.csv").read_text().splitlines())
    assert (row["first"], row["n"], row["only_first"], row["better"]) == ("a", "18", "18", "a")
    assert row["table"] == "quadruped, 1 trial"


def test_tables_are_written_in_the_format_of_choice(folder: Path):
    succeeds("compare", "rows.csv", "-o", "out", "--table", "markdown", cwd=folder)

    assert (folder / "out" / "marginal-means.md").stat().st_size > 100


def test_a_study_of_one_method_has_nothing_to_compare(tmp_path: Path):
    told = succeeds("compare", "rows.csv", "-o", "out", cwd=write(tmp_path, [body()], "suite"))

    assert "rows.csv: 1 rows of one method: nothing to compare" in told.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("rows.csv",), "rows.csv is no folder of a study: give the folder of the tables, -o DIR"),
        (("rows.csv", "-o", "out", "--table", "xls"), "unknown table format 'xls'"),
        (("missing", "-o", "out"), "missing: expected the folder of a study"),
    ],
)
def test_a_wrong_request_is_an_error(folder: Path, arguments: tuple[str, ...], message: str):
    refused("compare", *arguments, said=message, cwd=folder)
