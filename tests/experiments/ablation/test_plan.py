"""Promises of what an ablation consists of: its robots, its cases and its damages."""

import dataclasses
from collections import Counter
from pathlib import Path

import pytest

from selfmodel.errors import InputError
from selfmodel.experiments.ablation import Ablation, ablate, collect, write_results
from selfmodel.experiments.ablation.plan import cells, check, runs
from selfmodel.experiments.ablation.run_one import recover
from selfmodel.experiments.grid import processes
from selfmodel.experiments.study.gaits import evolve
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings


def small(folder: Path, **changes: object) -> Ablation:
    """An ablation that takes a second or two."""
    usual = {"robots": ["quadruped"], "cases": [1], "comparators": ["forward-displacement"]}
    settings = Settings(steps=60, generations=2, trials=2).scaled(6)
    return Ablation(
        **{**usual, "gaps": [0.0], "seeds": [5], "folder": folder, "settings": settings, **changes}
    )


def test_a_damage_that_is_given_twice_is_one(tmp_path: Path):
    one, other = "friction=0.4+break:back_left_knee", "break:back_left_knee+friction=0.40"
    ablation = small(tmp_path, cases=[], damages=[one, "intact", other, "intact"])

    assert [cell.truth for cell in runs(ablation)] == [other[:-1], "intact"]


def test_all_cases_are_those_that_each_robot_can_have(tmp_path: Path):
    ablation = small(tmp_path, robots=["quadruped", "suite-walker-walk"], cases=None)
    check(ablation)
    found = Counter(cell.robot for cell in runs(ablation))

    assert found["quadruped"] == 10
    assert 0 < found["suite-walker-walk"] < 10


def test_there_are_as_many_trials_without_a_gap_as_there_are_gaits(tmp_path: Path):
    check(small(tmp_path, settings=Settings(trials=6)))
    check(small(tmp_path, settings=Settings(trials=7), gaps=[0.05]))
    with pytest.raises(InputError, match="at most 6 trials, got 7"):
        check(small(tmp_path, settings=Settings(trials=7), gaps=[0.05, 0.0]))


def test_the_repair_is_a_parameter_of_the_cells_and_the_papers_by_default(tmp_path: Path):
    ablation = small(tmp_path, next_trial="repair")
    (paper,) = cells(ablation)
    (robust,) = cells(dataclasses.replace(ablation, repair="robust"))
    shared = paper.parameters["shared"]

    assert (shared["repair"], shared["search"], shared["score"]) == ("paper", "ea", "displacement")
    assert robust.parameters["shared"] == {
        **shared,
        "repair": "robust",
        "search": "cma-es",
        "score": "upright",
    }
    gaits = [cell.needs["gait"].parameters for cell in (paper, robust)]
    assert [gait["repair"] for gait in gaits] == ["paper", "robust"]
    assert [gait["score"] for gait in gaits] == ["displacement", "upright"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"repair": "papers"}, "unknown repair 'papers'"),
        ({"repair": "robust", "search": "repertoire"}, "a study of many has none"),
        ({"repair": "robust", "bank": Path("gaits")}, "all gaits are given and nothing is evolved"),
    ],
)
def test_a_repair_that_cannot_be_is_refused(options: dict, message: str, tmp_path: Path):
    with pytest.raises(InputError, match=message):
        check(small(tmp_path, **options))
    check(small(tmp_path, repair="robust", bank=Path("gaits"), next_trial="repair"))


@pytest.mark.search
def test_a_recovery_of_an_ablation_has_the_repair_of_its_study(tmp_path: Path):
    # After one generation, the best untried controller of both is the same first random one.
    settings = Settings(steps=40, generations=2, trials=2).scaled(4)
    (cell,) = cells(small(tmp_path, settings=settings, next_trial="repair", repair="robust"))
    for name in ("gait", "run"):
        (tmp_path / name).mkdir()
    evolve(cell.needs["gait"], {}, tmp_path / "gait")
    rows = recover(cell, {"gait": tmp_path / "gait"}, tmp_path / "run")
    paper = dataclasses.replace(
        cell,
        parameters={
            **cell.parameters,
            "shared": {**cell.parameters["shared"], "repair": "paper", "search": "ea"},
        },
    )
    (tmp_path / "paper").mkdir()
    other = recover(paper, {"gait": tmp_path / "gait"}, tmp_path / "paper")

    assert [(row["repair"], row["search"]) for row in rows] == [("robust", "cma-es")] * 2
    assert [(row["repair"], row["search"]) for row in other] == [("paper", "ea")] * 2
    assert rows[-1]["recovered"] != other[-1]["recovered"]


@pytest.mark.search
def test_a_robot_of_ones_own_is_ablated_by_the_name_of_its_file(
    quadruped: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    Path("mine.xml").write_text(quadruped.mjcf, encoding="utf-8")
    ablation = small(tmp_path / "out", robots=["./mine.xml"])

    assert ablate(ablation, workers=processes(1), on_progress=lambda _event: None) == ()
    assert {row.robot for row in collect(ablation.folder)} == {"./mine.xml"}
    assert {
        path.name for path in write_results(ablation.folder).files if path.suffix == ".png"
    } == {*("gap.png", "cases-mine-1.png", "cases-mine-2.png")}
    assert len([*ablation.folder.glob("runs/mine-case01-gap0.0-seed005-*")]) == 1
    with pytest.raises(InputError, match=r"mine.xml and ./mine.xml would have the same file names"):
        check(small(tmp_path, robots=["mine.xml", "./mine.xml"]))
