"""Promises of worker processes: each exits alone, is replaced, and ends with the executor."""

import os
import signal
import time
from pathlib import Path

import pytest

from selfmodel.experiments.grid.process_workers import (
    MAX_CALLS_PER_WORKER,
    ProcessWorkers,
    WorkerExitError,
)


def process_id() -> int:
    return os.getpid()


def leave(status: int) -> None:
    os._exit(status)


def wait_for(path: str) -> None:
    Path(path).touch()
    time.sleep(60)


@pytest.fixture(autouse=True)
def _found_by_the_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[3]))


@pytest.mark.process
def test_a_worker_is_replaced_after_its_largest_number_of_calls():
    with ProcessWorkers(1) as executor:
        answers = [executor.submit(process_id) for _ in range(MAX_CALLS_PER_WORKER + 1)]
        found = [answer.result() for answer in answers]

    assert len(set(found[:-1])) == 1
    assert found[-1] != found[0]


@pytest.mark.process
def test_a_worker_that_exits_fails_its_own_call_alone_and_is_replaced(tmp_path: Path):
    with ProcessWorkers(2) as executor:
        other = executor.submit(wait_for, str(tmp_path / "begun"))
        while not (tmp_path / "begun").exists():
            time.sleep(0.01)
        with pytest.raises(WorkerExitError, match="its process ended with status 7"):
            executor.submit(leave, 7).result()
        assert isinstance(executor.submit(process_id).result(), int)
        assert not other.done()


@pytest.mark.process
def test_an_idle_worker_that_was_killed_is_replaced_and_fails_no_call():
    with ProcessWorkers(1) as executor:
        first = executor.submit(process_id).result()
        (worker,) = executor._all
        os.kill(first, signal.SIGKILL)
        worker.process.join()

        assert executor.submit(process_id).result() != first


@pytest.mark.process
def test_the_end_of_the_executor_ends_a_call_at_once(tmp_path: Path):
    with ProcessWorkers(1) as executor:
        running, waiting = (executor.submit(wait_for, str(tmp_path / n)) for n in "12")
        while not (tmp_path / "1").exists():
            time.sleep(0.01)
        begin = time.monotonic()

    assert time.monotonic() - begin < 10
    assert isinstance(running.exception(), WorkerExitError)
    assert waiting.cancelled()
    assert not (tmp_path / "2").exists()
