"""Promises of a recovery of a study: it has the repair of its study, on any body."""

from pathlib import Path

import pytest

from selfmodel.comparators import DEFAULT
from selfmodel.experiments.study.gaits import evolve
from selfmodel.experiments.suite import work
from selfmodel.experiments.suite.plan import Study, cells
from selfmodel.settings import Settings
from selfmodel.studies.experiment import Experiment, run
from tests.robot.mjcf.samples import SAMPLES

TINY = Settings(steps=60, generations=1, trials=1).scaled(4)


@pytest.mark.bodies
@pytest.mark.search
@pytest.mark.parametrize(
    "body",
    ["suite-hopper-stand", str(SAMPLES["gymnasium hopper"])],
    ids=["dm_control", "gymnasium"],
)
def test_the_robust_repair_recovers_bodies_of_others_across_a_gap(
    body: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    asked: list[Experiment] = []
    monkeypatch.setattr(
        work, "run", lambda made, on_event: asked.append(made) or run(made, on_event)
    )
    study = Study(
        bodies=[body],
        cases=[2],
        seeds=[0],
        folder=tmp_path,
        settings=TINY,
        score=None,
        controller="network",
        comparator=DEFAULT.name,
        kinds="break",
        gap=0.1,
        repair="robust",
    )
    (cell,) = cells(study)
    for name in ("gait", "run"):
        (tmp_path / name).mkdir()
    evolve(cell.needs["gait"], {}, tmp_path / "gait")
    (row,) = work.recover(cell, {"gait": tmp_path / "gait"}, tmp_path / "run")

    assert (row["repair"], row["search"]) == ("robust", "cma-es")
    assert row["trials"] == 2
    assert [(made.repair, made.search, made.score.name) for made in asked] == [
        ("robust", "cma-es", "upright"),
    ]
