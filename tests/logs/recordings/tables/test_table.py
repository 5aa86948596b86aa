"""Promises of a table: the child process reads it, within the budget."""

import os
import zipfile
from pathlib import Path

import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.logs.recordings.tables import table
from selfmodel.logs.recordings.tables.table import is_table, read_table
from selfmodel.sandbox.budget import Budget, BudgetError
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
def test_a_line_without_end_is_refused_within_the_budget(tmp_path: Path):
    path = tmp_path / "t.csv"
    with path.open("wb") as file:
        for _ in range(300):
            file.write(b"a," * 10**6)

    with pytest.raises(InputError, match=r"without a line end|takes more than"):
        read_table(path, ["a"])


@pytest.mark.process
def test_many_labels_do_not_fill_the_memory(tmp_path: Path):
    path = tmp_path / "t.npz"
    np.savez_compressed(path, names=np.array(["x"] * 10**6), q=np.zeros((1, 10**6)))

    with pytest.raises(BudgetError, match="more than 100 columns"):
        read_table(path, ["q.0"], Budget(memory=10**7))


@pytest.mark.process
def test_a_bomb_behind_a_small_header_is_refused(tmp_path: Path):
    path = tmp_path / "t.npz"
    head = "{'descr': '<f8', 'fortran_order': False, 'shape': (2,), }".ljust(117) + "\n"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("q.npy", b"\x93NUMPY\x01\x00\x76\x00" + head.encode() + bytes(5 * 10**8))

    with pytest.raises(InputError, match="bytes follow the array q"):
        read_table(path, ["q"])
