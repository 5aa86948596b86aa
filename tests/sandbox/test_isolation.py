import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

from selfmodel.errors import InputError
from selfmodel.logs.errors import CorruptError
from selfmodel.sandbox import isolation
from selfmodel.sandbox.budget import Budget, BudgetError
from selfmodel.sandbox.isolation import ChildError, Isolated, run_isolated
from selfmodel.sandbox.message import Message

SHORT = Budget(time=18)
"""One second of processor time for a file."""


def call(task: str, blobs: dict[str, bytes] | None = None, **facts: object) -> Isolated:
    return run_isolated(
        f"tests.helpers.isolated_tasks:{task}",
        Message(facts, blobs or {}),
        what="robot.xml",
        budget=SHORT,
        errors=(CorruptError,),
    )


@settings(deadline=None)
@given(
    st.dictionaries(st.text(), st.integers() | st.text() | st.none()),
    st.dictionaries(st.text(max_size=5), st.binary()),
)
def test_a_task_receives_and_returns_values_unchanged(
    facts: dict[str, object], blobs: dict[str, bytes]
):
    found = run_isolated(
        "tests.helpers.isolated_tasks:echo", Message(facts, blobs), what="x", budget=SHORT
    )

    assert (found.facts["facts"], dict(found.blobs)) == (facts, blobs)


def test_a_message_may_be_larger_than_the_buffers_of_a_channel():
    data = bytes(range(256)) * 100_000

    assert call("echo", {"data": data}).blobs["data"] == data


def test_a_task_that_takes_more_memory_than_the_budget_is_refused_with_the_remedy():
    with pytest.raises(BudgetError, match=r"robot.xml takes more than 1 GB .* --budget memory="):
        call("allocate", bytes=2 * SHORT.memory)


@pytest.mark.skipif(sys.platform != "linux", reason="macOS does not limit the address space")
def test_an_answer_that_takes_more_memory_than_the_budget_is_refused_with_the_remedy():
    with pytest.raises(BudgetError, match=r"x takes more than 0\.1 GB of memory"):
        run_isolated(
            "tests.helpers.isolated_tasks:answer",
            Message({"characters": 100_000_000}),
            what="x",
            budget=Budget(memory=10**8),
        )


def test_a_task_within_the_budget_has_its_memory():
    assert call("allocate", bytes=SHORT.memory // 4).facts["bytes"] == SHORT.memory // 4


@pytest.mark.skipif(sys.platform != "linux", reason="the address space is known on Linux")
def test_the_peak_of_the_memory_is_reported():
    assert call("allocate", bytes=10**8).peak >= 10**8


@pytest.mark.process
def test_a_task_that_does_not_end_is_stopped_after_the_time_of_the_budget():
    with pytest.raises(BudgetError, match=r"more than 1 s of processor time.*--budget time="):
        call("loop")


def test_the_limit_of_the_processor_time_is_that_of_the_budget():
    assert call("cpu_limit").facts["seconds"] == 1


@pytest.mark.process
def test_a_task_that_waits_for_ever_is_stopped():
    with pytest.raises(BudgetError):
        run_isolated(
            "tests.helpers.isolated_tasks:wait", Message({}), what="x", budget=Budget(time=1)
        )


def test_a_crash_is_one_sentence():
    with pytest.raises(ChildError, match=r"robot\.xml made the process .* crash with SIG"):
        call("crash")


def test_after_a_crash_the_next_task_runs():
    with pytest.raises(ChildError):
        call("crash")

    assert call("echo", x=1).facts["facts"] == {"x": 1}


def test_a_server_that_was_killed_between_two_calls_is_started_again():
    call("echo")
    server = isolation._servers[0]
    os.kill(server._process.pid, signal.SIGKILL)
    _wait_until(lambda: server.has_ended)

    assert call("echo", x=1).facts["facts"] == {"x": 1}


def test_a_task_has_its_own_channel_and_not_that_of_the_server():
    assert call("sockets").facts["sockets"] == 1


def test_an_error_for_the_user_is_raised_again_with_its_message():
    with pytest.raises(InputError, match="expected a robot, got a chair"):
        call("refuse")


def test_an_error_of_a_log_keeps_its_parts():
    with pytest.raises(CorruptError) as caught:
        call("refuse_log")

    error = caught.value
    assert (error.path, error.what, error.advice) == ("a.mcap", "it is damaged", "make it again")


def test_unbounded_recursion_is_one_sentence():
    with pytest.raises(InputError, match=r"robot\.xml is nested too deeply"):
        call("nest")


def test_a_mistake_of_the_task_is_raised_with_its_traceback():
    with pytest.raises(RuntimeError, match=r"(?s)isolated_tasks.py.*ZeroDivisionError: a mistake"):
        call("fail")


@pytest.mark.skipif(sys.platform != "linux", reason="Landlock is a part of Linux")
def test_a_task_changes_no_file_outside_its_scratch_folder(tmp_path: Path):
    existing = tmp_path / "existing"
    existing.write_text("kept")
    paths = [str(existing), str(tmp_path / "new")]

    found = call("write", paths=paths)

    if "changed" in found.facts["results"]:
        pytest.skip(
            "this kernel has no Landlock: it needs Linux 5.13 with landlock in the lsm= option"
        )
    assert found.facts["results"] == ["PermissionError", "PermissionError"]
    assert existing.read_text() == "kept"
    assert [path.name for path in tmp_path.iterdir()] == ["existing"]


def test_a_task_cannot_fill_the_disk():
    with pytest.raises((ChildError, RuntimeError)):
        call("fill_disk", bytes=2 * SHORT.unpacked_bytes)


def test_calls_from_several_threads_get_their_own_answers():
    answers: dict[int, object] = {}

    def ask(number: int) -> None:
        answers[number] = call("echo", number=number).facts["facts"]

    threads = [threading.Thread(target=ask, args=(number,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()

    assert answers == {number: {"number": number} for number in range(8)}


@pytest.mark.process
def test_an_interrupted_call_leaves_no_answer_to_the_next():
    timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        call("wait")

    assert call("echo", x=2).facts["facts"] == {"x": 2}


def _echo_in_a_fork(pipe: "multiprocessing.connection.Connection") -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        facts = call("echo", x=3).facts["facts"]
    pipe.send((facts, [str(warning.message) for warning in caught]))


@pytest.mark.process
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_process_has_a_server_of_its_own():
    call("echo", x=1)
    context = multiprocessing.get_context("fork")
    own, other = context.Pipe()
    process = context.Process(target=_echo_in_a_fork, args=(other,))
    process.start()

    assert own.recv() == ({"x": 3}, [])
    process.join()
    assert call("echo", x=4).facts["facts"] == {"x": 4}


@pytest.mark.process
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_process_that_was_forked_during_a_call_of_another_thread_has_no_lock_to_wait_for():
    context = multiprocessing.get_context("fork")
    own, other = context.Pipe()
    process = context.Process(target=_echo_in_a_fork, args=(other,), daemon=True)
    with isolation._lock:
        process.start()

    assert own.poll(30)
    process.join()


WAITING = """
from selfmodel.sandbox import isolation
from selfmodel.sandbox.budget import Budget
from selfmodel.sandbox.message import Message

isolation._server()
print(isolation._servers[0]._process.pid, flush=True)
isolation.run_isolated(
    "tests.helpers.isolated_tasks:wait", Message({}), what="x", budget=Budget()
)
"""


@pytest.mark.process
def test_the_task_of_a_killed_process_ends_with_it_and_leaves_no_scratch_folder(tmp_path: Path):
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    client = subprocess.Popen(
        [sys.executable, "-c", WAITING], stdout=subprocess.PIPE, text=True, env=environment
    )
    assert client.stdout is not None
    server = int(client.stdout.readline())
    _wait_until(lambda: any(tmp_path.iterdir()))
    time.sleep(0.5)  # the task begins
    client.kill()
    client.communicate()

    _wait_until(lambda: not _is_group(server))
    assert list(tmp_path.iterdir()) == []


def _is_group(number: int) -> bool:
    try:
        os.killpg(number, 0)
    except ProcessLookupError:
        return False
    return True


def _wait_until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)
