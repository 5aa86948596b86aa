"""Promises of cells on a disk that fails: one sentence with the file's name, nothing is lost."""

import errno
import os
import resource
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from selfmodel.experiments.grid import Cell, PartEnds, finished, processes, run_grid
from selfmodel.experiments.grid.cell_runner import CellAnswer, Outcome, run_cell
from selfmodel.logs import result_files
from tests.experiments.kill_study import STUDIES, files_of, rows_of
from tests.helpers.command import selfmodel_process

ROOT = Path(__file__).parents[3]
KEPT = "run the command again; files that were finished before are kept"


@pytest.fixture(autouse=True)
def _found_by_the_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT))


def work(cell: Cell, _needs: dict[str, Path], folder: Path) -> int:
    """Fails as its cell requests, unless the study's folder has a file ``free``."""
    match "" if (folder.parents[2] / "free").exists() else cell.parameters["fails"]:
        case "in the work":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(folder / "trial.mcap"))
        case "without a name":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        case "as its result is written":
            os.fsync = full  # of this worker process alone
        case "at the size limit":
            resource.setrlimit(resource.RLIMIT_FSIZE, (100, resource.RLIM_INFINITY))
        case "unforeseen":
            raise ZeroDivisionError("two\nlines")
    return cell.seed


def full(_descriptor: int) -> None:
    """Replacement of ``os.fsync`` on a full disk."""
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def cells(fails: str) -> list[Cell]:
    """Three cells, of which the second one fails."""
    function = "tests.experiments.grid.test_cell_runner:work"
    return [
        Cell(function, f"run-{seed}", {"fails": fails if seed == 1 else ""}, seed)
        for seed in range(3)
    ]


def run(folder: Path, fails: str) -> tuple[PartEnds, ...]:
    return run_grid(folder, cells(fails), workers=processes(1), on_progress=lambda _: None)


@pytest.mark.parametrize(
    ("fails", "sentence"),
    [
        ("as its result is written", r"runs/run-1-result-\w+\.\w+/cell\.json: the disk is full"),
        *(
            pytest.param(*case, marks=pytest.mark.process)
            for case in (
                ("in the work", r"runs/run-1-result-\w+\.\w+/trial\.mcap: the disk is full"),
                ("without a name", r"runs/run-1-result-\w+\.\w+: the disk is full"),
                (
                    "at the size limit",
                    r"runs/run-1-result-\w+\.\w+/cell\.json: the file has reached",
                ),
            )
        ),
    ],
)
def test_a_disk_that_fails_ends_a_grid_which_is_continued(
    fails: str, sentence: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    with pytest.raises(OSError, match=sentence) as caught:
        run(tmp_path, fails)
    assert str(caught.value).startswith(str(tmp_path))
    assert "files that were finished before are kept" in str(caught.value)
    assert "Traceback" not in capfd.readouterr().err
    assert [part.result for part in finished(tmp_path / "runs")] == [0]
    assert not [*tmp_path.rglob("*.part"), *tmp_path.glob("unfinished/*/*")]

    (tmp_path / "free").touch()
    assert run(tmp_path, fails) == ()
    assert [part.result for part in finished(tmp_path / "runs")] == [0, 1, 2]


@pytest.mark.process
def test_the_traceback_of_an_unforeseen_error_is_in_a_file(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    (failed,) = run(tmp_path, "unforeseen")
    (path,) = (tmp_path / "errors").iterdir()

    assert failed.error == (
        f"an unexpected error, ZeroDivisionError: two lines; its traceback is in {path}"
    )
    assert "in work\n    raise ZeroDivisionError" in path.read_text()
    assert "Traceback" not in capfd.readouterr().err
    assert [part.result for part in finished(tmp_path / "runs")] == [0, 2]


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Callable[[int], Path]]:
    """Function that limits the size of a folder, KiB; skips where only root may do that."""
    folder = tmp_path / "disk"
    folder.mkdir()

    def mount(options: str) -> int:
        command = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)]
        return subprocess.run(command, check=False, capture_output=True).returncode

    if os.geteuid() or mount("size=4m"):
        pytest.skip("no small disk, which only root can mount: run this test as root on Linux")

    def resize(kib: int) -> Path:
        assert mount(f"remount,size={kib}k") == 0
        return folder

    yield resize
    subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.process
@pytest.mark.parametrize("study", ["suite run"])
def test_a_study_on_a_full_disk_is_continued_to_the_same_table(
    study: str, small_disk: Callable[[int], Path], tmp_path: Path
):
    def run_study(folder: Path) -> subprocess.CompletedProcess[str]:
        return selfmodel_process(*STUDIES[study], "--out", "out", cwd=folder)

    assert run_study(tmp_path).returncode == 0
    for kib in (12, 220):
        disk = small_disk(kib)
        stopped = run_study(disk)
        error = stopped.stderr.splitlines()[-1]
        assert (stopped.returncode, stopped.stdout) == (1, ""), stopped.stderr
        assert error.startswith("error: out/"), error
        assert error.endswith(KEPT), error
        assert "Traceback" not in stopped.stderr
    resumed = run_study(small_disk(4096))

    assert resumed.returncode == 0, resumed.stderr
    assert rows_of(disk) == rows_of(tmp_path)
    assert files_of(disk / "out") == files_of(tmp_path / "out")


def meanwhile(cell: Cell, _needs: dict[str, Path], folder: Path) -> int:
    """Ends after another worker has finished, or damaged, the same cell."""
    study = folder.parents[2]
    if cell.parameters["damaged"]:
        (study / cell.place).mkdir(parents=True)
        (study / cell.place / "cell.json").write_text("{")
    elif not (study / "began").exists():
        (study / "began").touch()
        assert answer(study, cell).outcome is Outcome.DONE
    return cell.seed


def answer(study: Path, cell: Cell) -> CellAnswer:
    return run_cell(study, cell, cell.place, result_files.versions())


def computed_twice(*, damaged: bool) -> Cell:
    function = "tests.experiments.grid.test_cell_runner:meanwhile"
    return Cell(function, "run", {"damaged": damaged}, 3)


def test_a_cell_that_another_worker_finished_first_is_done(tmp_path: Path):
    assert answer(tmp_path, computed_twice(damaged=False)).outcome is Outcome.DONE
    assert [each.result for each in finished(tmp_path / "runs")] == [3]


def test_a_cell_that_was_damaged_meanwhile_fails_with_the_name_of_its_file(tmp_path: Path):
    found = answer(tmp_path, computed_twice(damaged=True))

    assert found.outcome is Outcome.FAILED
    assert "cell.json" in str(found.error)
