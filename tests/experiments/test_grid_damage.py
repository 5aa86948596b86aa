"""Promises of a grid's folder: an altered or damaged file is refused, and is never replaced."""

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from selfmodel.errors import InputError
from selfmodel.experiments.grid import Job, PartResult, finished, run_grid
from selfmodel.experiments.grid.definition import write_definition
from selfmodel.experiments.grid.parts import done, part_bytes, write_part
from selfmodel.experiments.study_files import as_rows
from selfmodel.logs import result_files

PART = "run-00/parts/result.json"
RUN = "run-00/run.json"


@dataclass(frozen=True)
class Row:
    """Row of a table.

    Attributes:
        name: A text.
        length: A length, m.
        count: A number, if known.
        right: Whether the row is right.
    """

    name: str
    length: float
    count: int | None
    right: bool


ROW = {"name": "a", "length": 0.25, "count": None, "right": True}


def job(seed: int, *, version: str = "0.1.0") -> Job:
    return Job(f"run-{seed:02d}", {"shared": {"selfmodel": version}}, seed)


def never(*_: object) -> None:
    """Fails: every part of these grids is finished, or refused."""
    raise AssertionError("a part ran again")


def resume(folder: Path, *jobs: Job) -> None:
    """Runs a grid of which every part is finished, or refused."""
    run_grid(folder, jobs, never, workers=1, on_progress=lambda _: None)


@pytest.fixture
def grid(tmp_path: Path) -> Path:
    """A folder with two finished runs, each with a trial log."""
    folder = tmp_path / "runs"
    for seed in (0, 1):
        run = folder / f"run-{seed:02d}"
        write_definition(run, job(seed).definition)
        (run / "trial.mcap").write_bytes(b"a log")
        outcome = {**done(run, PartResult([ROW], [run / "trial.mcap"])), "seconds": 1.5}
        write_part(run, "result", part_bytes(job(seed).definition, "result", outcome))
    return folder


def of_0_1(folder: Path) -> None:
    """Rewrites the files of a grid as version 0.1 wrote them."""
    kept = {"key", "seed", "parameters"}, {"status", "result", "seconds"}
    for path in folder.rglob("*.json"):
        values = json.loads(path.read_bytes())
        keys = kept[path.parent.name == "parts"]
        path.write_text(json.dumps({key: values[key] for key in values if key in keys}))


def rewrite(path: Path, change: Callable[[dict], object]) -> None:
    """Changes the values of a file and keeps its digest."""
    values = json.loads(path.read_bytes())
    change(values)
    path.write_text(json.dumps(values))


def test_an_untouched_folder_is_read(grid: Path):
    resume(grid, job(0), job(1))

    assert [part.result for part in finished(grid)] == [[ROW], [ROW]]
    assert {part.made_with["numpy"] for part in finished(grid)} == {
        result_files.versions()["numpy"]
    }


def refused(folder: Path, path: str, reason: str) -> None:
    """Checks that both readers refuse a file with its name and the remedy, and leave it alone."""
    data = (folder / path).read_bytes()
    for read in (lambda: [*finished(folder)], lambda: resume(folder, job(0), job(1))):
        with pytest.raises(InputError, match=rf"{path}.*{reason}.*delete the file, and the same"):
            read()
    assert (folder / path).read_bytes() == data


def test_a_figure_changed_by_hand_is_refused(grid: Path):
    path = grid / PART
    path.write_text(path.read_text().replace('"length": 0.25', '"length": 0.26'))

    refused(grid, PART, "digest is missing or wrong, so it was altered or damaged")


HOSTILE = {
    "an empty object": b"{}",
    "an empty list": b"[]",
    "an empty file": b"",
    "nested lists": b"[" * 100_000,
    "nested objects": b'{"a":' * 100_000,
    "latin-1": '{"status": "é"}'.encode("latin-1"),
    "NaN": b'{"status": "done", "result": [NaN]}',
    "other keys": b'{"status": "done", "outcome": 1}',
    "another status": b'{"status": "perfect", "result": 1}',
    "a status that is no text": b'{"status": ["done"], "result": 1}',
    "no digest": json.dumps({"status": "done", "result": [ROW], "seconds": 1}).encode(),
    "numbers as text": b'{"key": "run-00", "seed": "0", "parameters": {}}',
    "parameters as text": b'{"key": "run-00", "seed": 0, "parameters": "{}"}',
    "enormous": b" " * (result_files.MAX_BYTES + 1),
}


@pytest.mark.parametrize("path", [PART, RUN])
@pytest.mark.parametrize("data", HOSTILE.values(), ids=HOSTILE)
def test_a_file_that_is_no_part_or_definition_is_refused(grid: Path, path: str, data: bytes):
    (grid / path).write_bytes(data)

    refused(grid, path, "")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_changed_byte_of_a_part_is_refused_or_changes_nothing(grid: Path, data: st.DataObject):
    path = grid / PART
    original = path.read_bytes()
    altered = bytearray(original)
    altered[data.draw(st.integers(0, len(original) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(altered)
    try:
        assert [part.result for part in finished(grid)] == [[ROW], [ROW]]
    except InputError as error:
        assert str(path) in str(error)  # noqa: PT017  # most changes are refused, some are none
    finally:
        path.write_bytes(original)


def test_a_part_of_another_run_is_refused(grid: Path):
    shutil.copy(grid / "run-01" / "parts" / "result.json", grid / PART)

    refused(grid, PART, "expected the part result of the run run-00, with its digest, got another")


def test_a_part_whose_files_are_no_object_is_refused_with_its_right_digest(grid: Path):
    path = grid / PART
    content = result_files.verified(json.loads(path.read_bytes())).content
    path.write_bytes(result_files.result_bytes({**content, "files": ["trial.mcap"]}))

    refused(grid, PART, "got other keys or values")


@pytest.mark.parametrize(("name", "part"), [("better", "better"), ("%72esult", "result")])
def test_a_part_is_not_counted_twice_under_another_name(grid: Path, name: str, part: str):
    shutil.copy(grid / PART, grid / "run-00" / "parts" / f"{name}.json")

    with pytest.raises(InputError, match=rf"{name}\.json: expected the part {part} of the run"):
        [*finished(grid)]


def test_a_run_is_not_counted_twice_under_another_name(grid: Path):
    shutil.copytree(grid / "run-00", grid / "run-00-copy")

    with pytest.raises(InputError, match="expected the definition of the run run-00-copy, got"):
        [*finished(grid)]


def test_a_log_that_was_changed_after_its_part_is_refused_and_a_deleted_one_is_not(grid: Path):
    log = grid / "run-00" / "trial.mcap"
    log.write_bytes(b"another")
    for read in (lambda: [*finished(grid)], lambda: resume(grid, job(0), job(1))):
        with pytest.raises(InputError, match=r"trial\.mcap was changed after .*result\.json was"):
            read()
    log.unlink()

    assert len([*finished(grid)]) == 2


def test_a_deleted_definition_is_written_anew_and_the_parts_are_kept(grid: Path):
    (grid / RUN).unlink()
    resume(grid, job(0), job(1))

    assert len([*finished(grid)]) == 2


def make_older(*paths: Path) -> None:
    """Rewrites files as another version of numpy would have made them."""
    others = {**result_files.versions(), "numpy": "1.0.0"}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(result_files, "versions", lambda: others)
        for path in paths:
            content = result_files.verified(json.loads(path.read_bytes())).content
            path.write_bytes(result_files.result_bytes(content))


@pytest.fixture
def older(grid: Path) -> Path:
    """A grid whose second run was made with another version of numpy."""
    make_older(grid / "run-01" / "run.json", grid / "run-01" / "parts" / "result.json")
    return grid


def test_a_folder_of_other_versions_is_not_continued(older: Path):
    installed = result_files.versions()["numpy"]

    with pytest.raises(InputError, match=rf"run-01 was made with .*numpy 1\.0\.0.*{installed}"):
        resume(older, job(0))
    assert not (older / "run-02").exists()


def test_a_part_of_another_version_than_its_run_is_refused(grid: Path):
    make_older(grid / PART)

    refused(grid, PART, r"numpy 1\.0\.0, its run with .*: a study is of one version")


def test_parts_of_two_versions_are_not_in_one_table(older: Path):
    with pytest.raises(InputError, match=r"run-01.*numpy 1\.0\.0, .*run-00.*a table is of one"):
        [*finished(older)]


def test_a_folder_of_0_1_is_read_and_not_continued(grid: Path):
    of_0_1(grid)
    resume(grid, job(0), job(1))

    assert [(part.result, part.made_with) for part in finished(grid)] == [([ROW], None)] * 2
    with pytest.raises(InputError, match=r"run-00 was made by selfmodel 0\.1, .* none is added"):
        resume(grid, job(0), job(1), job(2))
    assert not (grid / "run-02").exists()


@pytest.mark.parametrize(
    ("row", "reason"),
    [
        ({**ROW, "length": "0.25"}, 'length = "0.25"'),
        ({**ROW, "count": 1.5}, "count = 1.5"),
        ({**ROW, "right": 1}, "right = 1"),
        ({**ROW, "name": None}, "name = null"),
        ({**ROW, "more": 1}, "a row without the columns name, length, count, right"),
        ({"name": "a"}, "a row without the columns name, length, count, right"),
        ([], "a row without the columns"),
    ],
)
def test_a_row_of_0_1_with_other_columns_or_types_is_refused(grid: Path, row: object, reason: str):
    of_0_1(grid)
    (part, other) = finished(grid)
    assert as_rows(Row, part) == [Row(**ROW)]
    rewrite(part.path, lambda values: values.update(result=[row]))
    (part, _) = finished(grid)

    with pytest.raises(InputError, match=rf"result\.json: expected the rows.*{reason}.*delete"):
        as_rows(Row, part)
    assert as_rows(Row, other) == [Row(**ROW)]
