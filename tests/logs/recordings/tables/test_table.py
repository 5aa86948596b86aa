"""Promises of a table: the child process reads it."""

import os
import zipfile
from pathlib import Path

import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.logs.recordings.tables import table
from selfmodel.logs.recordings.tables.table import is_table, read_table
from tests.logs.recordings.tables.tables import WRITERS, columns


@pytest.mark.parametrize("form", WRITERS)
def test_every_format_is_the_same_table(form: str, tmp_path: Path):
    path = WRITERS[form](tmp_path / f"t.{form}", columns())

    found = read_table(path, ["time", "q_1", "nothing"])

    assert is_table(path)
    assert found.names == tuple(columns())
    assert set(found.columns) == {"time", "q_1"}
    np.testing.assert_array_equal(found.columns["q_1"], columns()["q_1"])


def test_a_missing_file_is_a_sentence(tmp_path: Path):
    for name in ("t.csv", "t.npz", "t.parquet"):
        with pytest.raises(InputError, match="expected a table that can be read, got: No such"):
            read_table(tmp_path / name, ())


def test_a_pipe_is_not_waited_for(tmp_path: Path):
    os.mkfifo(tmp_path / "t.csv")

    with pytest.raises(InputError, match="expected a table, got a pipe or a device"):
        read_table(tmp_path / "t.csv", ())


def test_a_missing_package_is_a_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(table, "find_spec", lambda _: None)

    with pytest.raises(InputError, match=r"needs pyarrow: pip install 'selfmodel\[tables\]'"):
        read_table(tmp_path / "t.parquet", ())


@pytest.mark.process
def test_a_bomb_behind_a_small_header_is_refused(tmp_path: Path):
    path = tmp_path / "t.npz"
    head = "{'descr': '<f8', 'fortran_order': False, 'shape': (2,), }".ljust(117) + "\n"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("q.npy", b"\x93NUMPY\x01\x00\x76\x00" + head.encode() + bytes(5 * 10**8))

    with pytest.raises(InputError, match="bytes follow the array q"):
        read_table(path, ["q"])
