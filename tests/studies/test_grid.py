"""Promises of a grid: nothing is done twice, nothing is lost, and one failure stops no other."""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from selfmodel.errors import InputError, WorkError
from selfmodel.studies import cells as cell_files, grid
from selfmodel.studies.cells import CELL, Cell, finished
from selfmodel.studies.grid import CellEnds, GridBegins, dask_executor, run_grid
from selfmodel.studies.tables import write_files
from tests.helpers.code_blocks import blocks
from tests.helpers.grids import calls, cell, cells, shared

ROOT = Path(__file__).parents[2]
LIMIT = 300
"""Longest wait for another process, s: on a machine with other work, a start takes a minute."""

SCRIPT = """
import sys
from pathlib import Path
from selfmodel.studies.grid import run_grid
from tests.helpers.grids import cells

if __name__ == "__main__":
    folder = Path(sys.argv[1])
    run_grid(folder / "study", cells(folder, 6, seconds=0.3), workers=2, on_event=print)
"""


@dataclass
class Study:
    """A folder in which cells are computed by threads of this process, with the events."""

    notes: Path
    threads: ThreadPoolExecutor
    events: list = field(default_factory=list)

    @property
    def folder(self) -> Path:
        """Folder of the cells."""
        return self.notes / "study"

    def run(self, wanted: Sequence[Cell], **options: object) -> tuple[CellEnds, ...]:
        """Computes cells, by threads unless options have another executor."""
        given = options or {"executor": self.threads}
        return run_grid(self.folder, wanted, on_event=self.events.append, warns=False, **given)

    def names(self) -> list[str]:
        """Names of the finished cells."""
        return [one.name for one in finished(self.folder / "runs")]

    def numbers(self) -> list[int]:
        """Results of the finished cells."""
        return [one.result["number"] for one in finished(self.folder / "runs")]


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Study]:
    monkeypatch.syspath_prepend(str(ROOT))  # of the workers
    with ThreadPoolExecutor(2) as threads:
        yield Study(tmp_path, threads)


def named(count: int) -> list[str]:
    return [f"run-{seed:02d}" for seed in range(count)]


def test_a_grid_computes_every_cell_once_and_not_again(study: Study):
    wanted = cells(study.notes, 6)

    assert (study.run(wanted), study.run(wanted)) == ((), ())
    assert calls(study.notes) == dict.fromkeys(named(6), 1)
    begin, *ends, again = study.events
    assert (begin, again) == (GridBegins(6, 0), GridBegins(6, 6))
    assert [(end.number, end.error, end.seconds > 0) for end in ends] == [
        (number, None, True) for number in range(1, 7)
    ]
    assert sorted(end.name for end in ends) == named(6)
    assert [path.name for path in study.folder.iterdir()] == ["runs"]


@pytest.mark.process
def test_the_results_are_those_of_any_executor(study: Study):
    study.run(cells(study.notes, 4))
    by_threads = [*finished(study.folder / "runs")]
    shutil.rmtree(study.folder)
    study.run(cells(study.notes, 4), workers=2)

    assert [*finished(study.folder / "runs")] == by_threads
    assert study.numbers() == [0, 10, 20, 30]


def test_a_cell_that_others_need_is_computed_once_before_them(study: Study):
    study.run(shared(study.notes))

    assert study.events[0] == GridBegins(total=4, finished=0)
    assert study.events[1].name == "need"
    assert calls(study.notes)["need"] == 1
    assert study.numbers() == [5, 15, 25]


def test_a_needed_cell_without_its_files_is_computed_again_only_if_it_is_needed(study: Study):
    first, *others = shared(study.notes)
    study.run([first])
    (study.folder / first.needs["0"].place / "number.txt").unlink()
    study.run([first])
    assert calls(study.notes)["need"] == 1

    assert study.run(others) == ()
    assert calls(study.notes) == {"need": 2, "run-0": 1, "run-1": 1, "run-2": 1}


@pytest.mark.parametrize(
    ("fails", "words"),
    [("foreseen", "the cause and the cure"), ("bug", "an unexpected error, ZeroDivisionError")],
)
def test_a_failure_is_kept_stops_no_other_and_is_tried_again(study: Study, fails: str, words: str):
    wanted = [*shared(study.notes, fails=fails), *cells(study.notes, 2)]
    failed = {end.name: str(end.error) for end in study.run(wanted)}
    (file,) = (study.folder / "errors").iterdir()

    assert words in failed.pop("need")
    assert failed == dict.fromkeys(
        ("run-0", "run-1", "run-2"), "not computed: it needs need, which failed"
    )
    assert ("Traceback" in file.read_text()) == (fails == "bug")
    assert study.names() == named(2)
    assert set(calls(study.notes)) == {"need", *named(2)}
    if fails == "foreseen":
        (study.notes / "mended").touch()
        assert study.run(wanted) == ()
        assert not list((study.folder / "errors").iterdir())


@pytest.mark.process
def test_a_crash_costs_its_own_cell_alone(study: Study):
    wanted = [cell(study.notes, "bad", fails="crash"), *cells(study.notes, 4, seconds=0.2)]
    (failed,) = study.run(wanted, workers=2)

    assert failed.name == "bad"
    assert "its process ended in each of 2 attempts" in str(failed.error)
    assert study.names() == named(4)
    assert calls(study.notes) == {"bad": 2, **dict.fromkeys(named(4), 1)}


@pytest.mark.parametrize("left", ["nothing", "its other files"])
def test_a_cell_whose_result_was_deleted_is_computed_again(study: Study, left: str):
    wanted = cells(study.notes, 2)
    study.run(wanted)
    place = study.folder / wanted[1].place
    if left == "nothing":
        shutil.rmtree(place)
    else:
        (place / CELL).unlink()

    assert study.run(wanted) == ()
    assert calls(study.notes) == {"run-00": 1, "run-01": 2}
    assert study.names() == named(2)


def test_what_a_killed_worker_left_is_no_cell(study: Study):
    wanted = cells(study.notes, 2)
    study.run(wanted[:1])
    place = study.folder / wanted[0].place
    shutil.copytree(place, study.folder / "unfinished" / f"{place.name}.0123456789abcdef")

    assert study.run(wanted) == ()
    assert study.names() == named(2)


def test_other_inputs_and_other_code_are_other_cells(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (one,), (other,) = cells(tmp_path, 1), cells(tmp_path, 1, more=1)
    assert one.place == cells(tmp_path, 1)[0].place != other.place

    made = []
    for package in (ROOT / "comparators", tmp_path):
        monkeypatch.setattr(cell_files, "PACKAGE", package)
        made.append(cell_files.package_versions.__wrapped__()["code"])
    assert len(set(made)) == 2


def test_a_study_of_other_code_is_neither_continued_nor_mixed_nor_computed_by_a_worker(
    study: Study, monkeypatch: pytest.MonkeyPatch
):
    study.run(cells(study.notes, 1))
    (later,), other = cells(study.notes, 2)[1:], study.notes / "other"
    made = {**cell_files.package_versions(), "code": "other"}
    with pytest.raises(InputError, match=r"the worker on .* has .*, the command has .*code other"):
        cell_files.compute(other, later, {**later.made_with(), **made})
    monkeypatch.setattr(cell_files, "package_versions", lambda: made)
    with pytest.raises(InputError, match=r"run-00.* was made with .*code.*, installed are .*other"):
        study.run([later])
    assert calls(study.notes) == {"run-00": 1}

    later = cells(study.notes, 2)[1:]
    run_grid(other, later, executor=study.threads)
    shutil.copytree(other / later[0].place, study.folder / later[0].place)
    with pytest.raises(InputError, match="a table is of one version of each"):
        study.names()


@pytest.mark.parametrize("name", ["", "..", "a/b", ".hidden", "a b"])
def test_a_name_that_cannot_name_a_folder_is_refused(name: str):
    with pytest.raises(ValueError, match="a name that is a valid folder name"):
        Cell("a:b", name, {})


def test_no_link_in_the_folder_of_a_study_is_followed(study: Study):
    (wanted,) = cells(study.notes, 1)
    precious, place = study.notes / "precious", study.folder / wanted.place
    precious.mkdir()
    (precious / "number.txt").write_text("mine")
    place.parent.mkdir(parents=True)
    place.symlink_to(precious)
    with pytest.raises(OSError, match="cannot be written"):
        study.run([wanted])

    place.unlink()
    place.parent.rmdir()
    place.parent.symlink_to(precious)
    with pytest.raises(InputError, match="got a link"):
        study.run([wanted])
    (study.folder / "tables").symlink_to(precious)
    with pytest.raises(InputError, match="got a link"):
        write_files(study.folder, {"tables/gap.csv": b"new"})

    assert (precious / "number.txt").read_text() == "mine"
    assert [path.name for path in precious.iterdir()] == ["number.txt"]


@pytest.fixture(scope="module")
def one_cell(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a finished cell."""
    folder = tmp_path_factory.mktemp("study")
    with ThreadPoolExecutor(1) as executor:
        run_grid(folder, cells(folder, 1), executor=executor)
    return next(folder.glob("runs/*/cell.json"))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
@given(place=st.floats(0, 1, exclude_max=True), value=st.integers(1, 255))
def test_no_damage_of_a_cell_goes_unnoticed(
    one_cell: Path, tmp_path: Path, place: float, value: int
):
    data = bytearray(one_cell.read_bytes())
    content = json.loads(data)
    data[int(place * len(data))] ^= value
    copy = tmp_path / "runs" / one_cell.parent.name / CELL
    copy.parent.mkdir(parents=True, exist_ok=True)
    copy.write_bytes(data)
    message = ""
    try:
        results = [one.result for one in finished(tmp_path / "runs")]
    except InputError as error:
        message = str(error)
    if message:
        assert str(copy) in message
        assert "its folder" in message
    else:
        assert results == [content["result"]]


def test_a_cell_under_the_name_of_another_is_refused(one_cell: Path, tmp_path: Path):
    shutil.copytree(one_cell.parent, tmp_path / "runs" / "run-01-0123456789abcdef")

    with pytest.raises(InputError, match="was altered or damaged, or its folder renamed"):
        list(finished(tmp_path / "runs"))


def test_a_full_disk_and_an_executor_that_has_ended_end_the_grid(
    study: Study, monkeypatch: pytest.MonkeyPatch
):
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device", "cell.json")

    with monkeypatch.context() as patched:
        patched.setattr(cell_files, "replace_file", full)
        with pytest.raises(OSError, match="No space left"):
            study.run(cells(study.notes, 3, seconds=0.05))
    assert not study.names(), "a cell went on after the end of the grid"
    study.threads.shutdown()
    with pytest.raises(WorkError, match=r"takes no more cells .* the same command continues"):
        study.run(cells(study.notes, 1))


@pytest.fixture
def started(study: Study) -> "Iterator[subprocess.Popen[bytes]]":
    """A slow grid in a process group of its own, after its first result."""
    (study.notes / "script.py").write_text(SCRIPT)
    process = subprocess.Popen(
        [sys.executable, study.notes / "script.py", study.notes],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    limit = time.monotonic() + LIMIT
    while not list(study.notes.glob("study/runs/*/cell.json")):
        assert process.poll() is None
        assert time.monotonic() < limit
        time.sleep(0.05)
    yield process
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)


@pytest.mark.process
def test_a_grid_that_was_killed_goes_on_where_it_was(
    study: Study, started: "subprocess.Popen[bytes]"
):
    started.kill()
    started.communicate(timeout=LIMIT)
    done = study.names()
    assert 0 < len(done) < 6

    study.run(cells(study.notes, 6, seconds=0.3), workers=2)
    assert study.names() == named(6)
    assert all(calls(study.notes)[name] == 1 for name in done)


@pytest.mark.process
def test_an_interrupt_ends_every_process_at_once_and_quietly(
    study: Study, started: "subprocess.Popen[bytes]"
):
    os.killpg(started.pid, signal.SIGINT)  # a terminal's Ctrl-C reaches the workers too
    _, told = started.communicate(timeout=LIMIT)  # ends when the last of them has closed it
    begun = calls(study.notes).total()
    time.sleep(0.5)

    assert told.count(b"Traceback") == 1  # the script's own KeyboardInterrupt
    assert calls(study.notes).total() == begun < 6


@pytest.mark.process
def test_two_commands_at_one_study_agree(study: Study, started: "subprocess.Popen[bytes]"):
    failed = study.run(cells(study.notes, 6, seconds=0.3), workers=2)
    out, _ = started.communicate(timeout=LIMIT)

    assert (failed, started.returncode) == ((), 0)
    assert study.names() == named(6)
    assert max(calls(study.notes).values()) <= 2
    assert not (study.folder / "unfinished").exists()
    assert b"a plug-in may print" not in out


@pytest.mark.process
def test_a_cluster_continues_what_processes_began_and_loses_a_crash_alone(
    study: Study, monkeypatch: pytest.MonkeyPatch
):
    distributed = pytest.importorskip("distributed", reason="needs the extra dask")
    config = pytest.importorskip("dask").config
    monkeypatch.setenv("PYTHONPATH", str(ROOT))  # of the workers
    wanted = cells(study.notes, 6)
    study.run(wanted[:2], workers=1)
    place = {"dashboard_address": ":0", "host": "127.0.0.1"}
    with (
        config.set({"distributed.scheduler.allowed-failures": 0}),
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, **place) as cluster,
        dask_executor(cluster.scheduler_address.removeprefix("tcp://")) as executor,
    ):
        assert study.run(wanted, executor=executor) == ()
        (failed,) = study.run([cell(study.notes, "bad", fails="crash")], executor=executor)

    assert study.names() == named(6)
    assert set(calls(study.notes).values()) == {1}
    assert (failed.name, "the executor failed" in str(failed.error)) == ("bad", True)


@pytest.mark.process
@pytest.mark.parametrize("answers", [False, True], ids=["nobody", "a mute server"])
def test_a_scheduler_that_does_not_answer_ends_the_command(
    *, answers: bool, monkeypatch: pytest.MonkeyPatch
):
    pytest.importorskip("distributed", reason="needs the extra dask")
    monkeypatch.setattr(grid, "CONNECT_SECONDS", 1)
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        if answers:
            server.listen()
        address = f"127.0.0.1:{server.getsockname()[1]}"
        with (
            pytest.raises(InputError, match=f"no Dask scheduler answers at {address}"),
            dask_executor(address),
        ):
            pass


@pytest.mark.process
def test_a_scheduler_that_goes_mute_ends_the_study(study: Study, monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("distributed", reason="needs the extra dask")
    monkeypatch.setattr(grid, "PING_SECONDS", 0.2)
    file, module = study.notes / "scheduler.json", "distributed.cli.dask_scheduler"
    options = ("--port", "0", "--no-dashboard", "--host", "127.0.0.1", "--scheduler-file", file)
    command = [sys.executable, "-m", module, *options]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as scheduler:
        try:
            while not file.exists() or not file.read_text():
                time.sleep(0.05)
            with dask_executor(json.loads(file.read_text())["address"]) as executor:
                monkeypatch.setattr(grid, "CONNECT_SECONDS", 2)
                scheduler.send_signal(signal.SIGSTOP)
                with pytest.raises(WorkError, match=r"has ended.*the same command continues"):
                    study.run(cells(study.notes, 1), executor=executor)
        finally:
            scheduler.kill()


@pytest.mark.process
def test_the_documented_jobs_of_slurm_are_a_worker_per_processor(tmp_path: Path):
    pytest.importorskip("dask_jobqueue", reason="needs dask-jobqueue")
    page = ROOT / "docs" / "how-to" / "run-on-a-cluster.md"
    (block,) = (one for one in blocks(page) if "SLURMCluster(" in one.text)
    code = block.text.replace("8786", '0, "dashboard_address": ":0"')
    done = subprocess.run(
        [sys.executable, "-c", f"{code}\nprint(cluster.job_script())"],
        cwd=tmp_path,
        input="\n",
        capture_output=True,
        text=True,
        check=False,
    )

    assert "#SBATCH -p cpu" in done.stdout, done.stderr
    assert f"{sys.executable} -m distributed.cli.dask_worker tcp://" in done.stdout
    assert "--nthreads 1 " in done.stdout
    assert "--nworkers 8 " in done.stdout
