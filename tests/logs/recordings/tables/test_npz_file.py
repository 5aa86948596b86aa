"""Promises of NPZ files: columns by array and label; nothing is unpickled, nothing explodes."""

import zipfile
from pathlib import Path

import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.logs.recordings.tables.content import NO_TIME
from tests.logs.recordings.tables.tables import read_here


def test_an_array_of_texts_names_the_columns_of_a_matrix(tmp_path: Path):
    path = tmp_path / "t.npz"
    matrix = np.arange(6.0).reshape(3, 2)
    np.savez(path, time=np.arange(3.0), joint_names=["a", "b"], q=matrix, other=np.zeros((3, 4)))

    names, found = read_here(path, "q.b")

    assert names == ["time", "q.a", "q.b", *(f"other.{k}" for k in range(4))]
    assert found["q.b"].tolist() == [1, 3, 5]


def test_the_labels_of_an_array_of_its_own_name_come_first(tmp_path: Path):
    path = tmp_path / "t.npz"
    np.savez(path, q=np.zeros((3, 2)), v=np.zeros((3, 2)), q_names=["a", "b"], names=["c", "d"])

    assert read_here(path)[0] == ["q.a", "q.b", "v.0", "v.1"]


def test_integers_and_dates_of_the_exact_column_are_not_rounded(tmp_path: Path):
    path = tmp_path / "t.npz"
    exact = np.array([1700000000123456789], dtype=np.uint64)
    np.savez(path, t=exact, date=exact.astype("datetime64[ns]"))

    assert read_here(path, "t", exact="t")[1]["t"].tolist() == exact.tolist()
    assert read_here(path, "date", exact="date")[1]["date"].tolist() == exact.tolist()


def test_dates_and_durations_are_nanoseconds_and_missing_ones_are_no_times(tmp_path: Path):
    path = tmp_path / "t.npz"
    date = np.array(["2026-01-01T00:00:00.5", "NaT"], dtype="datetime64[ms]")
    np.savez(path, date=date, duration=date - date[0])

    exact = read_here(path, "date", exact="date")[1]["date"]
    rounded = read_here(path, "date", "duration")[1]

    assert exact.tolist() == [1767225600_500_000_000, NO_TIME]
    np.testing.assert_array_equal(rounded["date"], [1767225600.5e9, np.nan])
    np.testing.assert_array_equal(rounded["duration"], [0.0, np.nan])


def test_arrays_without_rows_are_columns_without_numbers(tmp_path: Path):
    path = tmp_path / "t.npz"
    np.savez(path, t=np.zeros(0), q=np.zeros((0, 2)))

    names, found = read_here(path, "t", "q.1")

    assert names == ["t", "q.0", "q.1"]
    assert found["t"].size == found["q.1"].size == 0


def test_two_arrays_of_one_name_are_refused(tmp_path: Path):
    path = tmp_path / "t.npz"
    np.savez(path, q=np.zeros(2))
    with zipfile.ZipFile(path, "a") as archive, pytest.warns(UserWarning, match="Duplicate name"):
        archive.writestr("q.npy", archive.read("q.npy"))

    with pytest.raises(InputError, match="the columns 1 and 2 are both called 'q'"):
        read_here(path, "q")


def test_objects_are_no_columns(tmp_path: Path):
    path = tmp_path / "t.npz"
    np.savez(path, q=np.zeros(2), made_by=np.array([{"a": 1}, print], dtype=object))

    assert read_here(path, "q", "made_by")[0] == ["q"]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"no archive", "expected an NPZ file of arrays of numbers, got: File is not a zip file"),
        (b"\x93NUMPY\x01\x00", "expected an NPZ file"),
    ],
)
def test_another_file_is_refused(content: bytes, message: str, tmp_path: Path):
    path = tmp_path / "t.npz"
    path.write_bytes(content)

    with pytest.raises(InputError, match=message):
        read_here(path, "q")


def test_a_damaged_array_is_refused(tmp_path: Path):
    path = tmp_path / "t.npz"
    np.savez(path, q=np.zeros(100))
    data = bytearray(path.read_bytes())
    data[400] ^= 1
    path.write_bytes(data)

    with pytest.raises(InputError, match="Bad CRC-32"):
        read_here(path, "q")


def test_labels_of_many_characters_are_no_labels(tmp_path: Path):
    path = tmp_path / "t.npz"
    np.savez(path, q=np.zeros((2, 2)), q_names=["a", "b" * 1001])

    assert read_here(path)[0] == ["q.0", "q.1"]


def test_whole_numbers_beyond_int64_are_rounded(tmp_path: Path):
    path = tmp_path / "t.npz"
    np.savez(path, t=np.array([2**64 - 1], dtype=np.uint64))

    assert read_here(path, "t", exact="t")[1]["t"].tolist() == [2.0**64]


def test_a_header_that_promises_more_than_the_file_has_is_refused(tmp_path: Path):
    path, header = tmp_path / "t.npz", b"{'descr': '<f8', 'fortran_order': False, 'shape': (9,)}"
    for shape, message in (
        (b"(99,)", "expected an NPZ file"),
        (b"(9**9,)", "expected an NPZ"),
        (b"(-9,)", "array of the shape"),
    ):
        text = header.replace(b"(9,)", shape).ljust(117) + b"\n"
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("q.npy", b"\x93NUMPY\x01\x00\x76\x00" + text + bytes(72))
        with pytest.raises(InputError, match=message):
            read_here(path, "q")
