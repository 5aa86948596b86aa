"""Promises of what an ablation consists of: its robots, its cases and its damages."""

from collections import Counter
from pathlib import Path

import pytest

from selfmodel.errors import InputError
from selfmodel.experiments.ablation import Ablation, ablate, collect, write_results
from selfmodel.experiments.ablation.plan import cells, check
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

    assert [cell.truth for cell in cells(ablation)] == [other[:-1], "intact"]


def test_all_cases_are_those_that_each_robot_can_have(tmp_path: Path):
    ablation = small(tmp_path, robots=["quadruped", "suite-walker-walk"], cases=None)
    check(ablation)
    found = Counter(cell.robot for cell in cells(ablation))

    assert found["quadruped"] == 10
    assert 0 < found["suite-walker-walk"] < 10


def test_there_are_as_many_trials_without_a_gap_as_there_are_gaits(tmp_path: Path):
    check(small(tmp_path, settings=Settings(trials=6)))
    check(small(tmp_path, settings=Settings(trials=7), gaps=[0.05]))
    with pytest.raises(InputError, match="at most 6 trials, got 7"):
        check(small(tmp_path, settings=Settings(trials=7), gaps=[0.05, 0.0]))


@pytest.mark.search
def test_a_robot_of_ones_own_is_ablated_by_the_name_of_its_file(
    quadruped: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    Path("mine.xml").write_text(quadruped.mjcf, encoding="utf-8")
    ablation = small(tmp_path / "out", robots=["./mine.xml"])

    assert ablate(ablation, workers=1, on_progress=lambda _event: None) == ()
    assert {row.robot for row in collect(ablation.folder)} == {"./mine.xml"}
    assert {
        path.name for path in write_results(ablation.folder).files if path.suffix == ".png"
    } == {*("gap.png", "cases-mine-1.png", "cases-mine-2.png")}
    assert (ablation.folder / "runs" / "mine-case01-gap0.0-seed005").is_dir()
    with pytest.raises(InputError, match=r"mine.xml and ./mine.xml would have the same file names"):
        check(small(tmp_path, robots=["mine.xml", "./mine.xml"]))
