"""Promises of the plan: wrong input is refused before anything is run, and runs are resumable."""

from pathlib import Path

import pytest

from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.errors import InputError
from selfmodel.experiments.paper.plan import (
    COMPARATORS,
    ON_ROBOT,
    PaperStudy,
    cells,
    check,
)
from selfmodel.settings import Settings


def test_the_default_is_the_papers_experiment_with_its_comparator_first():
    study = PaperStudy(folder=Path("out"))

    check(study)
    assert (study.robots, study.cases) == (("quadruped", "hexapod"), tuple(range(1, 11)))
    assert study.settings == Settings()
    assert (study.comparators[0], *COMPARATORS) == (
        FORWARD_DISPLACEMENT.name,
        "forward-displacement",
        "auto",
    )


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"robots": ["quadrped"]}, "unknown robot of the paper 'quadrped': did you mean quadruped"),
        ({"robots": ["suite-walker-walk"]}, "the known ones are quadruped, hexapod"),
        ({"cases": [1, 11]}, "unknown case of Table I '11'"),
        ({"comparators": ["nope"]}, "unknown comparator 'nope'"),
        ({"comparators": [ON_ROBOT]}, "is no comparator"),
    ],
)
def test_wrong_input_is_refused(tmp_path: Path, wrong: dict, message: str):
    with pytest.raises(InputError, match=message):
        check(PaperStudy(folder=tmp_path, **wrong))


def test_each_robot_and_seed_has_one_gait_for_all_cases_and_comparators():
    study = PaperStudy(folder=Path("out"), seeds=range(2))

    gaits = {cell.needs["gait"].place: cell.needs["gait"].key for cell in cells(study)}

    assert list(gaits.values()) == [
        *("quadruped-seed000", "hexapod-seed000"),
        *("quadruped-seed001", "hexapod-seed001"),
    ]


def test_a_run_has_a_part_for_each_comparator_and_the_control(tmp_path: Path):
    found = cells(PaperStudy(folder=tmp_path, robots=["quadruped"], cases=[1, 10]))

    runs = ["quadruped-case01-seed000", "quadruped-case10-seed000"]
    parts = ["forward-displacement", "auto", ON_ROBOT]
    assert [(cell.key, cell.part) for cell in found] == [(r, p) for r in runs for p in parts]
    truths = {cell.parameters["truth"]: None for cell in found}
    assert list(truths) == ["break:front_left_knee", "neuron:0"]
