"""Promises of the files of cells: one that is altered or damaged is refused, never replaced."""

import dataclasses
import json
import shutil
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from selfmodel.errors import InputError
from selfmodel.experiments.grid import Cell, check_runs, finished, processes, run_grid
from selfmodel.experiments.grid.cell_file import CELL, cell_bytes
from selfmodel.experiments.study.files import as_rows
from selfmodel.logs import result_files


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


def cell(seed: int) -> Cell:
    """A cell that no test computes: all are finished, or refused."""
    return Cell("tests:never", f"run-{seed:02d}", {"shared": {"size": 2}}, seed)


def resume(study: Path, *cells: Cell) -> None:
    """Runs a study of which every cell is finished, or refused."""
    failed = run_grid(study, cells, workers=processes(1), on_progress=lambda _: None)
    assert failed == ()


def put(study: Path, one: Cell) -> Path:
    """Writes a finished cell with a trial log, and returns its folder."""
    folder = study / one.place
    folder.mkdir(parents=True)
    (folder / "trial.mcap").write_bytes(b"a log")
    (folder / CELL).write_bytes(cell_bytes(folder, one, [ROW], 1.5, {}))
    return folder


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """The folder of a study with two finished cells."""
    for seed in (0, 1):
        put(tmp_path / "study", cell(seed))
    return tmp_path / "study"


def path_of(study: Path, seed: int) -> Path:
    return study / cell(seed).place / CELL


def test_an_untouched_folder_is_read(study: Path):
    resume(study, cell(0), cell(1))

    parts = [*finished(study / "runs")]
    assert [part.result for part in parts] == [[ROW], [ROW]]
    assert [(part.key, part.seed, part.part) for part in parts] == [
        ("run-00", 0, "result"),
        ("run-01", 1, "result"),
    ]
    assert {part.made_with["numpy"] for part in parts} == {result_files.versions()["numpy"]}


def refused(study: Path, reason: str) -> None:
    """Checks that both readers refuse the first cell with its name and the remedy."""
    path = path_of(study, 0)
    data = path.read_bytes()
    for read in (lambda: [*finished(study / "runs")], lambda: resume(study, cell(0), cell(1))):
        with pytest.raises(InputError, match=rf"{path}.*{reason}.*delete the file, and the same"):
            read()
    assert path.read_bytes() == data


def test_a_figure_changed_by_hand_is_refused(study: Path):
    path = path_of(study, 0)
    path.write_text(path.read_text().replace('"length": 0.25', '"length": 0.26'))

    refused(study, "digest is missing or wrong, so it was altered or damaged")


def sealed(**changes: object) -> bytes:
    """A ``cell.json`` with other values and its right digest."""
    values = {"cell": cell(0).definition, "result": [ROW], "files": {}, "seconds": 1.5}
    return result_files.result_bytes({**values, **changes})


HOSTILE = {
    "an empty object": b"{}",
    "an empty list": b"[]",
    "an empty file": b"",
    "nested lists": b"[" * 100_000,
    "nested objects": b'{"a":' * 100_000,
    "latin-1": '{"status": "é"}'.encode("latin-1"),
    "NaN": b'{"status": "done", "result": [NaN]}',
    "other keys": result_files.result_bytes({"cell": cell(0).definition, "outcome": 1}),
    "no files": result_files.result_bytes({"cell": cell(0).definition, "result": 1}),
    "no digest": json.dumps({"cell": cell(0).definition, "result": 1, "files": {}}).encode(),
    "a list of files": sealed(files=["trial.mcap"]),
    "a definition that is no object": sealed(cell="run-00"),
    "a seed as text": sealed(cell={**cell(0).definition, "seed": "0"}),
    "parameters as text": sealed(cell={**cell(0).definition, "parameters": "{}"}),
    "enormous": b" " * (result_files.MAX_BYTES + 1),
}


@pytest.mark.parametrize("data", HOSTILE.values(), ids=HOSTILE)
def test_a_file_that_is_no_cell_is_refused(study: Path, data: bytes):
    path_of(study, 0).write_bytes(data)

    refused(study, "")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_changed_byte_of_a_cell_is_refused_or_changes_nothing(study: Path, data: st.DataObject):
    path = path_of(study, 0)
    original = path.read_bytes()
    altered = bytearray(original)
    altered[data.draw(st.integers(0, len(original) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(altered)
    try:
        assert [part.result for part in finished(study / "runs")] == [[ROW], [ROW]]
    except InputError as error:
        assert str(path) in str(error)  # noqa: PT017  # most changes are refused, some are none
    finally:
        path.write_bytes(original)


def test_a_file_of_another_cell_is_refused(study: Path):
    shutil.copy(path_of(study, 1), path_of(study, 0))

    refused(study, "expected the cell of its folder, got that of run-01-result-")


def test_a_cell_is_not_counted_twice_under_another_name(study: Path):
    folder = path_of(study, 0).parent
    shutil.copytree(folder, folder.with_name("run-00-copy"))

    with pytest.raises(InputError, match=r"run-00-copy/cell\.json: expected the cell of its"):
        [*finished(study / "runs")]


def test_a_cell_with_another_definition_and_its_right_digest_is_refused(study: Path):
    path_of(study, 0).write_bytes(
        sealed(cell={**cell(0).definition, "parameters": {"shared": {"size": 3}}})
    )

    refused(study, "expected the cell of its folder")


def test_a_log_that_was_changed_after_its_cell_is_refused_and_a_deleted_one_is_not(study: Path):
    log = path_of(study, 0).with_name("trial.mcap")
    log.write_bytes(b"another")
    for read in (lambda: [*finished(study / "runs")], lambda: resume(study, cell(0), cell(1))):
        with pytest.raises(InputError, match=r"trial\.mcap was changed after .*cell\.json was"):
            read()
    log.unlink()
    resume(study, cell(0), cell(1))

    assert len([*finished(study / "runs")]) == 2


def test_a_log_of_a_needed_cell_that_was_changed_is_refused(study: Path):
    needing = Cell("tests:never", "run-02", {}, 2, needs={"it": cell(0)})
    folder = study / needing.place
    folder.mkdir()
    need = next(part for part in finished(study / "runs") if part.seed == 0)
    (folder / CELL).write_bytes(cell_bytes(folder, needing, [ROW], 1.5, {"it": need}))
    resume(study, needing)
    path_of(study, 0).with_name("trial.mcap").write_bytes(b"another")
    path_of(study, 0).unlink()

    with pytest.raises(InputError, match=r"trial\.mcap was changed after .*run-02.*was made"):
        [*finished(study / "runs")]


@pytest.fixture
def older(study: Path) -> Path:
    """A study whose second cell was made with another version of numpy."""
    others = {**result_files.versions(), "numpy": "1.0.0"}
    shutil.rmtree(path_of(study, 1).parent)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(result_files, "versions", lambda: others)
        put(study, cell(1))
    return study


def test_a_folder_of_other_versions_is_not_continued(older: Path):
    installed = result_files.versions()["numpy"]

    with pytest.raises(InputError, match=rf"run-01.* was made with .*numpy 1\.0\.0.*{installed}"):
        resume(older, cell(0))


def test_cells_of_two_versions_are_not_in_one_table(older: Path):
    with pytest.raises(InputError, match=r"run-01.*numpy 1\.0\.0, .*run-00.*a table is of one"):
        [*finished(older / "runs")]


def test_a_folder_of_0_1_is_refused_with_the_reason(tmp_path: Path):
    run = tmp_path / "runs" / "run-00"
    run.mkdir(parents=True)
    (run / "run.json").write_text('{"key": "run-00", "seed": 0, "parameters": {}}')
    readers = (
        lambda: [*finished(tmp_path / "runs")],
        lambda: resume(tmp_path, cell(0)),
        lambda: check_runs(tmp_path, [cell(0)], "a study"),
    )
    for read in readers:
        with pytest.raises(InputError, match=r"run-00/run\.json is of a study of an earlier"):
            read()
    assert [path.name for path in tmp_path.rglob("*")] == ["runs", "run-00", "run.json"]


def robot_cell(seed: int, *, model: str = "a", gait: str = "trot", size: int = 2) -> Cell:
    """A cell of a robot, which needs a gait."""
    needs = {"gait": Cell("tests:never", "gait", {"gait": gait}, 0, kind="gaits")}
    parameters = {"robot": "legs.xml", "model": model, "shared": {"size": size}}
    return Cell("tests:never", f"run-{seed}", parameters, seed, needs=needs)


@pytest.mark.parametrize(
    ("other", "message"),
    [
        (robot_cell(1, size=3), r"contains a study with other settings \(size is 2 there"),
        (robot_cell(1, model="b"), r'other settings \(the model of legs\.xml is "a" there'),
        (robot_cell(0, gait="walk"), r"contains run-0, result, made with other inputs, such as an"),
    ],
    ids=["settings", "model", "gait"],
)
def test_runs_with_other_inputs_are_not_added_to_a_study(tmp_path: Path, other: Cell, message: str):
    put(tmp_path, robot_cell(0))
    check_runs(tmp_path, [robot_cell(0), robot_cell(1)], "a study")
    check_runs(tmp_path, [], "a study")

    with pytest.raises(InputError, match=message):
        check_runs(tmp_path, [other], "a study")


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
def test_a_row_with_other_columns_or_types_is_refused(study: Path, row: object, reason: str):
    (part, other) = finished(study / "runs")
    assert as_rows(Row, part) == [Row(**ROW)]
    part = dataclasses.replace(part, result=[row])

    with pytest.raises(InputError, match=rf"cell\.json: expected the rows.*{reason}.*delete"):
        as_rows(Row, part)
    assert as_rows(Row, other) == [Row(**ROW)]
