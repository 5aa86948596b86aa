"""Promises of a grid: nothing is done twice, nothing is lost, and one failure stops no other."""

import errno
import fcntl
import json
import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from selfmodel.errors import InputError
from selfmodel.experiments.grid import GridBegins, Job, PartEnds, difference, finished, run_grid
from selfmodel.experiments.grid.lock import exclusive
from selfmodel.experiments.grid.worker_pool import MAX_TASKS_PER_WORKER, WorkerExit, run_tasks
from selfmodel.physical.stop_signals import STOP_SIGNALS

ROOT = Path(__file__).parents[2]


def work(job: Job, part: str, folder: Path) -> dict:
    """Notes that it was called, waits, and fails if it is to."""
    with (folder / "calls").open("a") as file:
        file.write(f"{part}\n")
    time.sleep(job.parameters.get("seconds", 0))
    match job.parameters.get("fails"):
        case "foreseen" if not (folder / "mended").exists():
            raise InputError("the cause and the cure")
        case "bug":
            raise ZeroDivisionError
        case "crash":
            os._exit(7)
    sys.stdout.write("a plug-in may print")
    deaf = set(STOP_SIGNALS) <= signal.pthread_sigmask(signal.SIG_BLOCK, ())
    return {"part": part, "number": job.seed * job.parameters["factor"], "deaf": deaf}


def jobs(count: int, parts: tuple[str, ...] = ("result",), **parameters: object) -> list[Job]:
    return [
        Job(f"run-{seed:02d}", {"factor": 10, **parameters}, seed, parts) for seed in range(count)
    ]


def calls(folder: Path) -> dict[str, list[str]]:
    return {path.parent.name: path.read_text().split() for path in folder.glob("*/calls")}


def silent(_event: GridBegins | PartEnds) -> None:
    pass


def process_id(_task: int) -> int:
    """The process that does a task."""
    return os.getpid()


SCRIPT = """
import sys
from pathlib import Path
from selfmodel.experiments.grid import run_grid
from tests.experiments.test_grid import jobs, silent, work

if __name__ == "__main__":
    run_grid(Path(sys.argv[1]), jobs(6, seconds=0.3), work, workers=2, on_progress=print)
"""


@pytest.fixture(autouse=True)
def _found_by_the_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT))


def start(folder: Path) -> subprocess.Popen[bytes]:
    """Starts a slow grid in a process group of its own."""
    folder.mkdir(exist_ok=True)
    script = folder / "script.py"
    script.write_text(SCRIPT)
    return subprocess.Popen(
        [sys.executable, script, folder / "runs"],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )


def wait_for_a_result(folder: Path) -> None:
    deadline = time.monotonic() + 60
    while not list(folder.glob("runs/*/parts/*.json")):
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_a_grid_does_every_part_once_and_not_again(tmp_path: Path):
    events: list = []
    first = run_grid(tmp_path, jobs(3, ("a", "b")), work, workers=2, on_progress=events.append)
    again = run_grid(tmp_path, jobs(3, ("a", "b")), work, workers=2, on_progress=events.append)

    assert (first, again) == ((), ())
    assert calls(tmp_path) == {f"run-{seed:02d}": ["a", "b"] for seed in range(3)}
    assert events[0] == GridBegins(total=6, finished=0)
    assert [event.number for event in events[1:7]] == [1, 2, 3, 4, 5, 6]
    assert events[7:] == [GridBegins(total=6, finished=6)]


@pytest.mark.process
def test_the_results_do_not_depend_on_the_number_of_workers(tmp_path: Path):
    for workers in (1, 2):
        run_grid(
            tmp_path / str(workers), jobs(4, ("a", "b")), work, workers=workers, on_progress=silent
        )

    one, two = ([*finished(tmp_path / folder)] for folder in ("1", "2"))

    assert one == two
    assert [each.result["number"] for each in one if each.part == "a"] == [0, 10, 20, 30]


def test_a_run_is_extended_by_a_part_and_keeps_the_others(tmp_path: Path):
    run_grid(tmp_path, jobs(2, ("a",)), work, workers=1, on_progress=silent)
    run_grid(tmp_path, jobs(2, ("a", "package.module:b/c")), work, workers=1, on_progress=silent)

    assert calls(tmp_path)["run-01"] == ["a", "package.module:b/c"]
    assert {each.part for each in finished(tmp_path)} == {"a", "package.module:b/c"}


@pytest.mark.parametrize(
    ("fails", "sentence"),
    [
        ("foreseen", "the cause and the cure"),
        (
            "bug",
            "an unexpected error, ZeroDivisionError; its traceback is in {traceback}",
        ),
        ("crash", "its process ended with status 7; standard error may have the reason"),
    ],
)
def test_a_failure_is_kept_and_stops_no_other(tmp_path: Path, fails: str, sentence: str):
    bad = Job("bad", {"factor": 1, "fails": fails}, 0, ("a", "b"))
    texts = tmp_path / "bad" / "tracebacks"
    failed = run_grid(tmp_path, [bad, *jobs(2)], work, workers=1, on_progress=silent)

    assert [(each.key, each.part, each.error) for each in failed] == [
        ("bad", part, sentence.format(traceback=texts / f"{part}.txt")) for part in ("a", "b")
    ]
    kept = json.loads((tmp_path / "bad" / "parts" / "a.json").read_text())
    assert (kept["status"], kept["error"]) == ("failed", failed[0].error)
    assert [each.key for each in finished(tmp_path)] == ["run-00", "run-01"]


@pytest.mark.process
def test_what_failed_is_tried_again(tmp_path: Path):
    assert run_grid(tmp_path, jobs(1, fails="foreseen"), work, workers=1, on_progress=silent)
    (tmp_path / "run-00" / "mended").touch()

    assert run_grid(tmp_path, jobs(1, fails="foreseen"), work, workers=1, on_progress=silent) == ()


@pytest.mark.process
def test_a_run_whose_results_were_deleted_is_made_again(tmp_path: Path):
    run_grid(tmp_path, jobs(2), work, workers=1, on_progress=silent)
    shutil.rmtree(tmp_path / "run-01" / "parts")

    assert run_grid(tmp_path, jobs(2), work, workers=1, on_progress=silent) == ()
    assert calls(tmp_path) == {"run-00": ["result"], "run-01": ["result", "result"]}


def test_a_run_made_of_something_else_is_refused_before_anything_is_done(tmp_path: Path):
    run_grid(tmp_path, jobs(1), work, workers=1, on_progress=silent)
    other = [Job("new", {"factor": 1}, 0), Job("run-00", {"factor": 11}, 0)]

    with pytest.raises(
        InputError, match=r"run-00 .*parameters.factor is 10 there, requested is 11"
    ):
        run_grid(tmp_path, other, work, workers=1, on_progress=silent)
    assert not (tmp_path / "new").exists()


@pytest.mark.process
def test_a_grid_that_was_killed_goes_on_where_it_was(tmp_path: Path):
    process = start(tmp_path)
    wait_for_a_result(tmp_path)
    process.kill()
    process.communicate()
    done = {each.key for each in finished(tmp_path / "runs")}
    assert 0 < len(done) < 6

    run_grid(tmp_path / "runs", jobs(6, seconds=0.3), work, workers=2, on_progress=silent)

    assert [each.seed for each in finished(tmp_path / "runs")] == list(range(6))
    assert all(calls(tmp_path / "runs")[key] == ["result"] for key in done)


@pytest.mark.process
def test_an_interrupt_ends_every_process_at_once_and_quietly(tmp_path: Path):
    process = start(tmp_path)
    wait_for_a_result(tmp_path)
    os.killpg(process.pid, signal.SIGINT)  # a terminal's Ctrl-C reaches the workers too
    _, told = process.communicate(timeout=30)  # ends when the last of them has closed it
    started = len(calls(tmp_path / "runs"))
    time.sleep(0.5)

    assert told.count(b"Traceback") == 1  # the script's own KeyboardInterrupt
    assert len(calls(tmp_path / "runs")) == started < 6


def test_a_worker_never_sees_a_stop_signal_not_even_while_it_starts(tmp_path: Path):
    run_grid(tmp_path, jobs(2), work, workers=2, on_progress=silent)

    assert all(each.result["deaf"] for each in finished(tmp_path))
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())


@pytest.mark.process
def test_a_second_process_at_one_grid_is_refused_and_nothing_is_done_twice(tmp_path: Path):
    process = start(tmp_path)
    wait_for_a_result(tmp_path)

    with pytest.raises(InputError, match=r"another process runs a grid in .*runs: wait"):
        run_grid(tmp_path / "runs", jobs(6, seconds=0.3), work, workers=2, on_progress=silent)
    out, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    assert calls(tmp_path / "runs") == {f"run-{seed:02d}": ["result"] for seed in range(6)}
    assert b"a plug-in may print" not in out


@pytest.mark.process
def test_a_worker_is_replaced_after_its_largest_number_of_tasks():
    chains = [[number] for number in range(MAX_TASKS_PER_WORKER + 1)]
    with closing(run_tasks(process_id, chains, 1)) as answers:
        processes = [process for _, process in answers]

    assert len(set(processes[:-1])) == 1
    assert processes[-1] != processes[0]


def test_a_folder_has_one_lock_whatever_path_leads_to_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    folder, link = tmp_path / "runs", tmp_path / "link"
    folder.mkdir()
    link.symlink_to(folder)
    monkeypatch.chdir(folder)

    with exclusive(folder):
        for path in (Path(), Path("../runs"), link):
            with pytest.raises(InputError, match="another process"), exclusive(path):
                pass


def test_a_file_system_without_locks_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def flock(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", flock)
    with pytest.raises(InputError, match="this file system has no locks"), exclusive(tmp_path):
        pass


@pytest.mark.process
def test_an_idle_worker_that_was_killed_is_replaced_and_fails_no_task():
    with closing(run_tasks(process_id, [[1], [2]], 1)) as answers:
        _, first = next(answers)
        os.kill(first, signal.SIGKILL)
        _wait_for_the_exit_of(first)
        _, second = next(answers)

    assert second not in (first, WorkerExit(-signal.SIGKILL))


def _wait_for_the_exit_of(process: int) -> None:
    while process in [child.pid for child in multiprocessing.active_children()]:
        time.sleep(0.01)


@pytest.mark.parametrize(
    ("there", "requested"),
    [({"gap": None}, {}), ({}, {"gap": None}), ({"gap": None}, {"gap": 0}), ({"a": 1}, {})],
)
def test_a_value_that_is_absent_differs_from_null(there: dict, requested: dict):
    assert difference(there, requested) is not None


@pytest.mark.parametrize("key", ["", "..", "a/b", ".hidden", "a b"])
def test_a_key_that_cannot_name_a_folder_is_refused(key: str):
    with pytest.raises(ValueError, match="a key that is a valid folder name"):
        Job(key, {}, 0)


@given(
    st.recursive(
        st.none() | st.booleans() | st.floats(allow_nan=False) | st.text(),
        lambda inner: st.dictionaries(st.text(), inner) | st.lists(inner),
    )
)
def test_a_value_does_not_differ_from_what_its_file_says(value: object):
    assert difference(json.loads(json.dumps(value)), value) is None
