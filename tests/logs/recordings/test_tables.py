"""Tables: the usual dialects and types are read, and damage is refused by its place."""

import datetime as dt
import zipfile
from contextlib import suppress
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from selfmodel.errors import InputError
from selfmodel.logs.recordings.tables import NO_TIME, read_table
from tests.logs.recordings.bags import spoilt
from tests.logs.recordings.table_files import WRITERS, columns


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
def test_the_usual_dialects_of_csv_are_the_same_table(text: str, tmp_path: Path):
    table = read_table(written(tmp_path, text), ("time", "q"))

    assert [name for name in table.names if name != "note"] == ["time", "q"]
    assert table.columns["q"].tolist() == [1.5, -2000.0]


def test_missing_fields_are_nan_and_words_are_numbers(tmp_path: Path):
    table = read_table(written(tmp_path, "q\nNaN\n\nnull\nTrue\n-inf\n"), "q")

    np.testing.assert_array_equal(table.columns["q"], [np.nan, np.nan, 1.0, -np.inf])


@pytest.mark.parametrize(
    ("texts", "values"),
    [
        (["1700000000123456789", "1700000000123456790"], [0, 1]),
        (["2023-11-14 22:13:20.123456789", "", "2023-11-14T22:13:21"], [0, None, 876543211]),
        (["2023-11-14 22:13:20.123456789Z", "2023-11-14T22:13:21+00:00"], [0, 876543211]),
    ],
)
def test_times_in_a_csv_file_are_whole_nanoseconds(texts: list, values: list, tmp_path: Path):
    rows = "".join(f"{text},1\n" for text in texts)

    found = read_table(written(tmp_path, f"t,q\n{rows}"), ("t", "q"), exact="t").columns

    start = 1_700_000_000_123_456_789
    assert found["t"].tolist() == [NO_TIME if k is None else start + k for k in values]
    assert found["q"].dtype == np.float64


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("# of a robot\ntime,q\n0,1\n", "line 2: "),
        ("", "line 1: "),
        ("1,2\n3,4\n", "line 1: "),
        ("time,q\n0,1\n1\n", "line 3: expected 2 fields, .*got 1"),
        ("time,q\n0,1\n1,2,3\n", "line 3: expected 2 fields, .*got 3"),
        ("time,q\n0,1\n\n1,x\n", r"line 4, column 2 \(q\): .*'x'"),
        ("time,q\n0,1_0\n", r"line 2, column 2 \(q\): .*'1_0'"),
        ("time;q\n0;1.000,5\n", r"line 2, column 2 \(q\): .*'1.000,5'"),
        ("time,q\n2026-13-01 00:00:00,1", r"line 2, column 1 \(time\): .*'2026"),
        ("time,q\n2026-01-01 00:00:00+02:00,1", r"line 2, column 1 \(time\): .*'2026"),
        ("time,q,q\n0,1,2\n", "2 columns are called 'q'"),
        ('time,q\n0,"1\n', "line 2: .*unexpected end of data"),
        (b"time,q\n0,\xff\n", "UTF-8"),
        ("time,q\n0," + "1" * 200_000, "line 2: .*field larger"),
    ],
)
def test_an_error_in_a_csv_file_has_its_line_and_column(
    text: str | bytes, message: str, tmp_path: Path
):
    with pytest.raises(InputError, match=message):
        read_table(written(tmp_path, text), ("time", "q"), exact="time")


# ---------------------------------------------------------------- NPZ


def test_an_array_of_texts_names_the_columns_of_a_matrix(tmp_path: Path):
    path = tmp_path / "t.npz"
    matrix = np.arange(6.0).reshape(3, 2)
    np.savez(path, time=np.arange(3.0), joint_names=["a", "b"], q=matrix, other=np.zeros((3, 4)))

    table = read_table(path, ["q.b"])

    assert table.names == ("time", "q.a", "q.b", *(f"other.{k}" for k in range(4)))
    assert table.columns["q.b"].tolist() == [1, 3, 5]


def test_the_labels_of_an_array_of_its_own_name_come_first(tmp_path: Path):
    path = tmp_path / "t.npz"
    np.savez(path, q=np.zeros((3, 2)), v=np.zeros((3, 2)), q_names=["a", "b"], names=["c", "d"])

    assert read_table(path, ()).names == ("q.a", "q.b", "v.0", "v.1")


def test_whole_numbers_and_dates_of_npz_are_not_rounded_and_missing_ones_are_no_times(
    tmp_path: Path,
):
    path = tmp_path / "t.npz"
    whole = np.array([1700000000123456789], dtype=np.uint64)
    date = np.array(["2026-01-01T00:00:00.5", "NaT"], dtype="datetime64[ms]")
    np.savez(path, t=whole, date=date, large=np.array([2**64 - 1], dtype=np.uint64))

    def exact(name: str) -> list[float]:
        return read_table(path, [name], exact=name).columns[name].tolist()

    assert exact("t") == whole.tolist()
    assert exact("date") == [1767225600_500_000_000, NO_TIME]
    assert exact("large") == [2.0**64]
    rounded = read_table(path, ["date"]).columns["date"]
    np.testing.assert_array_equal(rounded, [1767225600.5e9, np.nan])


def test_arrays_of_objects_are_no_columns_and_nothing_is_unpickled(tmp_path: Path):
    path = tmp_path / "t.npz"
    np.savez(path, q=np.zeros((0, 2)), made_by=np.array([{"a": 1}, print], dtype=object))

    table = read_table(path, ("q.1", "made_by"))

    assert table.names == ("q.0", "q.1")
    assert table.columns["q.1"].size == 0


def test_two_arrays_of_one_name_are_refused(tmp_path: Path):
    path = tmp_path / "t.npz"
    np.savez(path, q=np.zeros(2))
    with zipfile.ZipFile(path, "a") as archive, pytest.warns(UserWarning, match="Duplicate name"):
        archive.writestr("q.npy", archive.read("q.npy"))

    with pytest.raises(InputError, match="2 columns are called 'q'"):
        read_table(path, "q")


@pytest.mark.parametrize("shape", ["(99,)", "(9**9,)", "(-9,)"])
def test_a_header_that_promises_more_than_the_file_has_is_no_column(shape: str, tmp_path: Path):
    path = tmp_path / "t.npz"
    text = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}}}".ljust(117) + "\n"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("q.npy", b"\x93NUMPY\x01\x00\x76\x00" + text.encode() + bytes(72))

    with suppress(InputError):
        assert read_table(path, "q").names == ()


# ---------------------------------------------------------------- Parquet


def test_numbers_of_every_type_of_parquet_are_columns_and_missing_ones_are_nan(tmp_path: Path):
    path = tmp_path / "t.parquet"
    when = dt.datetime(2026, 1, 1, tzinfo=dt.UTC)
    table = {
        "t": pa.array([when, when], pa.timestamp("us", "UTC")),
        "f": pa.array([1.5, None], pa.float32()),
        "i": pa.array([1, None], pa.int8()),
        "b": pa.array([True, None]),
        "text": ["a", "b"],
        "list": [[1.0], [2.0]],
    }
    pq.write_table(pa.table(table), path)

    found = read_table(path, table, exact="t")

    assert found.names == ("t", "f", "i", "b")
    assert found.columns["t"].tolist() == [round(when.timestamp()) * 10**9] * 2
    for name, first in (("f", 1.5), ("i", 1.0), ("b", 1.0)):
        np.testing.assert_array_equal(found.columns[name], [first, np.nan])


@pytest.mark.parametrize("kind", [pa.timestamp("us", "Europe/Berlin"), pa.duration("ms")])
def test_times_of_parquet_are_nanoseconds_and_a_missing_one_is_no_time(
    kind: pa.DataType, tmp_path: Path
):
    path = tmp_path / "t.parquet"
    pq.write_table(pa.table({"t": pa.array([1700000000123, None], kind)}), path)
    first = 1700000000123 * (10**6 if pa.types.is_duration(kind) else 10**3)

    exact, rounded = (read_table(path, "t", exact=exact).columns["t"] for exact in ("t", ""))

    assert exact.tolist() == [first, NO_TIME]
    np.testing.assert_array_equal(rounded, [float(first), np.nan])


# ---------------------------------------------------------------- any format


@pytest.mark.parametrize("damage", ["flip", "cut", "garbage"])
@pytest.mark.parametrize("form", ["npz", "parquet"])
def test_damage_is_refused_or_harmless(form: str, damage: str, tmp_path: Path):
    path = WRITERS[form](tmp_path / f"t.{form}", columns())
    data = path.read_bytes()
    right = read_table(path, columns()).columns
    rng = np.random.default_rng(0)
    for _ in range(40):
        path.write_bytes(spoilt(data, damage, rng))
        with suppress(InputError):
            for name, values in read_table(path, columns()).columns.items():
                np.testing.assert_array_equal(values, right[name])


@pytest.mark.process
@pytest.mark.parametrize("form", WRITERS)
def test_another_file_is_refused(form: str, tmp_path: Path):
    path = tmp_path / f"t.{form}"
    with pytest.raises(InputError, match=f"t.{form}"):
        read_table(path, ())
    path.write_bytes(b"\x93NUMPY\x01\x00")
    with pytest.raises(InputError, match=f"t.{form}"):
        read_table(path, ())
