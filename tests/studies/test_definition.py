"""Promises of a study in a TOML file: that of the Python call, or a sentence with file and key."""

from pathlib import Path

import pytest

from selfmodel.errors import InputError
from selfmodel.settings import RepairSettings, Settings
from selfmodel.studies import plans, read_study
from selfmodel.studies.study import Study

MINE = """study = "suite"
folder = "runs/mine"
bodies = ["quadruped"]
cases = [9]
seeds = [0, 2]
only = [1, 2]
[settings]
steps = 200
population = 20
[repair_settings]
population = 60
survivors = 40
crossovers = 2
"""


def read(folder: Path, text: str) -> Study:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return read_study(path)


def test_a_file_is_the_call_with_its_keys_and_a_population_has_the_papers_proportions(
    tmp_path: Path,
):
    called = plans.suite(
        "runs/mine",
        bodies="quadruped",
        cases=9,
        seeds=(0, 2),
        only="1/2",
        settings=Settings(steps=200).scaled(20),
        repair_settings=RepairSettings(population=60, survivors=40, crossovers=2),
    )
    found = read(tmp_path, MINE)

    assert (found.folder, list(found.points)) == (called.folder, list(called.points))
    assert [cell.place for cell in found.cells()] == [cell.place for cell in called.cells()]
    assert found.definition == MINE.encode()


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('study = "suite"', "", r"expected the key study, got none: add study = .ablation."),
        ('study = "suite"', 'study = "suit"', "unknown study 'suit': did you mean suite"),
        ('folder = "runs/mine"', "", r"expected the key folder, got none: add folder"),
        ("cases", "case", "unknown key of the study suite 'case': did you mean cases"),
        ("steps", "step", r"unknown key of \[settings\] 'step': did you mean steps"),
        ("200", '"long"', "expected a whole number as steps, got 'long'"),
        ("[settings]", "neurons = 0.5\n[settings]", "expected a whole number as neurons, got 0.5"),
        ("[settings]\nsteps = 200\n", "settings = 3 #", r"expected a table \[settings\] .* int"),
        ("[9]", "[9", "expected a study in TOML, got"),
        ("[1, 2]", "[2, 1]", r"--only needs i/n.*got \[2, 1\]"),
    ],
)
def test_another_file_is_refused_in_a_sentence(tmp_path: Path, old: str, new: str, sentence: str):
    with pytest.raises(InputError, match=f"mine.toml: {sentence}"):
        read(tmp_path, MINE.replace(old, new))
