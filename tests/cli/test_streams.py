"""Promises of the standard streams: results go out, and what is lost elsewhere does no harm."""

import io
import json
import os
import subprocess
import sys
from contextlib import redirect_stdout
from pathlib import Path

import pytest

from selfmodel import cli
from selfmodel.cli import main
from tests.helpers.command import SMALL, selfmodel, succeeds

ROOT = Path(__file__).parents[2]


def shell(line: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Runs a shell's line, in which ``selfmodel`` is the command."""
    command = f'selfmodel() {{ "{sys.executable}" -m selfmodel "$@"; }}; {line}'
    return subprocess.run(
        ["bash", "-o", "pipefail", "-c", command],
        cwd=cwd,
        env={**os.environ, "PYTHONPATH": str(ROOT), "MUJOCO_GL": "disable"},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("streams")
    succeeds("trial", "quadruped", "--steps", "60", "--out", "a.mcap", cwd=folder)
    return folder / "a.mcap"


QUICK = ("--comparator", "forward-displacement", "--kinds", "break")
DIAGNOSE = ("diagnose", "a.mcap", *SMALL, *QUICK, "--no-calibrate", "--json")


def test_a_result_is_printed_where_python_has_no_standard_error(
    log: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(sys, "stderr", None)  # as after 2>&-
    monkeypatch.setattr(sys, "__stderr__", None)
    monkeypatch.setattr(sys, "argv", ["selfmodel", *DIAGNOSE])
    monkeypatch.chdir(log.parent)
    with redirect_stdout(io.StringIO()) as stdout, pytest.raises(SystemExit) as end:
        main()

    assert not end.value.code
    assert json.loads(stdout.getvalue())["diagnosis"]


@pytest.mark.process
@pytest.mark.parametrize("stderr", ["2>&-", "2>/dev/full"])
def test_a_result_goes_to_standard_output_where_standard_error_is_closed_or_full(
    log: Path, stderr: str
):
    done = shell(f"selfmodel {' '.join(DIAGNOSE)} {stderr}", log.parent)

    assert done.returncode == 0
    assert json.loads(done.stdout)["diagnosis"]


@pytest.mark.process
@pytest.mark.search
def test_a_study_with_workers_ends_with_its_result_where_standard_error_is_full(tmp_path: Path):
    few = " ".join((*SMALL, *QUICK, "--steps", "60", "--trials", "1", "--workers", "1"))
    done = shell(
        f"selfmodel ablate --robots quadruped --case 1 {few} --json --out run 2>/dev/full", tmp_path
    )

    assert done.returncode == 0
    assert {row["case"] for row in json.loads(done.stdout)["rows"]} == {1}


@pytest.mark.process
@pytest.mark.parametrize(
    ("command", "stdout", "reason"),
    [
        ("--help", ">/dev/full", "No space left on device"),
        ("logs info a.mcap", ">/dev/full", "No space left on device"),
        ("logs verify a.mcap", ">&-", "Bad file descriptor"),
    ],
)
def test_a_result_that_cannot_be_written_is_an_error_with_one_sentence(
    log: Path, command: str, stdout: str, reason: str
):
    done = shell(f"selfmodel {command} {stdout}", log.parent)

    assert done.returncode == 1
    assert done.stderr == f"error: standard output could not be written: {reason}\n"


@pytest.mark.process
def test_a_reader_that_has_read_enough_ends_a_command_quietly(log: Path):
    done = shell("selfmodel robots quadruped --json | head -1", log.parent)

    assert len(done.stdout.splitlines()) == 1
    assert done.stderr == ""
    assert done.returncode in (0, 1)  # 0 if all was written before


@pytest.mark.process
@pytest.mark.parametrize("streams", ["2>&-", "<&- 2>&- 3>&-"])
def test_no_log_is_opened_as_a_standard_stream_that_was_closed(tmp_path: Path, streams: str):
    done = shell(
        f"selfmodel trial quadruped --steps 20 --out a.mcap {streams} && "
        f"selfmodel logs verify a.mcap",
        tmp_path,
    )

    assert done.returncode == 0
    assert "ok: a.mcap: 20 steps" in done.stdout


@pytest.mark.process
def test_a_wrong_usage_keeps_its_exit_status_where_nothing_can_be_told(tmp_path: Path):
    assert shell("selfmodel trial nosuch --out a.mcap 2>/dev/full", tmp_path).returncode == 2
    assert shell("selfmodel nosuch >&- 2>&-", tmp_path).returncode == 2


def test_a_lack_of_memory_without_a_reason_is_a_whole_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def lacking() -> None:
        raise MemoryError

    monkeypatch.setattr(cli, "_run", lacking)
    done = selfmodel(cwd=tmp_path)

    assert (done.returncode, done.stderr) == (
        1,
        "error: there is not enough memory (for this): request less at once\n",
    )
