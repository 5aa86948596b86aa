"""Promises of a Dask cluster as workers: the same results, and an end with the remedy."""

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from selfmodel.errors import InputError
from selfmodel.experiments.grid import Cell, PartEnds, finished, processes, run_grid
from selfmodel.experiments.grid.dask_workers import dask
from selfmodel.experiments.grid.workers import OpenWorkers
from tests.helpers.grids import calls, cells

ROOT = Path(__file__).parents[3]


@pytest.fixture
def cluster(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """The address of a cluster of two worker processes on this machine."""
    distributed = pytest.importorskip("distributed")
    dask_config = pytest.importorskip("dask").config
    monkeypatch.setenv("PYTHONPATH", str(ROOT))  # of the workers
    once = {"distributed.scheduler.allowed-failures": 0}
    with (
        dask_config.set(once),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=":0", host="127.0.0.1"
        ) as local,
    ):
        yield local.scheduler_address.removeprefix("tcp://")


def run(folder: Path, wanted: list[Cell], workers: OpenWorkers) -> tuple[PartEnds, ...]:
    return run_grid(folder, wanted, workers=workers, on_progress=lambda _: None)


@pytest.mark.process
def test_a_cluster_continues_what_processes_began_and_finds_the_same(cluster: str, tmp_path: Path):
    wanted = cells(tmp_path, 6)
    assert run(tmp_path / "one", wanted, processes(1)) == ()
    assert run(tmp_path / "two", wanted[:2], processes(1)) == ()
    assert run(tmp_path / "two", wanted, dask(cluster)) == ()

    one, two = ([*finished(tmp_path / name / "runs")] for name in ("one", "two"))
    assert one == two
    assert calls(tmp_path)["run-00 result"] == 2
    assert calls(tmp_path)["need result"] == 2


@pytest.mark.process
def test_a_cell_that_kills_its_workers_is_told_and_stops_no_other(cluster: str, tmp_path: Path):
    failed = run(
        tmp_path / "study", [*cells(tmp_path, 1, crash=True), *cells(tmp_path, 3)], dask(cluster)
    )

    assert [end.key for end in failed] == ["crash-00"]
    assert "lost with its worker in 2 attempts: Attempted to run task" in str(failed[0].error)
    assert len([*finished(tmp_path / "study" / "runs")]) == 3


def test_an_address_without_a_scheduler_is_one_sentence(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    pytest.importorskip("distributed")
    monkeypatch.setattr("selfmodel.experiments.grid.dask_workers.CONNECT_SECONDS", 0.3)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]

    with pytest.raises(InputError, match=rf"no Dask scheduler answers at 127.0.0.1:{port}: start"):
        run(tmp_path, cells(tmp_path, 1), dask(f"127.0.0.1:{port}"))
