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
    assert "  a better than b: 1.000 (0.709 to 1.000), n 18, p 0.031" in told.stdout
    assert told.stderr == ""
    assert {path.name for path in (folder / "out").iterdir()} == {
        *("rows.csv", "marginal-means.csv", "comparisons.csv"),
        *(f"differences-quadruped.{suffix}" for suffix in ("png", "pdf", "svg")),
    }
    (row,) = csv.DictReader((folder / "out" / "comparisons.csv").read_text().splitlines())
    assert (row["first"], row["n"], row["only_first"], row["better"]) == ("a", "18", "18", "a")
    assert row["table"] == "quadruped, 1 trial"


def test_a_paper_has_tables_of_five_columns_and_figures_as_wide_as_its_style_says(folder: Path):
    (folder / "own.mplstyle").write_text("figure.figsize: 5, 3\nsavefig.dpi: 100\n")
    for wanted, style, pixels in (
        ("markdown", "column", 3.5 * 150),
        ("latex", "own.mplstyle", 5 * 100),
    ):
        given = ("--table", wanted, "--style", style)
        succeeds("compare", "rows.csv", "-o", "out", *given, cwd=folder)
        data = (folder / "out" / "differences-quadruped.png").read_bytes()
        assert int.from_bytes(data[16:20], "big") == pixels

    head, _, pair, _, note = (folder / "out" / "comparisons.md").read_text().splitlines()
    assert head == "| table | comparison | difference (95 %) | n | p |"
    assert pair.startswith("| quadruped, 1 trial | a vs. b | 1.000 (")
    assert pair.endswith("| 18 | 0.031* |")
    assert (folder / "out" / "marginal-means.tex").read_text().count("&") == 3 * 4
    latex = (folder / "out" / "comparisons.tex").read_text()
    for said in ("95 % intervals over seeds, which are not corrected", "corrected for the number"):
        assert said in note
        assert said.replace("%", r"\%") in latex.split(r"\end{tabular}")[1]
    assert not list((folder / "out").glob("rows.*"))


def test_a_study_of_one_method_has_nothing_to_compare(tmp_path: Path):
    told = succeeds("compare", "rows.csv", "-o", "out", cwd=write(tmp_path, [body()], "suite"))

    assert "rows.csv: 1 rows of one method: nothing to compare" in told.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("rows.csv",), "rows.csv is no folder of a study: give the folder of the tables, -o DIR"),
        (("rows.csv", "-o", "out", "--table", "xls"), "unknown table format 'xls'"),
        (("rows.csv", "-o", "out", "--style", "wide"), "wide: expected column, page, or a style"),
        (("missing", "-o", "out"), "missing: expected the folder of a study"),
    ],
)
def test_a_wrong_request_is_an_error(folder: Path, arguments: tuple[str, ...], message: str):
    refused("compare", *arguments, said=message, cwd=folder)
