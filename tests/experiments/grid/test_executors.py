"""Promises of executors by name: a wrong name or option is refused before anything is computed."""

import sys
from pathlib import Path

import pytest

from selfmodel.errors import InputError
from selfmodel.experiments.grid.executors import choose_workers


@pytest.mark.parametrize(
    ("executor", "options", "reason"),
    [
        ("slrum", {}, "unknown executor 'slrum': did you mean slurm"),
        ("dask", {}, "the known ones are processes, slurm, dask://HOST:PORT"),
        ("processes", {"partition": "cpu"}, "expected --executor-option with --executor slurm"),
        ("dask://host:8786", {"partition": "cpu"}, "alone, got it with dask://host:8786"),
    ],
)
def test_a_wrong_executor_is_refused(executor: str, options: dict, reason: str, tmp_path: Path):
    with pytest.raises(InputError, match=reason):
        choose_workers(executor, options, 2, tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("executor", "package", "extra"),
    [("dask://127.0.0.1:1", "distributed", "dask"), ("slurm", "submitit", "slurm")],
)
def test_an_executor_without_its_package_names_the_extra(
    executor: str, package: str, extra: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setitem(sys.modules, package, None)

    with (
        pytest.raises(InputError, match=rf"package {package}: pip install 'selfmodel\[{extra}\]'"),
        choose_workers(executor, {}, 2, tmp_path),
    ):
        pass
