"""Promises of jobs as workers, by submitit's local executor: the same results, errors in words."""

import dataclasses
import shutil
from contextlib import nullcontext
from pathlib import Path

import pytest

from selfmodel.errors import InputError
from selfmodel.experiments.grid import finished, processes, run_grid
from selfmodel.experiments.grid.slurm_workers import parameter, slurm
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


def test_an_unknown_option_is_one_sentence(tmp_path: Path):
    workers = slurm({**LOCAL, "nodez": "2"}, 1, tmp_path)

    with pytest.raises(InputError, match=r"jobs of Slurm: .*nodez"):
        run_grid(tmp_path, cells(tmp_path, 1), workers=workers, on_progress=lambda _: None)
