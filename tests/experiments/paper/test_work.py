"""Promises of the runs: those of ``selfmodel recover``, and the paper's control."""

import json
import shutil
from pathlib import Path

import pytest

from selfmodel.experiments.grid import GridBegins, PartEnds, finished, processes, run_grid
from selfmodel.experiments.paper.plan import ON_ROBOT, PaperStudy, cells
from selfmodel.experiments.paper.results import PaperResults, collect, write_results
from selfmodel.settings import Settings
from tests.helpers.command import SMALL, selfmodel

pytestmark = [pytest.mark.process, pytest.mark.search]

SETTINGS = Settings(steps=60, trials=2, generations=2).scaled(8)


def study(folder: Path, *comparators: str) -> PaperStudy:
    return PaperStudy(
        folder=folder,
        robots=["quadruped"],
        cases=[1],
        seeds=[3],
        comparators=comparators,
        settings=SETTINGS,
    )


def run(wanted: PaperStudy) -> list[GridBegins | PartEnds]:
    """Runs an experiment and returns its events."""
    events: list[GridBegins | PartEnds] = []
    pool = processes(1)
    assert run_grid(wanted.folder, cells(wanted), workers=pool, on_progress=events.append) == ()
    return events


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, PaperResults]:
    """A folder with an experiment of one case and the paper's comparator, and its results."""
    folder = tmp_path_factory.mktemp("paper")
    run(study(folder, "forward-displacement"))
    return folder, write_results(folder)


def test_a_recovery_is_that_of_the_command_with_the_papers_options(
    made: tuple[Path, PaperResults], tmp_path: Path
):
    options = ("--case", "1", "--seed", "3", *SMALL, "--steps", "60", "--trials", "2")
    options += ("--kinds", "paper", "--comparator", "forward-displacement", "--no-calibrate")
    options += ("--repair", "paper")

    done = selfmodel("recover", "quadruped", *options, "--out", "out", "--json", cwd=tmp_path)
    found = json.loads(done.stdout)

    (row,) = made[1].recoveries
    assert (row.best, row.correct) == (found["diagnosis"][0]["hypothesis"], found["correct"])
    assert [trial.displacement for trial in made[1].trials] == [
        trial["displacement"] for trial in found["trials"]
    ]


def test_the_control_evolves_on_the_damaged_robot_from_the_gait(made: tuple[Path, PaperResults]):
    rows, (recovery,) = made[1].evolution, made[1].recoveries

    assert [row.evaluations for row in rows] == [8, 12]
    assert {row.before for row in rows} == {recovery.before}
    assert rows[1].best >= rows[0].best >= recovery.after


def test_a_further_comparator_runs_nothing_again(made: tuple[Path, PaperResults], tmp_path: Path):
    shutil.copytree(made[0], tmp_path / "copy")

    events = run(study(tmp_path / "copy", "forward-displacement", "gait-pattern"))

    assert [event.part for event in events if isinstance(event, PartEnds)] == ["gait-pattern"]
    found = collect(tmp_path / "copy")
    assert [row.comparator for row in found.recoveries] == ["forward-displacement", "gait-pattern"]
    assert found.recoveries[0] == made[1].recoveries[0]
    assert found.evolution == made[1].evolution


def test_a_deleted_result_is_made_again_the_same_to_the_bit(
    made: tuple[Path, PaperResults], tmp_path: Path
):
    folder = tmp_path / "copy"
    shutil.copytree(made[0], folder)
    for cell in folder.glob("runs/*/cell.json"):
        cell.unlink()

    run(study(folder, "forward-displacement"))

    found = collect(folder)
    assert found.trials == made[1].trials
    assert found.evolution == made[1].evolution
    assert {part.part for part in finished(folder / "runs")} == {"forward-displacement", ON_ROBOT}
