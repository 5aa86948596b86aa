"""Promises of jobs as workers, by submitit's local executor: the same results, errors in words."""

import dataclasses
import errno
import shutil
from concurrent.futures import BrokenExecutor
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import pytest

from selfmodel.errors import InputError
from selfmodel.experiments.grid import finished, processes, run_grid
from selfmodel.experiments.grid.slurm_workers import _JobExecutor, parameter, slurm
from selfmodel.experiments.grid.workers import OpenWorkers
from tests.helpers.grids import calls, cells

ROOT = Path(__file__).parents[3]
LOCAL = {"cluster": "local", "timeout": "00:05:00"}


@pytest.fixture(autouse=True)
def _found_by_the_jobs(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("submitit")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.syspath_prepend(str(ROOT))


@pytest.mark.process
def test_jobs_continue_what_processes_began_and_find_the_same(tmp_path: Path):
    def run(folder: Path, workers: OpenWorkers, count: int) -> None:
        wanted = cells(tmp_path, count)
        assert run_grid(folder, wanted, workers=workers, on_progress=lambda _: None) == ()

    run(tmp_path / "one", processes(1), 3)
    run(tmp_path / "two", processes(1), 1)
    run(tmp_path / "two", slurm(LOCAL, 2, tmp_path / "two"), 3)

    one, two = ([*finished(tmp_path / name / "runs")] for name in ("one", "two"))
    assert one == two
    assert calls(tmp_path)["run-00 result"] == 2


@pytest.mark.process
def test_a_job_that_ends_without_an_answer_is_told_with_its_output(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("submitit.core.core.Job._results_timeout_s", 0)
    with slurm(LOCAL, 1, tmp_path / "study") as workers:
        (failed,) = run_grid(
            tmp_path / "study",
            cells(tmp_path, 1, crash=True),
            workers=nullcontext(dataclasses.replace(workers, attempts=1)),
            on_progress=lambda _: None,
        )

    assert "ended without an answer" in str(failed.error)
    assert str(tmp_path / "study" / "slurm") in str(failed.error)


@pytest.mark.skipif(shutil.which("sbatch") is not None, reason="this machine has Slurm")
def test_a_machine_without_slurm_is_one_sentence(tmp_path: Path):
    workers = slurm({"partition": "cpu"}, 1, tmp_path)

    with pytest.raises(InputError, match=r"jobs of Slurm: Could not detect \"srun\""):
        run_grid(tmp_path, cells(tmp_path, 1), workers=workers, on_progress=lambda _: None)


def test_options_are_those_of_sbatch_and_of_submitit():
    assert parameter("timeout", "04:00:30") == ("timeout_min", 241)
    assert parameter("partition", "cpu") == ("slurm_partition", "cpu")
    assert parameter("mem_gb", "4") == ("mem_gb", 4)
    with pytest.raises(InputError, match="expected timeout=HH:MM:SS, such as"):
        parameter("timeout", "4h")


def test_numbers_of_options_are_checked():
    assert parameter("mem_gb", "1.5") == ("mem_gb", 1.5)
    assert parameter("timeout_min", "240") == ("timeout_min", 240)
    for value in ("4GB", "0", "nan", "inf"):
        with pytest.raises(InputError, match=rf"expected mem_gb as a number of GB.*got {value}"):
            parameter("mem_gb", value)
    with pytest.raises(InputError, match=r"expected timeout_min as a positive .*minutes.*got x"):
        parameter("timeout_min", "x")
    with pytest.raises(InputError, match=r"expected nodes as a positive whole number.*got 1\.5"):
        parameter("nodes", "1.5")


class FailingJob:
    """Job whose first checks fail, as on a network file system."""

    job_id = "7"
    paths = SimpleNamespace(stderr="7.err")

    def __init__(self, failures: int) -> None:
        self.failures = failures
        self.cancelled = False

    def done(self) -> bool:
        """Fails, or has ended."""
        self.failures -= 1
        if self.failures >= 0:
            raise OSError(errno.ESTALE, "Stale file handle")
        return True

    def result(self) -> str:
        """Returns the answer."""
        return "answer"

    def cancel(self, *, check: bool) -> None:
        """Notes the call."""
        assert not check
        self.cancelled = True


def test_a_job_that_cannot_be_checked_for_a_moment_still_gives_its_answer(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr("selfmodel.experiments.grid.slurm_workers.POLL_SECONDS", 0.01)
    jobs = [FailingJob(failures=5), FailingJob(failures=0)]
    waiting = list(jobs)
    with _JobExecutor(SimpleNamespace(submit=lambda *_: waiting.pop(0))) as executor:
        futures = [executor.submit(print) for _ in jobs]
        assert [future.result(timeout=60) for future in futures] == ["answer", "answer"]


def test_a_job_that_can_never_be_checked_is_lost_and_cancelled(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("selfmodel.experiments.grid.slurm_workers.POLL_SECONDS", 0.01)
    monkeypatch.setattr("selfmodel.experiments.grid.slurm_workers.MAX_FAILED_CHECKS", 3)
    job = FailingJob(failures=10**9)
    with _JobExecutor(SimpleNamespace(submit=lambda *_: job)) as executor:
        error = executor.submit(print).exception(timeout=60)

    assert isinstance(error, BrokenExecutor)
    assert "job 7 could not be checked 3 times in a row: OSError: [Errno 116] Stale" in str(error)
    assert job.cancelled


def test_an_unknown_option_is_one_sentence(tmp_path: Path):
    workers = slurm({**LOCAL, "nodez": "2"}, 1, tmp_path)

    with pytest.raises(InputError, match=r"jobs of Slurm: .*nodez"):
        run_grid(tmp_path, cells(tmp_path, 1), workers=workers, on_progress=lambda _: None)
