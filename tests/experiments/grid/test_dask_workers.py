"""Promises of a Dask cluster as workers: the same results, and an end with the remedy."""

import shutil
import socket
import subprocess
from collections.abc import Callable, Iterator
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


def install(address: str, replaced: dict[str, str | None]) -> str:
    """Replaces what is installed at one worker of a cluster; None for nothing.

    Returns:
        The address of the worker.
    """
    distributed = pytest.importorskip("distributed")

    def replace() -> None:  # sent by value: the worker needs no tests
        import importlib.metadata  # noqa: PLC0415
        import sys  # noqa: PLC0415

        def version(
            package: str, installed: Callable[[str], str] = importlib.metadata.version
        ) -> str:
            there = replaced[package] if package in replaced else installed(package)
            if there is None:
                raise importlib.metadata.PackageNotFoundError(package)
            return there

        importlib.metadata.version = version
        for name in [one for one in sys.modules if one.split(".")[0] in replaced]:
            del sys.modules[name]
        sys.modules.update({one: None for one, there in replaced.items() if there is None})

    with distributed.Client(f"tcp://{address}") as client:
        worker = next(iter(client.scheduler_info()["workers"]))
        client.run(replace, workers=[worker])
    return worker


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


@pytest.mark.process
@pytest.mark.parametrize(("there", "named"), [(None, r"\(not installed\)"), ("0.0.1", "0.0.1")])
def test_a_worker_with_another_selfmodel_or_none_is_refused_by_name(
    there: str | None, named: str, cluster: str, tmp_path: Path
):
    worker = install(cluster, {"selfmodel": there})

    with pytest.raises(InputError, match=rf"the Dask worker at {worker} has selfmodel {named}, "):
        run(tmp_path / "study", cells(tmp_path, 1), dask(cluster))


@pytest.fixture
def certificate(tmp_path: Path) -> dict[str, str]:
    """Configuration of Dask with a certificate for all roles, which is its own authority."""
    if shutil.which("openssl") is None:
        pytest.skip("needs openssl, to make a certificate")
    cert, key = str(tmp_path / "cert.pem"), str(tmp_path / "key.pem")
    made = "openssl req -x509 -newkey rsa:2048 -nodes -days 2 -subj /CN=test"
    subprocess.run([*made.split(), "-out", cert, "-keyout", key], check=True, capture_output=True)
    roles = {
        f"{role}.{name}": path
        for role in ("client", "scheduler", "worker")
        for name, path in (("cert", cert), ("key", key))
    }
    return {
        f"distributed.comm.tls.{name}": path for name, path in {"ca-file": cert, **roles}.items()
    }


@pytest.mark.process
@pytest.mark.parametrize("requirement", [{"distributed.comm.require-encryption": True}, {}])
def test_a_cluster_with_tls_is_reached_by_dasks_configuration(
    requirement: dict[str, bool], certificate: dict[str, str], tmp_path: Path
):
    distributed = pytest.importorskip("distributed")
    given = {**requirement, **certificate}
    with (
        pytest.importorskip("dask").config.set(given),
        distributed.LocalCluster(
            n_workers=1, processes=False, protocol="tls", dashboard_address=":0", host="127.0.0.1"
        ) as local,
    ):
        address = local.scheduler_address
        assert address.startswith("tls://")
        assert run(tmp_path, cells(tmp_path, 1), dask(address.removeprefix("tls://"))) == ()


@pytest.mark.parametrize(
    "given",
    [
        {"distributed.comm.require-encryption": True},
        {"distributed.comm.tls.client.cert": "cert.pem"},
        {"distributed.comm.tls.client.cert": "none.pem", "distributed.comm.tls.ca-file": "no.pem"},
    ],
)
def test_an_incomplete_configuration_of_tls_is_one_sentence(given: dict, tmp_path: Path):
    pytest.importorskip("distributed")
    with (
        pytest.importorskip("dask").config.set(given),
        pytest.raises(InputError, match=r"expected distributed.comm.tls.ca-file, .*, got "),
    ):
        run(tmp_path, cells(tmp_path, 1), dask("127.0.0.1:1"))


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
