"""Promises of Parquet files: numbers of every type are read, damage is a sentence."""

import datetime as dt
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from selfmodel.errors import InputError
from selfmodel.logs.recordings.tables.content import NO_TIME
from tests.logs.recordings.tables.tables import columns, read_here, write_parquet


def test_numbers_of_every_type_are_columns_and_missing_ones_are_nan(tmp_path: Path):
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

    names, found = read_here(path, *table, exact="t")

    assert names == ["t", "f", "i", "b"]
    assert found["t"].tolist() == [round(when.timestamp()) * 10**9] * 2
    for name, first in (("f", 1.5), ("i", 1.0), ("b", 1.0)):
        np.testing.assert_array_equal(found[name], [first, np.nan])


@pytest.mark.parametrize("kind", [pa.timestamp("us", "Europe/Berlin"), pa.duration("ms")])
def test_times_are_nanoseconds_and_a_missing_one_is_no_time(kind: pa.DataType, tmp_path: Path):
    path = tmp_path / "t.parquet"
    pq.write_table(pa.table({"t": pa.array([1700000000123, None], kind)}), path)
    first = 1700000000123 * (10**6 if pa.types.is_duration(kind) else 10**3)

    exact, rounded = (read_here(path, "t", exact=exact)[1]["t"] for exact in ("t", ""))

    assert exact.tolist() == [first, NO_TIME]
    np.testing.assert_array_equal(rounded, [float(first), np.nan])


@pytest.mark.parametrize("place", [0, 500, -30, -1])
def test_damage_is_refused(place: int, tmp_path: Path):
    path = write_parquet(tmp_path / "t.parquet", columns())
    data = bytearray(path.read_bytes())
    data[place : place + 20 if place != -1 else None] = b"\xff" * 20
    path.write_bytes(data)

    with pytest.raises(InputError, match="expected a Parquet file, got: "):
        read_here(path, *columns())
