"""Promises of a grid: nothing is done twice, nothing is lost, and one failure stops no other."""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from selfmodel.errors import InputError, WorkError
from selfmodel.studies import cells as cell_files, grid
from selfmodel.studies.cells import CELL, Cell, finished
from selfmodel.studies.grid import CellEnds, GridBegins, dask_executor, run_grid
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
    run_grid(folder / "study", cells(folder, 6, seconds=0.3), workers=2, on_progress=print)
"""


@pytest.fixture(autouse=True)
def _found_by_the_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT))


@pytest.fixture
def threads() -> Iterator[ThreadPoolExecutor]:
    """An executor of the caller, in this process."""
    with ThreadPoolExecutor(2) as executor:
        yield executor


def names(folder: Path) -> list[str]:
    return [one.name for one in finished(folder / "runs")]


def start(folder: Path) -> "subprocess.Popen[bytes]":
    """Starts a slow grid in a process group of its own, and waits for its first result."""
    (folder / "script.py").write_text(SCRIPT)
    process = subprocess.Popen(
        [sys.executable, folder / "script.py", folder],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    limit = time.monotonic() + LIMIT
    while not list(folder.glob("study/runs/*/cell.json")):
        assert process.poll() is None
        if time.monotonic() > limit:
            process.kill()
            pytest.fail(f"no first result within {LIMIT} s")
        time.sleep(0.05)
    return process


def test_a_grid_computes_every_cell_once_and_not_again(tmp_path: Path, threads: ThreadPoolExecutor):
    events: list = []
    wanted = cells(tmp_path, 6)
    first, again = (
        run_grid(tmp_path / "study", wanted, executor=threads, on_progress=events.append)
        for _ in range(2)
    )

    assert (first, again) == ((), ())
    assert calls(tmp_path) == {f"run-{seed:02d}": 1 for seed in range(6)}
    assert events[0] == GridBegins(total=6, finished=0)
    assert [event.number for event in events[1:7]] == [1, 2, 3, 4, 5, 6]
    assert events[7:] == [GridBegins(total=6, finished=6)]
    assert sorted(path.name for path in (tmp_path / "study").iterdir()) == ["runs"]


@pytest.mark.process
def test_the_results_are_those_of_any_executor(tmp_path: Path, threads: ThreadPoolExecutor):
    run_grid(tmp_path / "threads", cells(tmp_path, 4), executor=threads)
    run_grid(tmp_path / "processes", cells(tmp_path, 4), workers=2)
    one, two = ([*finished(tmp_path / name / "runs")] for name in ("threads", "processes"))

    assert one == two
    assert [each.result["number"] for each in one] == [0, 10, 20, 30]


def test_a_cell_that_others_need_is_computed_once_before_them(
    tmp_path: Path, threads: ThreadPoolExecutor
):
    events: list = []
    study = tmp_path / "study"
    run_grid(study, shared(tmp_path), executor=threads, on_progress=events.append)

    assert events[0] == GridBegins(total=4, finished=0)
    assert events[1].name == "need"
    assert calls(tmp_path)["need"] == 1
    assert [each.result["number"] for each in finished(study / "runs")] == [5, 15, 25]


def test_a_needed_cell_without_its_files_is_computed_again_only_if_it_is_needed(
    tmp_path: Path, threads: ThreadPoolExecutor
):
    first, *others = shared(tmp_path)
    study = tmp_path / "study"
    run_grid(study, [first], executor=threads)
    (study / first.needs["0"].place / "number.txt").unlink()
    run_grid(study, [first], executor=threads)
    assert calls(tmp_path)["need"] == 1

    assert run_grid(study, others, executor=threads) == ()
    assert calls(tmp_path) == {"need": 2, "run-0": 1, "run-1": 1, "run-2": 1}


def test_cells_that_need_a_failed_one_are_named_and_not_computed(
    tmp_path: Path, threads: ThreadPoolExecutor
):
    wanted = [*shared(tmp_path, fails="bug"), *cells(tmp_path, 1)]
    failed = run_grid(tmp_path / "study", wanted, executor=threads)

    assert sorted(each.name for each in failed) == ["need", "run-0", "run-1", "run-2"]
    assert {each.error for each in failed if each.name != "need"} == {
        "not computed: it needs need, which failed"
    }
    assert set(calls(tmp_path)) == {"need", "run-00"}


@pytest.mark.parametrize(
    ("fails", "words"),
    [("foreseen", "the cause and the cure"), ("bug", "an unexpected error, ZeroDivisionError")],
)
def test_a_failure_is_kept_stops_no_other_and_is_tried_again(
    tmp_path: Path, threads: ThreadPoolExecutor, fails: str, words: str
):
    study = tmp_path / "study"
    wanted = [cell(tmp_path, "bad", fails=fails), *cells(tmp_path, 2)]
    (failed,) = run_grid(study, wanted, executor=threads)
    (file,) = (study / "errors").iterdir()

    assert (failed.name, words in str(failed.error)) == ("bad", True)
    assert ("Traceback" in file.read_text()) == (fails == "bug")
    assert names(study) == ["run-00", "run-01"]
    if fails == "foreseen":
        (tmp_path / "mended").touch()
        assert run_grid(study, wanted, executor=threads) == ()
        assert not list((study / "errors").iterdir())


@pytest.mark.process
def test_a_crash_costs_its_own_cell_alone(tmp_path: Path):
    study = tmp_path / "study"
    wanted = [cell(tmp_path, "bad", fails="crash"), *cells(tmp_path, 4, seconds=0.2)]
    (failed,) = run_grid(study, wanted, workers=2)

    assert failed.name == "bad"
    assert "its process ended in each of 2 attempts" in str(failed.error)
    assert names(study) == [f"run-{seed:02d}" for seed in range(4)]
    assert calls(tmp_path)["bad"] == 2


@pytest.mark.parametrize("left", ["nothing", "its other files"])
def test_a_cell_whose_result_was_deleted_is_computed_again(
    tmp_path: Path, threads: ThreadPoolExecutor, left: str
):
    wanted = cells(tmp_path, 2)
    run_grid(tmp_path / "study", wanted, executor=threads)
    place = tmp_path / "study" / wanted[1].place
    if left == "nothing":
        shutil.rmtree(place)
    else:
        (place / CELL).unlink()

    assert run_grid(tmp_path / "study", wanted, executor=threads) == ()
    assert calls(tmp_path) == {"run-00": 1, "run-01": 2}
    assert names(tmp_path / "study") == ["run-00", "run-01"]


def test_other_inputs_and_other_code_are_other_cells(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (one,), (other,) = cells(tmp_path, 1), cells(tmp_path, 1, more=1)
    assert one.place == cells(tmp_path, 1)[0].place != other.place

    before = cell_files.made_with.__wrapped__("tests.helpers.grids:work")
    monkeypatch.setattr(cell_files, "_own_code", lambda: b"changed")
    assert cell_files.made_with.__wrapped__("tests.helpers.grids:work")["code"] != before["code"]
    (tmp_path / "theirs.py").write_text("def work(): ...")
    monkeypatch.syspath_prepend(str(tmp_path))
    first = cell_files.made_with.__wrapped__("theirs:work")
    (tmp_path / "theirs.py").write_text("def work(): return 1")
    assert cell_files.made_with.__wrapped__("theirs:work") != first


def test_a_study_of_other_code_is_neither_continued_nor_mixed(
    tmp_path: Path, threads: ThreadPoolExecutor, monkeypatch: pytest.MonkeyPatch
):
    study = tmp_path / "study"
    run_grid(study, cells(tmp_path, 1), executor=threads)
    made = {**cell_files.made_with("tests.helpers.grids:work"), "code": "other"}
    for module in (cell_files, grid):
        monkeypatch.setattr(module, "made_with", lambda _function: made)
    later = cells(tmp_path, 2)[1:]

    with pytest.raises(InputError, match=r"run-00.* was made with .*code.*, installed are .*other"):
        run_grid(study, later, executor=threads)
    run_grid(tmp_path / "other", later, executor=threads)
    shutil.copytree(tmp_path / "other" / later[0].place, study / later[0].place)
    with pytest.raises(InputError, match="a table is of one version of each"):
        list(finished(study / "runs"))


def test_a_worker_with_other_code_is_refused_by_name(
    tmp_path: Path, threads: ThreadPoolExecutor, monkeypatch: pytest.MonkeyPatch
):
    made = {**cell_files.made_with("tests.helpers.grids:work"), "code": "other"}
    monkeypatch.setattr(grid, "made_with", lambda _function: made)

    with pytest.raises(InputError, match=r"the worker on .* has .*, the command has .*code other"):
        run_grid(tmp_path / "study", cells(tmp_path, 1), executor=threads)
    assert not calls(tmp_path)


@pytest.mark.parametrize("name", ["", "..", "a/b", ".hidden", "a b"])
def test_a_name_that_cannot_name_a_folder_is_refused(name: str):
    with pytest.raises(ValueError, match="a name that is a valid folder name"):
        Cell("a:b", name, {})


def test_no_link_in_the_folder_of_a_study_is_followed(tmp_path: Path, threads: ThreadPoolExecutor):
    precious = tmp_path / "precious"
    precious.mkdir()
    (precious / "number.txt").write_text("mine")
    (wanted,) = cells(tmp_path, 1)
    place = tmp_path / "study" / wanted.place
    place.parent.mkdir(parents=True)
    place.symlink_to(precious)
    with pytest.raises(OSError, match="cannot be written"):
        run_grid(tmp_path / "study", [wanted], executor=threads)

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
        found = [*finished(tmp_path / "runs")]
    except InputError as error:
        message = str(error)
    assert (
        (str(copy) in message and "its folder" in message)
        if message
        else ([one.result for one in found] == [content["result"]])
    )


def test_a_cell_under_the_name_of_another_is_refused(one_cell: Path, tmp_path: Path):
    shutil.copytree(one_cell.parent, tmp_path / "runs" / "run-01-0123456789abcdef")

    with pytest.raises(InputError, match="expected the cell of its folder, got that of run-00-"):
        list(finished(tmp_path / "runs"))


def test_a_full_disk_ends_the_grid(
    tmp_path: Path, threads: ThreadPoolExecutor, monkeypatch: pytest.MonkeyPatch
):
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device", "cell.json")

    monkeypatch.setattr(cell_files, "replace_file", full)
    with pytest.raises(OSError, match="No space left"):
        run_grid(tmp_path / "study", cells(tmp_path, 3), executor=threads)


def test_an_executor_that_has_ended_is_named(tmp_path: Path, threads: ThreadPoolExecutor):
    threads.shutdown()

    with pytest.raises(WorkError, match=r"takes no more cells .* the same command continues"):
        run_grid(tmp_path / "study", cells(tmp_path, 1), executor=threads)


@pytest.mark.process
def test_a_grid_that_was_killed_goes_on_where_it_was(tmp_path: Path):
    process = start(tmp_path)
    process.kill()
    process.communicate(timeout=LIMIT)
    done = names(tmp_path / "study")
    assert 0 < len(done) < 6

    run_grid(tmp_path / "study", cells(tmp_path, 6, seconds=0.3), workers=2)

    assert names(tmp_path / "study") == [f"run-{seed:02d}" for seed in range(6)]
    assert all(calls(tmp_path)[name] == 1 for name in done)


@pytest.mark.process
def test_an_interrupt_ends_every_process_at_once_and_quietly(tmp_path: Path):
    process = start(tmp_path)
    os.killpg(process.pid, signal.SIGINT)  # a terminal's Ctrl-C reaches the workers too
    _, told = process.communicate(timeout=LIMIT)  # ends when the last of them has closed it
    started = calls(tmp_path).total()
    time.sleep(0.5)

    assert told.count(b"Traceback") == 1  # the script's own KeyboardInterrupt
    assert calls(tmp_path).total() == started < 6


@pytest.mark.process
def test_two_commands_at_one_study_agree(tmp_path: Path):
    process = start(tmp_path)
    failed = run_grid(tmp_path / "study", cells(tmp_path, 6, seconds=0.3), workers=2)
    out, _ = process.communicate(timeout=LIMIT)

    assert (failed, process.returncode) == ((), 0)
    assert names(tmp_path / "study") == [f"run-{seed:02d}" for seed in range(6)]
    assert max(calls(tmp_path).values()) <= 2
    assert not (tmp_path / "study" / "unfinished").exists()
    assert b"a plug-in may print" not in out


@pytest.fixture
def cluster(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """The address of a Dask cluster of two worker processes on this machine."""
    distributed = pytest.importorskip("distributed", reason="needs the extra dask")
    config = pytest.importorskip("dask").config
    monkeypatch.setenv("PYTHONPATH", str(ROOT))  # of the workers
    place = {"dashboard_address": ":0", "host": "127.0.0.1"}
    with (
        config.set({"distributed.scheduler.allowed-failures": 0}),
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, **place) as local,
    ):
        yield local.scheduler_address.removeprefix("tcp://")


@pytest.mark.process
def test_a_cluster_continues_what_processes_began_and_loses_a_crash_alone(
    cluster: str, tmp_path: Path
):
    study, wanted = tmp_path / "study", cells(tmp_path, 6)
    run_grid(study, wanted[:2], workers=1)
    with dask_executor(cluster) as executor:
        assert run_grid(study, wanted, executor=executor) == ()
        bad = cell(tmp_path, "bad", fails="crash")
        (failed,) = run_grid(study, [bad], executor=executor)

    assert names(study) == [f"run-{seed:02d}" for seed in range(6)]
    assert set(calls(tmp_path).values()) == {1}
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


def test_an_end_names_its_cell(tmp_path: Path, threads: ThreadPoolExecutor):
    events: list = []
    run_grid(tmp_path / "s", cells(tmp_path, 1), executor=threads, on_progress=events.append)

    assert isinstance(events[1], CellEnds)
    assert (events[1].name, events[1].error, events[1].seconds > 0) == ("run-00", None, True)
