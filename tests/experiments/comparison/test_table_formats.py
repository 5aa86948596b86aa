"""Tests of tables as CSV, Parquet, LaTeX and Markdown."""

import csv
import io
import math
import sys
from dataclasses import dataclass

import pyarrow.parquet
import pytest

from selfmodel.errors import InputError
from selfmodel.experiments.comparison.table_formats import FORMATS, Table, check_format, table_file
from selfmodel.experiments.comparison.tables import (
    p_text,
    table_of_comparisons,
    table_of_means,
    table_of_records,
    table_of_rows,
)
from selfmodel.experiments.confidence_intervals import Interval
from selfmodel.experiments.statistics import compare, marginal_means
from tests.experiments.statistics.test_comparison import outcomes

TABLE = Table(
    name="pairs",
    names=("first", "share", "better", "n"),
    records=[{"first": "a_b", "share": 0.123456789, "better": None, "n": 4}],
    columns=("first", "÷ oracle, %"),
    rows=[("a_b|c & 5 %", "< 0.12")],
    texts=1,
)


def test_a_program_gets_all_digits():
    name, data = table_file(TABLE, "csv")
    (row,) = csv.DictReader(io.StringIO(data.decode()))

    assert name == "pairs.csv"
    assert row == {"first": "a_b", "share": "0.123456789", "better": "", "n": "4"}
    name, data = table_file(TABLE, "parquet")
    assert name == "pairs.parquet"
    assert pyarrow.parquet.read_table(io.BytesIO(data)).to_pylist() == list(TABLE.records)


def test_a_latex_table_has_no_character_that_latex_reads_as_a_command():
    name, data = table_file(TABLE, "latex")

    assert name == "pairs.tex"
    assert data.decode().splitlines() == [
        *(r"\begin{tabular}{lr}", r"\toprule", r"first & $\div$ oracle, \% \\", r"\midrule"),
        *(r"a\_b$|$c \& 5 \% & $<$ 0.12 \\", r"\bottomrule", r"\end{tabular}"),
    ]


def test_a_markdown_table_has_as_many_cells_in_every_line():
    name, data = table_file(TABLE, "markdown")

    assert name == "pairs.md"
    assert data.decode().splitlines() == [
        *("| first | ÷ oracle, % |", "| --- | ---: |", r"| a_b\|c & 5 % | < 0.12 |"),
    ]


def test_an_unknown_format_is_an_error_that_lists_the_known_ones():
    with pytest.raises(InputError, match="latex"):
        table_file(TABLE, "latx")


@dataclass(frozen=True)
class Score:
    """Record of a study with an interval and one that may be missing."""

    method: str
    correct: Interval
    time: Interval | None
    seconds: float


def test_an_interval_of_a_record_has_a_column_per_end_and_unknown_numbers_are_empty():
    scores = [
        Score("a", Interval(0.5, 0.25, 0.75), None, math.nan),
        Score("b", Interval(1.0, math.nan, math.nan), Interval(2.0, 1.5, 2.5), 3.0),
    ]
    table = table_of_records("scores", scores, ("method",), [("a",), ("b",)], texts=1)
    head, *lines = table_file(table, "csv")[1].decode().splitlines()

    assert head == "method,correct,correct_low,correct_high,time,time_low,time_high,seconds"
    assert lines == ["a,0.5,0.25,0.75,,,,", "b,1.0,,,2.0,1.5,2.5,3.0"]
    parquet = pyarrow.parquet.read_table(io.BytesIO(table_file(table, "parquet")[1]))
    assert parquet.to_pylist() == list(table.records)


@dataclass(frozen=True)
class Unknown:
    """Record of a study with values that may all be unknown."""

    case: int | None
    verdict: str | None
    upright: bool | None
    recovery: float | None
    time: Interval | None


def test_a_column_without_values_has_its_declared_type_in_parquet():
    unknown = [Unknown(None, None, None, None, None)]
    declared = {"case": "int64", "verdict": "string", "upright": "bool", "recovery": "double"}
    declared |= dict.fromkeys(("time", "time_low", "time_high"), "double")

    assert parquet_types(table_of_records("u", unknown, ("case",), [("-",)], texts=1)) == declared
    rows = parquet_types(table_of_rows(unknown))
    assert rows == {name: declared[name] for name in rows}
    pairs = compare([*outcomes("a", "1"), *outcomes("b", "1")])
    assert parquet_types(table_of_comparisons(pairs))["better"] == "string"


def parquet_types(table: Table) -> dict[str, str]:
    """The type of each column of a table's Parquet file."""
    schema = pyarrow.parquet.read_schema(io.BytesIO(table_file(table, "parquet")[1]))
    return {field.name: str(field.type) for field in schema}


def test_a_format_is_checked_without_a_table(monkeypatch: pytest.MonkeyPatch):
    for name in FORMATS:
        check_format(name)
    with pytest.raises(InputError, match="unknown table format 'latx': did you mean latex"):
        check_format("latx")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(InputError, match="a Parquet table needs pyarrow"):
        check_format("parquet")


@pytest.mark.parametrize("name", FORMATS)
def test_a_table_without_rows_is_a_table(name: str):
    empty = Table("empty", ("a_name", "b_name"), [], ("a", "b"), [], 1)

    assert table_file(empty, name)[1]


def test_a_table_without_rows_has_the_columns_that_it_has_with_rows():
    for table in (table_of_means([]), table_of_comparisons([])):
        full = {
            "marginal-means": table_of_means(marginal_means(outcomes("a", "11"))),
            "comparisons": table_of_comparisons(
                compare([*outcomes("a", "1"), *outcomes("b", "0")])
            ),
        }[table.name]
        parquet = pyarrow.parquet.read_table(io.BytesIO(table_file(table, "parquet")[1]))

        assert list(full.records[0]) == list(table.names) == parquet.column_names
        assert table_file(table, "csv")[1].decode() == ",".join(table.names) + "\n"


def test_a_name_stays_in_its_cell():
    odd = Table("odd", ("a",), [{"a": ""}], ("a",), [("x\\|y\nz",)], 1)

    assert table_file(odd, "markdown")[1].decode().splitlines()[2] == r"| x\\\|y z |"


def test_a_p_value_has_the_digits_that_tell_it_from_the_level():
    values = (0.00001, 0.00049, 0.0496, 0.04996, 0.05, 0.0504, 0.58, 1.0)

    assert list(map(p_text, values)) == [
        *("< 0.0001", "0.00049", "0.0496", "0.04996", "0.05", "0.05", "0.58", "1")
    ]
