"""The runs of a study of baselines."""

import dataclasses
import json
from pathlib import Path

import pytest

from selfmodel.experiments.baseline import work
from selfmodel.experiments.baseline.plan import WITH_REPERTOIRE, BaselineStudy, cells
from selfmodel.experiments.baseline.results import write_results
from selfmodel.experiments.grid import Cell, PartEnds, processes, run_grid
from selfmodel.recovery.baselines.measurement import measure
from selfmodel.recovery.baselines.problem import BaselineSettings
from selfmodel.recovery.baselines.registry import BASELINES
from tests.helpers.drivers import random_of

SMALL = BaselineSettings(trials=2, evaluations=6, searches=2, population=4, period=1)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> BaselineStudy:
    """A study of one cell, with its repertoire."""
    whole = BaselineStudy(
        robots=("quadruped",),
        cases=(2,),
        gaps=(0.1,),
        seeds=(3,),
        methods=tuple(BASELINES),
        folder=tmp_path_factory.mktemp("study"),
        settings=SMALL,
        steps=20,
        evolution_trials=5,
        repertoire_evaluations=20,
    )
    repertoire = cell(whole, WITH_REPERTOIRE).needs["repertoire"]
    work.make(repertoire, {}, whole.folder)
    return whole


def cell(study: BaselineStudy, method: str = "oracle") -> Cell:
    (one,) = cells(dataclasses.replace(study, methods=(method,)))
    return one


def needs(study: BaselineStudy, method: str) -> dict[str, Path]:
    return dict.fromkeys(cell(study, method).needs, study.folder)


@pytest.mark.parametrize(
    ("method", "trials"), [("random-search", 2), ("trial-and-error", 2), ("physical-evolution", 5)]
)
def test_a_row_has_the_trials_and_the_cost_of_a_method(
    study: BaselineStudy, method: str, trials: int
):
    row = work.run(cell(study, method), needs(study, method), study.folder)

    assert (row["method"], row["robot"], row["case"], row["seed"]) == (method, "quadruped", 2, 3)
    assert 1 <= len(row["best"]) <= trials
    assert len({len(row[key]) for key in ("best", "upright", "fallen", "steps")}) == 1
    assert row["simulated_steps"] == 0
    assert json.dumps(row, allow_nan=False)


def test_simulated_steps_of_a_search_are_counted(study: BaselineStudy):
    row = work.run(cell(study, "healthy-evolution"), {}, study.folder)

    # A first generation of 8, then the 4 means of the runs.
    assert row["simulated_steps"] == (8 + 4) * 20


def test_all_methods_have_the_same_physical_robot(study: BaselineStudy):
    first, second = (
        work.problem_of(cell(study, method), {})[1] for method in ("oracle", "t-resilience")
    )
    (controller,) = random_of(first.design, 1)

    assert measure(first.track, controller) == measure(second.track, controller)
    assert measure(first.track, controller) != measure(first.track, controller), "noise"


@pytest.mark.process
@pytest.mark.search
def test_a_study_is_continued_and_runs_nothing_twice(study: BaselineStudy, tmp_path: Path):
    own = dataclasses.replace(study, folder=tmp_path)
    ends: list[PartEnds] = []

    def note(event: object) -> None:
        ends.extend([event] if isinstance(event, PartEnds) else [])

    assert run_grid(tmp_path, cells(own), workers=processes(1), on_progress=note) == ()
    first = write_results(tmp_path)
    assert run_grid(tmp_path, cells(own), workers=processes(1), on_progress=note) == ()

    assert len(ends) == 1 + len(BASELINES)
    assert {row.method for row in first.rows} == set(BASELINES)
    assert write_results(tmp_path) == first
    lines = (tmp_path / "results.jsonl").read_text().splitlines()
    assert [json.loads(line)["method"] for line in lines] == sorted(BASELINES)
