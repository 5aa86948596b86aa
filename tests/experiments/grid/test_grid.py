"""Promises of a grid: nothing is done twice, nothing is lost, and one failure stops no other."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from selfmodel.errors import InputError
from selfmodel.experiments.grid import (
    Cell,
    GridBegins,
    PartEnds,
    difference,
    finished,
    processes,
    run_grid,
)
from selfmodel.logs import result_files
from selfmodel.physical.safety import STOP_SIGNALS
from tests.helpers.grids import calls, note_call

ROOT = Path(__file__).parents[3]
WORK = "tests.experiments.grid.test_grid:work"


def work(cell: Cell, needs: dict[str, Path], folder: Path) -> dict:
    """Notes that it was called, waits, and fails if it is to."""
    note_call(cell)
    time.sleep(cell.parameters.get("seconds", 0))
    match cell.parameters.get("fails"):
        case "foreseen" if not Path(cell.parameters["notes"], "mended").exists():
            raise InputError("the cause and the cure")
        case "bug":
            raise ZeroDivisionError
        case "crash":
            os._exit(7)
    sys.stdout.write("a plug-in may print")
    deaf = set(STOP_SIGNALS) <= signal.pthread_sigmask(signal.SIG_BLOCK, ())
    (folder / "number.txt").write_text(str(cell.seed))
    read = sum(int((needed / "number.txt").read_text()) for needed in needs.values())
    return {"part": cell.part, "number": cell.seed * cell.parameters["factor"] + read, "deaf": deaf}


def cells(
    notes: Path, count: int, parts: Sequence[str] = ("result",), **parameters: object
) -> list[Cell]:
    given = {"factor": 10, "notes": str(notes), **parameters}
    return [
        Cell(WORK, f"run-{seed:02d}", given, seed, part) for seed in range(count) for part in parts
    ]


def silent(_event: GridBegins | PartEnds) -> None:
    pass


def run(folder: Path, wanted: list[Cell], workers: int = 1) -> tuple[PartEnds, ...]:
    return run_grid(folder, wanted, workers=processes(workers), on_progress=silent)


SCRIPT = """
import sys
from pathlib import Path
from tests.experiments.grid.test_grid import cells, processes, run_grid

if __name__ == "__main__":
    folder = Path(sys.argv[1])
    wanted = cells(folder, 6, seconds=0.3)
    run_grid(folder / "study", wanted, workers=processes(2), on_progress=print)
"""


@pytest.fixture(autouse=True)
def _found_by_the_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT))


def start(folder: Path) -> subprocess.Popen[bytes]:
    """Starts a slow grid in a process group of its own."""
    script = folder / "script.py"
    script.write_text(SCRIPT)
    return subprocess.Popen(
        [sys.executable, script, folder],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )


def wait_for_a_result(folder: Path) -> None:
    deadline = time.monotonic() + 60
    while not list(folder.glob("study/runs/*/cell.json")):
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_a_grid_computes_every_cell_once_and_not_again(tmp_path: Path):
    events: list = []
    wanted = cells(tmp_path, 3, ("a", "b"))
    first, again = (
        run_grid(tmp_path / "study", wanted, workers=processes(2), on_progress=events.append)
        for _ in range(2)
    )

    assert (first, again) == ((), ())
    assert calls(tmp_path) == {f"run-{seed:02d} {part}": 1 for seed in range(3) for part in "ab"}
    assert events[0] == GridBegins(total=6, finished=0)
    assert [event.number for event in events[1:7]] == [1, 2, 3, 4, 5, 6]
    assert events[7:] == [GridBegins(total=6, finished=6)]
    assert sorted(path.name for path in (tmp_path / "study").iterdir()) == ["runs"]


@pytest.mark.process
def test_the_results_do_not_depend_on_the_number_of_workers(tmp_path: Path):
    for workers in (1, 2):
        run(tmp_path / str(workers), cells(tmp_path, 4, ("a", "b")), workers)

    one, two = ([*finished(tmp_path / folder / "runs")] for folder in ("1", "2"))

    assert one == two
    assert [each.result["number"] for each in one if each.part == "a"] == [0, 10, 20, 30]


def shared(notes: Path, **parameters: object) -> list[Cell]:
    """Three cells that need one cell of another kind."""
    given = {"factor": 1, "notes": str(notes), **parameters}
    need = Cell(WORK, "need", given, 5, kind="shared")
    plain = {"factor": 1, "notes": str(notes)}
    return [Cell(WORK, f"run-{n}", plain, n, needs={"it": need}) for n in range(3)]


@pytest.mark.process
def test_a_cell_that_others_need_is_computed_once_before_them(tmp_path: Path):
    events: list = []
    run_grid(tmp_path / "study", shared(tmp_path), workers=processes(2), on_progress=events.append)

    assert events[0] == GridBegins(total=4, finished=0)
    assert (events[1].key, events[1].part) == ("need", "result")
    assert calls(tmp_path)["need result"] == 1
    assert [each.result["number"] for each in finished(tmp_path / "study" / "runs")] == [5, 6, 7]


@pytest.mark.process
def test_a_needed_cell_without_its_files_is_computed_again_only_if_it_is_needed(tmp_path: Path):
    first, *others = shared(tmp_path)
    study = tmp_path / "study"
    run(study, [first])
    (study / first.needs["it"].place / "number.txt").unlink()
    run(study, [first])
    assert calls(tmp_path)["need result"] == 1

    assert run(study, others) == ()
    assert calls(tmp_path) == {"need result": 2, "run-0 result": 1, "run-1 result": 1} | {
        "run-2 result": 1
    }
    assert len([*finished(study / "runs")]) == 3


@pytest.mark.process
def test_cells_that_need_a_failed_one_are_told_and_not_computed(tmp_path: Path):
    failed = run(tmp_path / "study", [*shared(tmp_path, fails="bug"), *cells(tmp_path, 1)])

    assert [each.key for each in failed] == ["need", "run-0", "run-1", "run-2"]
    assert failed[1].error == "not computed: it needs need result, which failed"
    assert set(calls(tmp_path)) == {"need result", "run-00 result"}


def test_a_run_is_extended_by_a_part_and_keeps_the_others(tmp_path: Path):
    run(tmp_path / "study", cells(tmp_path, 2, ("a",)))
    run(tmp_path / "study", cells(tmp_path, 2, ("a", "package.module:b/c")))

    assert set(calls(tmp_path).values()) == {1}
    parts = {each.part for each in finished(tmp_path / "study" / "runs")}
    assert parts == {"a", "package.module:b/c"}


@pytest.mark.parametrize(
    ("fails", "sentence"),
    [
        ("foreseen", "the cause and the cure"),
        ("bug", "an unexpected error, ZeroDivisionError; its traceback is in {file}"),
        pytest.param(
            "crash",
            "lost with its worker in 3 attempts: its process ended with status 7; "
            "standard error may have the cause",
            marks=pytest.mark.process,
        ),
    ],
)
def test_a_failure_is_kept_and_stops_no_other(tmp_path: Path, fails: str, sentence: str):
    (bad,) = cells(tmp_path, 1, ("bad",), fails=fails)
    study = tmp_path / "study"
    failed = run(study, [bad, *cells(tmp_path, 2)])

    (file,) = (study / "errors").iterdir()
    assert [(each.part, each.error) for each in failed] == [("bad", sentence.format(file=file))]
    assert ("ZeroDivisionError" if fails == "bug" else failed[0].error) in file.read_text()
    assert [each.key for each in finished(study / "runs")] == ["run-00", "run-01"]
    assert calls(tmp_path)["run-00 bad"] == (3 if fails == "crash" else 1)


@pytest.mark.process
def test_what_failed_is_tried_again_and_its_error_removed(tmp_path: Path):
    assert run(tmp_path / "study", cells(tmp_path, 1, fails="foreseen"))
    (tmp_path / "mended").touch()

    assert run(tmp_path / "study", cells(tmp_path, 1, fails="foreseen")) == ()
    assert not list((tmp_path / "study" / "errors").iterdir())


@pytest.mark.process
@pytest.mark.parametrize("left", ["nothing", "its other files"])
def test_a_cell_whose_result_was_deleted_is_computed_again(tmp_path: Path, left: str):
    wanted = cells(tmp_path, 2)
    run(tmp_path / "study", wanted)
    place = tmp_path / "study" / wanted[1].place
    if left == "nothing":
        shutil.rmtree(place)
    else:
        (place / "cell.json").unlink()

    assert run(tmp_path / "study", wanted) == ()
    assert calls(tmp_path) == {"run-00 result": 1, "run-01 result": 2}
    assert len([*finished(tmp_path / "study" / "runs")]) == 2


def test_other_inputs_are_another_cell_beside_the_first(tmp_path: Path):
    (cell,), (other,) = cells(tmp_path, 1), cells(tmp_path, 1, more=1)

    assert cell.place != other.place
    assert cell.place == cells(tmp_path, 1)[0].place


@pytest.mark.process
def test_a_grid_that_was_killed_goes_on_where_it_was(tmp_path: Path):
    process = start(tmp_path)
    wait_for_a_result(tmp_path)
    process.kill()
    process.communicate()
    done = {each.key for each in finished(tmp_path / "study" / "runs")}
    assert 0 < len(done) < 6

    run(tmp_path / "study", cells(tmp_path, 6, seconds=0.3), 2)

    assert [each.seed for each in finished(tmp_path / "study" / "runs")] == list(range(6))
    assert all(calls(tmp_path)[f"{key} result"] == 1 for key in done)
    assert not (tmp_path / "study" / "unfinished").exists()


@pytest.mark.process
def test_an_interrupt_ends_every_process_at_once_and_quietly(tmp_path: Path):
    process = start(tmp_path)
    wait_for_a_result(tmp_path)
    os.killpg(process.pid, signal.SIGINT)  # a terminal's Ctrl-C reaches the workers too
    _, told = process.communicate(timeout=30)  # ends when the last of them has closed it
    started = len(calls(tmp_path))
    time.sleep(0.5)

    assert told.count(b"Traceback") == 1  # the script's own KeyboardInterrupt
    assert len(calls(tmp_path)) == started < 6


def test_a_worker_never_sees_a_stop_signal_not_even_while_it_starts(tmp_path: Path):
    run(tmp_path / "study", cells(tmp_path, 2), 2)

    assert all(each.result["deaf"] for each in finished(tmp_path / "study" / "runs"))
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())


@pytest.mark.process
def test_two_commands_at_one_study_agree(tmp_path: Path):
    process = start(tmp_path)
    wait_for_a_result(tmp_path)

    failed = run(tmp_path / "study", cells(tmp_path, 6, seconds=0.3), 2)
    out, _ = process.communicate(timeout=60)
    assert (failed, process.returncode) == ((), 0)
    assert [each.seed for each in finished(tmp_path / "study" / "runs")] == list(range(6))
    assert max(calls(tmp_path).values()) <= 2
    assert not (tmp_path / "study" / "unfinished").exists()
    assert b"a plug-in may print" not in out


def test_a_worker_with_other_versions_is_refused_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    wanted = cells(tmp_path, 2)
    for cell in wanted:
        assert cell.place
    installed = result_files.versions()["numpy"]
    others = {**result_files.versions(), "numpy": "1.0.0"}
    monkeypatch.setattr(result_files, "versions", lambda: others)

    with pytest.raises(InputError, match=rf"the worker on .*numpy {installed}, this command has"):
        run(tmp_path / "study", wanted)
    assert not calls(tmp_path)


@pytest.mark.parametrize(
    ("there", "requested"),
    [({"gap": None}, {}), ({}, {"gap": None}), ({"gap": None}, {"gap": 0}), ({"a": 1}, {})],
)
def test_a_value_that_is_absent_differs_from_null(there: dict, requested: dict):
    assert difference(there, requested) is not None


@pytest.mark.parametrize("key", ["", "..", "a/b", ".hidden", "a b"])
def test_a_key_that_cannot_name_a_folder_is_refused(key: str):
    with pytest.raises(ValueError, match="a key that is a valid folder name"):
        Cell(WORK, key, {}, 0)


@given(
    st.recursive(
        st.none() | st.booleans() | st.floats(allow_nan=False) | st.text(),
        lambda inner: st.dictionaries(st.text(), inner) | st.lists(inner),
    )
)
def test_a_value_does_not_differ_from_what_its_file_says(value: object):
    assert difference(json.loads(json.dumps(value)), value) is None
