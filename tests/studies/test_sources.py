"""Promises of the code outside of selfmodel that computes a cell: a change is seen, and said."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from selfmodel.errors import InputError
from selfmodel.studies import cells as cell_files
from selfmodel.studies.cells import Cell
from selfmodel.studies.sources import sources_of

ROOT = Path(__file__).parents[2]

SCRIPT = """
import sys
import warnings
from pathlib import Path
from selfmodel.studies import Study, points_of

FACTOR = {factor}

def work(parameters, needs, folder):
    import importlib
    return {{"way_is": importlib.import_module(parameters["way"]).VALUE}}

if __name__ == "__main__":
    points = points_of(way=["own_way", "other_way"], seed=range(3))
    study = Study("mine", "study", "my_work:work", points, modules=lambda point: [point["way"]])
    events = []
    with warnings.catch_warnings(record=True) as warned:
        study.run(workers=2, on_event=events.append)
    begins, *ends = events
    print([begins.finished, sorted(end.name for end in ends)])
    assert [str(one.message) for one in warned] == [begins.earlier] * bool(begins.earlier)
    print(begins.earlier)
    print([(row["way"], row["seed"], row["way_is"]) for row in study.rows()])
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, first in Python's path; each test has names of its own there."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write(folder: Path, **files: str) -> None:
    for name, text in files.items():
        path = folder.joinpath(*name.split("__in__")[::-1]).with_suffix(".py")
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)


def test_the_code_of_a_module_is_what_it_imports_from_its_folder(folder: Path):
    write(
        folder,
        lone="import numpy.linalg, beside\nfrom pack import inner\nimport json",
        beside="from selfmodel import errors",
        apart="",
        deeper__in__pack="",
        inner__in__pack="from . import deeper\nfrom .deeper import x as y",
        unused__in__pack="",
    )
    assert set(sources_of(("lone",))) == {"lone.py", "beside.py", "pack/inner.py", "pack/deeper.py"}
    write(folder, __init____in__whole="", a__in__whole="from .. import apart", b__in__whole="")
    assert set(sources_of(("whole.a", "apart"))) == {"whole/__init__.py", "whole/a.py", "apart.py"}


def test_an_installed_module_has_the_code_of_its_own_package(
    folder: Path, monkeypatch: pytest.MonkeyPatch
):
    installed = folder / "site-packages"
    installed.mkdir()
    monkeypatch.syspath_prepend(str(installed))
    write(installed, theirs="import library", library="")

    assert set(sources_of(("theirs",))) == {"theirs.py"}


@pytest.mark.parametrize(
    ("text", "reason"), [(None, "the file of the module wrong_1 is not found"), ("(", "correct it")]
)
def test_code_that_cannot_be_read_is_refused(folder: Path, text: str | None, reason: str):
    write(folder, **({} if text is None else {"wrong_2": text}))
    with pytest.raises(InputError, match=reason):
        sources_of(("wrong_1" if text is None else "wrong_2",))


def test_a_worker_with_another_source_of_a_plug_in_is_refused(folder: Path):
    write(folder, worked="")
    cell = Cell("tests.helpers.grids:work", "run", {}, modules=("worked",))
    theirs = {**cell.made_with(), "worked.py": "another"}

    with pytest.raises(InputError, match=r"the worker on .* has .*worked.py .*worked.py another"):
        cell_files.compute(folder, cell, theirs)


def study_in(folder: Path) -> tuple[str, str, str]:
    """The start of a study in a process of its own, what it says, and its rows."""
    command = [sys.executable, "my_work.py"]
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{folder}"}
    told = subprocess.run(command, cwd=folder, env=environment, check=True, capture_output=True)
    start, said, rows = told.stdout.decode().splitlines()
    return start, said, rows


@pytest.mark.process
def test_an_edited_plug_in_makes_its_own_cells_again_and_its_earlier_rows_leave_the_table(
    folder: Path,
):
    write(folder, my_work=SCRIPT.format(factor=1), own_way="VALUE = 1", other_way="VALUE = 2")
    first = study_in(folder)
    assert first[1] == ""
    # Of another size: the bytecode of a source is that of its second and size.
    write(folder, own_way="VALUE = 1 + 2")
    begun, said, rows = study_in(folder)

    names = [f"way=own_way-seed={seed}" for seed in range(3)]
    assert begun == str([3, names])
    moved = "3 cells made by another own_way.py: moved to study/earlier"
    assert said == f"{moved}; those that this study lacks are computed again"
    assert rows == first[2].replace(
        "('own_way', 0, 1), ('own_way', 1, 1), ('own_way', 2, 1)",
        "('own_way', 0, 3), ('own_way', 1, 3), ('own_way', 2, 3)",
    )
    assert study_in(folder) == (str([6, []]), "", rows)

    write(folder, own_way="VALUE = 1")  # what was made by it is finished
    begun, said, rows = study_in(folder)
    assert (begun, said) == (
        str([6, []]),
        f"{moved}; 3 cells of this source: used again from there",
    )
    assert rows == first[2]
    write(folder, my_work=SCRIPT.format(factor=2))
    assert study_in(folder)[0] == str([0, [f"way=other_way-seed={n}" for n in range(3)] + names])


@pytest.mark.process
def test_a_table_has_no_rows_of_two_sources_of_a_plug_in(folder: Path):
    write(folder, my_work=SCRIPT.format(factor=1), own_way="VALUE = 1", other_way="VALUE = 2")
    study_in(folder)
    shutil.copytree(folder / "study" / "runs", folder / "runs")
    write(folder, own_way="VALUE = 1 + 2")
    _, _, rows = study_in(folder)
    shutil.copytree(folder / "runs", folder / "study" / "runs", dirs_exist_ok=True)
    with pytest.raises(InputError, match=r"with own_way.py .*: a table is of one version of each"):
        list(cell_files.finished(folder / "study" / "runs"))

    assert study_in(folder)[0] == str([6, []])  # they are moved aside again
    assert study_in(folder)[2] == rows
