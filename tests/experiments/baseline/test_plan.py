"""The cells of a study of baselines."""

import dataclasses
from pathlib import Path

import pytest

from selfmodel.errors import InputError
from selfmodel.experiments.baseline.plan import (
    BaselineStudy,
    cells,
    check,
    method_key,
    settings_of,
)
from selfmodel.recovery.baselines.problem import BaselineSettings
from selfmodel.recovery.baselines.registry import BASELINES


def study(folder: Path, **given: object) -> BaselineStudy:
    whole = BaselineStudy(
        robots=("quadruped", "hexapod"),
        cases=(1, 2),
        gaps=(0.0, 0.1),
        seeds=range(2),
        methods=("oracle", "random-search"),
        folder=folder,
        settings=BaselineSettings(trials=20),
    )
    return dataclasses.replace(whole, **given)


def test_there_is_a_cell_per_robot_case_gap_seed_and_method(tmp_path: Path):
    found = cells(study(tmp_path))

    assert len({cell.place for cell in found}) == len(found) == 2 * 2 * 2 * 2 * 2
    assert found[0].key == found[1].key == "quadruped-case01-gap0-seed000"
    assert found[0].parameters["truth"]
    assert [cell.part for cell in found[:2]] == ["oracle", "random-search"]


def test_shares_are_disjoint_and_together_complete(tmp_path: Path):
    whole = study(tmp_path)
    shares = [{cell.place for cell in cells(whole, (part, 3))} for part in (1, 2, 3)]

    assert set.union(*shares) == {cell.place for cell in cells(whole)}
    assert sum(map(len, shares)) == len(cells(whole))


def test_one_repertoire_of_a_robot_is_made_for_the_method_that_needs_it(tmp_path: Path):
    needing = cells(study(tmp_path, methods=("trial-and-error", "oracle")))
    repertoires = {cell.needs["repertoire"].place for cell in needing if cell.needs}

    assert {cell.part for cell in needing if cell.needs} == {"trial-and-error"}
    assert sorted(place.partition("-")[0] for place in repertoires) == [
        "repertoires/hexapod",
        "repertoires/quadruped",
    ]


@pytest.mark.parametrize(
    ("method", "trials"), [("oracle", 6), ("physical-evolution", 77), ("random-search", 20)]
)
def test_methods_have_their_own_numbers_of_trials(tmp_path: Path, method: str, trials: int):
    (first, *_) = cells(study(tmp_path, evolution_trials=77))

    assert settings_of(first.parameters["shared"], method).trials == trials


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"methods": ("orakle",)}, "unknown baseline 'orakle': did you mean oracle"),
        ({"cases": (99,)}, "unknown case of quadruped '99'"),
        ({"gaps": (0.9,)}, "expected a gap from 0 to 0.5, such as 0.1, got 0.9"),
        ({"robots": ("quadrupod",)}, "unknown robot 'quadrupod'"),
    ],
)
def test_a_wrong_study_is_refused(tmp_path: Path, given: dict, message: str):
    with pytest.raises(InputError, match=message):
        check(study(tmp_path, **given))


def test_methods_have_random_numbers_of_their_own():
    assert len({method_key(method) for method in BASELINES}) == len(BASELINES)
