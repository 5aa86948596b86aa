"""Promises of CSV files: the usual dialects are read, and an error names line and column."""

from pathlib import Path

import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.logs.recordings.tables.content import NO_TIME
from tests.logs.recordings.tables.tables import read_here


def written(folder: Path, text: str | bytes) -> Path:
    path = folder / "t.csv"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


@pytest.mark.parametrize(
    "text",
    [
        "time,q\n0,1.5\n1,-2e3\n",
        "time;q\n0;1,5\n1;-2e3\n",
        "time\tq\r\n0\t1.5\r\n1\t-2e3\r\n",
        "\ufefftime,q\n0,1.5\n1,-2e3\n",
        '"time","q"\n"0","1.5"\n"1","-2e3"\n',
        "# time, q\n0, 1.5\n\n1, -2e3",
        "time q\n0 1.5\n1 -2e3\n",
        "note,time,q\nwalk,0,1.5\nstand,1,-2e3\n",
    ],
)
def test_the_usual_dialects_are_the_same_table(text: str, tmp_path: Path):
    names, found = read_here(written(tmp_path, text), "time", "q")

    assert [name for name in names if name != "note"] == ["time", "q"]
    assert found["q"].tolist() == [1.5, -2000.0]


def test_missing_numbers_are_nan_and_words_are_numbers(tmp_path: Path):
    _, found = read_here(written(tmp_path, "q\nNaN\n\nnull\nTrue\n-inf\n"), "q")

    np.testing.assert_array_equal(found["q"], [np.nan, np.nan, 1.0, -np.inf])


def test_integers_of_the_exact_column_are_not_rounded(tmp_path: Path):
    path = written(tmp_path, "t,q\n1700000000123456789,1\n1700000000123456790,2\n")

    _, found = read_here(path, "t", "q", exact="t")

    assert found["t"].tolist() == [1700000000123456789, 1700000000123456790]
    assert found["q"].dtype == np.float64


@pytest.mark.parametrize("end", ["", "Z", "+00:00"])
def test_dates_of_the_exact_column_are_whole_nanoseconds(end: str, tmp_path: Path):
    times = ("2026-01-01 00:00:00.123456789", "", "2026-01-01T00:00:01")
    rows = "".join(f"{time}{end if time else ''},1\n" for time in times)

    _, found = read_here(written(tmp_path, f"t,q\n{rows}"), "t", exact="t")

    start = 1767225600 * 10**9
    assert found["t"].dtype == np.int64
    assert found["t"].tolist() == [start + 123456789, NO_TIME, start + 10**9]


@pytest.mark.parametrize("text", ["2026-13-01 00:00:00", "2026-01-01 00:00:00+02:00", "2026-01-01"])
def test_other_dates_are_refused(text: str, tmp_path: Path):
    with pytest.raises(InputError, match=r"line 2, column 1 \(t\): expected a number, got '2026"):
        read_here(written(tmp_path, f"t,q\n{text},1\n"), "t", exact="t")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("# of a robot\ntime,q\n0,1\n", "line 2: .* or remove lines above the names"),
        ("", "line 1: expected names of columns, got an empty file"),
        ("1,2\n3,4\n", "line 1: expected names of columns, got numbers: add a first line"),
        ("time,q\n0,1\n1\n", "line 3: expected 2 fields, as in line 1, got 1"),
        ("time,q\n0,1\n1,2,3\n", "line 3: expected 2 fields, as in line 1, got 3"),
        ("time,q\n0,1\n\n1,x\n", r"line 4, column 2 \(q\): expected a number, got 'x'"),
        ("time,q\n0,1_0\n", r"line 2, column 2 \(q\): expected a number, got '1_0'"),
        ("time;q\n0;1.000,5\n", r"line 2, column 2 \(q\): expected a number, got '1.000,5'"),
        ("time,q,q\n0,1,2\n", "the columns 2 and 3 are both called 'q': rename one"),
        ('time,q\n0,"1\n', "line 2: expected fields of a CSV file, got: unexpected end of data"),
        (b"time,q\n0,\xff\n", "expected a CSV file in UTF-8"),
        ("t" * 1001 + ",q\n0,1\n", "of at most 1000 characters, got one of 1001 in column 1"),
        ("time,q\n0," + "1" * 200_000, "line 2: expected fields of a CSV file, got: field larger"),
    ],
)
def test_an_error_names_line_and_column(text: str | bytes, message: str, tmp_path: Path):
    with pytest.raises(InputError, match=message):
        read_here(written(tmp_path, text), "time", "q")
