"""What a child process does to us: it answers, or ends in one sentence that names the input."""

from pathlib import Path

import pytest

from selfmodel import isolation
from selfmodel.errors import InputError
from selfmodel.isolation import IsolationError, Message, run_isolated

EMPTY = Message({})


def run(task: str, request: Message = EMPTY, seconds: int = 20) -> Message:
    return run_isolated(
        f"tests.helpers.isolated_tasks:{task}", request, what="walk.xml", seconds=seconds
    )


def test_header_and_buffers_arrive_from_a_child_that_prints_and_imports_nothing_from_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "json.py").write_text("raise SystemExit(3)")
    monkeypatch.chdir(tmp_path)
    request = Message({"é": [1.5, None]}, {"a": bytes(range(256)), "": b"", "b": b"\n" * 10**6})
    answer = run("echo", request)

    assert answer.buffers == request.buffers
    assert not Path(answer.header.pop("folder")).exists()
    assert answer.header == request.header


@pytest.mark.parametrize(
    ("task", "sentence"),
    [
        ("crash", r"^walk\.xml made the process that read it crash with SIGSEGV$"),
        ("allocate", r"^walk\.xml takes more memory than"),
        ("loop", r"^walk\.xml takes more than 1 s of processor time"),
        ("wait", r"^walk\.xml takes more than 1 s"),
    ],
)
def test_a_child_that_crashes_or_reaches_a_limit_is_one_sentence(
    task: str, sentence: str, monkeypatch: pytest.MonkeyPatch
):
    if task == "wait":
        monkeypatch.setattr(isolation, "_WALL_FACTOR", 0.5)
    with pytest.raises(IsolationError, match=sentence) as refusal:
        run(task, seconds=1)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("task", "error", "match"),
    [
        ("refuse", InputError, r"walk\.bag.*record it again"),
        ("nest", InputError, "nested too deeply"),
        ("fail", RuntimeError, r"(?s)walk\.xml.*KeyError: 'a defect'"),
    ],
)
def test_an_error_of_the_input_or_a_defect_is_raised_here(
    task: str, error: type[Exception], match: str
):
    with pytest.raises(error, match=match):
        run(task)
