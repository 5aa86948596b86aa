"""What a child process does to us: it answers, or ends in one sentence that names the input."""

from pathlib import Path

import pytest

from selfmodel.errors import InputError
from selfmodel.isolation import IsolationError, Message, run_isolated
from selfmodel.logs import CorruptError

EMPTY = Message({})


def run(task: str, request: Message = EMPTY, seconds: int = 20) -> Message:
    return run_isolated(
        f"tests.helpers.isolated_tasks:{task}",
        request,
        what="walk.xml",
        seconds=seconds,
        errors=(CorruptError,),
    )


def test_header_and_buffers_arrive_although_the_task_prints():
    request = Message({"é": [1.5, None]}, {"a": bytes(range(256)), "": b"", "b": b"\n" * 10**6})
    answer = run("echo", request)

    assert (answer.header, answer.buffers) == (request.header, request.buffers)


@pytest.mark.parametrize(
    ("task", "header", "sentence"),
    [
        ("crash", {}, r"^walk\.xml made the process that read it crash with SIGSEGV$"),
        ("allocate", {"bytes": 10**15}, r"^walk\.xml takes more memory than"),
        ("loop", {}, r"^walk\.xml takes more than 1 s of processor time"),
        ("wait", {}, r"^walk\.xml takes more than 1 s"),
    ],
)
def test_a_child_that_crashes_or_reaches_a_limit_is_one_sentence(
    task: str, header: dict, sentence: str
):
    with pytest.raises(IsolationError, match=sentence) as refusal:
        run(task, Message(header), seconds=1)
    assert "\n" not in str(refusal.value)


def test_errors_of_the_input_are_raised_here():
    with pytest.raises(InputError, match=r"^no robot$"):
        run("refuse")
    with pytest.raises(InputError, match="nested too deeply"):
        run("nest")
    with pytest.raises(CorruptError, match=r"walk\.bag.*record it again"):
        run("refuse_log")


def test_a_defect_of_the_task_is_raised_with_its_traceback():
    with pytest.raises(RuntimeError, match=r"(?s)walk\.xml.*KeyError: 'a defect'"):
        run("fail")


def test_the_temporary_folder_of_a_child_is_removed():
    assert not Path(run("scratch").header["folder"]).exists()


def test_the_working_folder_is_not_imported_from(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "json.py").write_text("raise SystemExit(3)")
    monkeypatch.chdir(tmp_path)
    assert run("echo").header == {}
