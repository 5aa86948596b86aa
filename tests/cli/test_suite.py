"""``selfmodel suite``: the list of bodies, and studies that continue where they stopped."""

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from selfmodel.cli import app
from selfmodel.cli.suite import run
from selfmodel.comparators import DEFAULT
from selfmodel.errors import InputError
from selfmodel.experiments.study.repair_cost import RepairCost
from selfmodel.experiments.suite.bodies import DOMAINS, bodies
from selfmodel.experiments.suite.plan import (
    Study,
    cells,
    check,
    known_cases,
)
from selfmodel.experiments.suite.rows import SuiteRow, summarise
from selfmodel.logs import load_controller, read_gap
from selfmodel.settings import Settings
from tests.helpers.command import SMALL, selfmodel
from tests.robot.mjcf.awkward import CUBE

ROOT = Path(__file__).parents[2]


def studies(test: Callable[..., None]) -> Callable[..., None]:
    """Marks a test that runs a study, in worker processes."""
    return pytest.mark.process(pytest.mark.search(pytest.mark.bodies(test)))


TINY = (*SMALL, "--steps", "60", "--trials", "1", "--workers", "1")

STUDY = Study(
    bodies=[],
    cases=[],
    seeds=range(1),
    folder=Path(),
    settings=Settings(),
    score="displacement",
    controller="network",
    comparator=DEFAULT.name,
)

BIPED = """
<mujoco>
  <worldbody>
    <body name="trunk" pos="0 0 0.5">
      <freejoint/>
      <geom size="0.1" mass="2"/>
      <body name="left" pos="0 0.1 0">
        <joint name="left_hip" axis="0 1 0" range="-40 40" damping="0.1"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.03" mass="0.5"/>
      </body>
      <body name="right" pos="0 -0.1 0">
        <joint name="right_hip" axis="0 1 0" range="-40 40" damping="0.1"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.03" mass="0.5"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor joint="left_hip" ctrlrange="-1 1"/>
    <motor joint="right_hip" ctrlrange="-1 1"/>
  </actuator>
</mujoco>
"""


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict, list[str]]:
    """A folder with a study of three bodies, what it printed, and the arguments."""
    folder = tmp_path_factory.mktemp("study")
    (folder / "biped.xml").write_text(BIPED)
    arguments = ["suite", "run", "--domains", "walker,quadruped,biped.xml", "--cases", "1,5"]
    arguments += [*TINY, "--out", "out"]
    done = selfmodel(*arguments, "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder, json.loads(done.stdout), arguments


@pytest.mark.bodies
def test_every_domain_is_listed_with_its_parts_and_cases(tmp_path: Path):
    done = selfmodel("suite", "list", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    told = {one["domain"]: one for one in json.loads(done.stdout)["domains"]}

    assert list(told)[:3] == ["quadruped", "hexapod", "suite-quadruped"]
    walker = told["suite-walker"]
    assert (walker["joints"], walker["motors"], walker["sensors"]) == (6, 6, 8)
    assert walker["robots"] == [f"suite-walker-{task}" for task in ("walk", "run", "stand")]
    assert walker["control_timestep"] == 0.025
    assert walker["cases"]["2"] == "break:right_hip"
    assert "8" not in walker["cases"]


@studies
def test_ours_and_the_suites_and_ones_own_fail_and_recover_side_by_side(
    study: tuple[Path, dict, list[str]],
):
    folder, told, _ = study
    rows = told["rows"]

    # A limb of one joint has no part that could be lost alone: the biped has no case 1.
    assert [(row["robot"], row["case"]) for row in rows] == [
        *(("biped", 5), ("quadruped", 1), ("quadruped", 5)),
        *(("suite-walker-walk", 1), ("suite-walker-walk", 5)),
    ]
    for row in rows:
        assert row["trials"] == 2
        assert row["seconds"] > 0
    walker = [row for row in rows if row["robot"] == "suite-walker-walk"]
    assert walker[0]["before"] == walker[1]["before"], "one gait for all cases of a body and seed"
    kept = json.loads((folder / "out" / "results.json").read_text())
    assert kept == {key: told[key] for key in ("rows", "summaries")}
    with (folder / "out" / "results.csv").open() as file:
        assert [row["truth"] for row in csv.DictReader(file)] == [row["truth"] for row in rows]


@studies
def test_the_same_command_again_does_nothing_and_says_the_same(
    study: tuple[Path, dict, list[str]],
):
    folder, told, arguments = study
    logs = {path: path.stat().st_mtime_ns for path in folder.rglob("*.mcap")}
    again = selfmodel(*arguments, "--json", "--table", "csv", cwd=folder)

    assert again.returncode == 0, again.stderr
    files = told["files"]
    assert json.loads(again.stdout) == {**told, "files": [*files, "out/tables/summaries.csv"]}
    with (folder / "out" / "tables" / "summaries.csv").open() as file:
        shares = [float(row["correct_high"]) for row in csv.DictReader(file)]
    assert shares == [row["correct"]["high"] for row in told["summaries"]]
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*.mcap")} == logs


@studies
def test_one_more_seed_is_added_to_what_is_there(study: tuple[Path, dict, list[str]]):
    folder, told, arguments = study
    more = [*arguments, "--seeds", "2"]
    more[more.index("--domains") + 1] = "biped.xml"
    more[more.index("--cases") + 1] = "5"
    done = selfmodel(*more, "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    rows = json.loads(done.stdout)["rows"]

    assert len(rows) == len(told["rows"]) + 1
    assert [row for row in rows if row["seed"] == 0] == told["rows"]


@studies
def test_a_study_that_was_made_otherwise_is_not_mixed_with_another(
    study: tuple[Path, dict, list[str]],
):
    folder, _, arguments = study
    done = selfmodel(*arguments, "--controller", "cpg", cwd=folder)

    assert done.returncode == 2
    assert "contains a study with other settings" in done.stderr


@pytest.mark.parametrize("changed", ["biped.toml", "foot.obj"])
def test_a_body_that_is_another_by_now_is_not_run_into_its_study(
    changed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    meshed = '<mujoco><asset><mesh name="foot" file="foot.obj"/></asset>'
    shown = '<freejoint/><geom type="mesh" mesh="foot" contype="0" conaffinity="0" mass="0"/>'
    mine = BIPED.replace("<mujoco>", meshed).replace("<freejoint/>", shown)
    (tmp_path / "biped.xml").write_text(mine)
    (tmp_path / "foot.obj").write_text(CUBE)
    study = replace(STUDY, bodies=["biped.xml"], cases=[5], folder=tmp_path)
    (before,) = cells(study)
    assert [cell.place for cell in cells(study)] == [before.place]

    others = {"biped.toml": "control_timestep = 0.02", "foot.obj": CUBE.replace(".1", ".2")}
    (tmp_path / changed).write_text(others[changed])
    (after,) = cells(study)

    assert after.parameters != before.parameters
    assert after.needs["gait"].place != before.needs["gait"].place


@studies
def test_the_score_may_be_the_tasks_own_rewards(tmp_path: Path):
    arguments = ["suite", "run", "--domains", "suite-walker", "--tasks", "stand", "--cases", "3"]
    done = selfmodel(*arguments, *TINY, "--score", "return", "--out", "out", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (row,) = json.loads(done.stdout)["rows"]

    assert row["robot"] == "suite-walker-stand"
    assert 0 < row["before"] < 60  # of 59 rewards none is above 1
    assert (
        "recovered"
        in selfmodel(*arguments, *TINY, *("--score", "return", "--out", "out"), cwd=tmp_path).stdout
    )


REFUSED = [
    ({"bodies": ["suite-walker-walk"], "cases": [8]}, "unknown case of these bodies '8'"),
    ({"score": "return"}, "no rewards"),
    ({"score": "beauty"}, "unknown score 'beauty'"),
    ({"comparator": "no-such"}, "unknown comparator"),
    ({"controller": "brain"}, "unknown kind of controller"),
    ({"kinds": "brek"}, "unknown kind 'brek'"),
    ({"repair": "papers"}, "unknown repair 'papers'"),
    ({"repair": "robust", "search": "repertoire"}, "a study of many has none"),
    ({"gap": 0.7}, "expected a gap from 0 to 0.5"),
    ({"controller": "cpg", "neurons": 4}, "a CPG has no hidden neurons, got --neurons 4"),
    ({"bodies": ["biped.xml", "other/biped.xml"]}, "would have the same file names"),
]


@pytest.mark.parametrize(("changed", "reason"), REFUSED)
def test_what_cannot_be_run_is_refused_before_anything_is(
    changed: dict, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "other").mkdir()
    for name in ("biped.xml", "other/biped.xml"):
        (tmp_path / name).write_text(BIPED)
    study = replace(STUDY, bodies=["biped.xml"], cases=[2], folder=tmp_path / "out")
    check(study)

    with pytest.raises(InputError, match=reason):
        cells(replace(study, **changed))
    assert not (tmp_path / "out").exists()


def test_all_cases_are_those_that_the_bodies_have(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    asked: list[Study] = []
    monkeypatch.setattr(run, "cells", lambda study, _: asked.append(study) or [])
    arguments = ["suite", "run", "--domains", "hopper,swimmer", "--out", str(tmp_path)]
    told = CliRunner().invoke(app, [*arguments, "--json"])

    assert told.exit_code == 0, told.output
    files = json.loads(told.stdout)["files"]
    assert files == [str(tmp_path / name) for name in ("results.csv", "results.json")]
    check(asked[0])
    assert asked[0].cases == known_cases(("suite-hopper-hop", "suite-swimmer-swimmer6"))
    assert asked[0].cases
    assert 8 not in asked[0].cases


def test_the_repair_is_the_papers_unless_another_is_given_which_has_its_own_score_and_its_cost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    asked: list[Study] = []
    monkeypatch.setattr(run, "cells", lambda study, _: asked.append(study) or [])
    costs = [RepairCost(2, 6, 1_000, 500), RepairCost(0, 0, 0, 0)]
    monkeypatch.setattr(run, "repair_cost", lambda *_: costs.pop(0))
    arguments = ["suite", "run", "--domains", "hopper", "--out", str(tmp_path)]
    plain = CliRunner().invoke(app, arguments)
    robust = CliRunner().invoke(app, [*arguments, "--repair", "robust", "--search", "ea"])

    again = CliRunner().invoke(app, [*arguments, "--repair", "robust", "--search", "ea"])

    assert (plain.exit_code, robust.exit_code) == (0, 0), robust.output
    assert [(study.repair, study.search, study.score) for study in asked] == [
        ("paper", None, None),
        ("robust", "ea", None),
        ("robust", "ea", None),
    ]
    assert "gaits to evolve: 2, repairs: 6" in robust.stderr
    assert "gaits to evolve" not in plain.stderr + again.stderr, "nothing is left to evolve"


def test_a_recovery_and_its_gait_are_other_cells_with_another_repair(tmp_path: Path):
    study = replace(STUDY, bodies=["quadruped"], cases=[9], folder=tmp_path, score=None)
    (paper,), (robust,) = cells(study), cells(replace(study, repair="robust"))
    (same,) = cells(replace(study, repair="robust", search="cma-es", score="upright"))
    shared = paper.parameters["shared"]

    assert (shared["repair"], shared["search"], shared["score"]) == ("paper", "ea", "displacement")
    assert robust.parameters["shared"] == {
        **shared,
        "repair": "robust",
        "search": "cma-es",
        "score": "upright",
    }
    assert robust.place == same.place
    assert robust.needs["gait"].place == same.needs["gait"].place != paper.needs["gait"].place


def test_oscillators_have_no_neurons_that_could_be_silent(tmp_path: Path):
    study = replace(STUDY, bodies=["quadruped"], cases=[9, 10], folder=tmp_path)
    oscillating = replace(study, controller="cpg")

    assert [cell.parameters["case"] for cell in cells(study)] == [9, 10]
    assert [cell.parameters["case"] for cell in cells(oscillating)] == [9]


def test_a_share_has_every_nth_gait_and_its_recoveries(tmp_path: Path):
    study = replace(STUDY, bodies=["quadruped"], cases=[9], seeds=range(3), folder=tmp_path)

    assert [cell.seed for cell in cells(study, (2, 2))] == [1]
    assert [cell.seed for cell in cells(study, (1, 2))] == [0, 2]
    assert {cell.needs["gait"].seed for cell in cells(study, (1, 2))} == {0, 2}


def test_an_option_of_the_recovery_does_not_change_the_gait_and_one_of_the_gait_does(
    tmp_path: Path,
):
    study = replace(STUDY, bodies=["quadruped"], cases=[9], folder=tmp_path)
    (plain,), (other,) = cells(study), cells(replace(study, gap=0.1, kinds="all"))
    (larger,) = cells(replace(study, neurons=5))
    gait = plain.needs["gait"]

    shared = plain.parameters["shared"]
    assert other.parameters["shared"] == {**shared, "gap": 0.1, "kinds": "all"}
    assert other.needs["gait"].place == gait.place
    assert larger.needs["gait"].parameters == {**gait.parameters, "neurons": 5}
    assert larger.needs["gait"].place != gait.place


@studies
def test_a_study_has_a_gap_a_size_of_network_and_kinds_of_faults(tmp_path: Path):
    arguments = ["suite", "run", "--domains", "quadruped", "--case", "2", *TINY, "--neurons", "5"]
    arguments += [
        "--gap",
        "0.05",
        "--kinds",
        "break,jam",
        "--only",
        "1/1",
        "--out",
        "out",
    ]
    done = selfmodel(*arguments, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)

    assert told["failures"] == []
    (gait,) = (tmp_path / "out" / "gaits").rglob("*.npz")
    assert load_controller(gait).design.hidden == 5
    (log,) = (tmp_path / "out" / "runs").rglob("01-after.mcap")
    assert read_gap(log)["level"] > 0


def test_a_domain_that_nobody_has_is_told_from_the_nearest(tmp_path: Path):
    done = selfmodel("suite", "run", "--domains", "walkr", "--out", "out", cwd=tmp_path)

    assert done.returncode == 2
    assert done.stderr.startswith("error: unknown domain 'walkr': did you mean suite-walker")


def test_domains_of_the_suite_need_no_prefix_where_we_have_no_robot_of_that_name():
    assert bodies(["quadruped"], None) == ("quadruped",)
    assert bodies(["suite-quadruped", "walker"], None) == (
        "suite-quadruped-walk",
        "suite-walker-walk",
    )
    assert bodies(["walker", "hopper"], ["stand"]) == ("suite-walker-stand", "suite-hopper-stand")
    assert bodies(["walker"], DOMAINS["suite-walker"])[1:] == (
        "suite-walker-run",
        "suite-walker-stand",
    )
    with pytest.raises(InputError, match="has none of the tasks run: it has walk"):
        bodies(["hexapod"], ["run"])
    with pytest.raises(InputError, match="unknown task of these domains 'rnu': did you mean run"):
        bodies(["walker", "biped.xml"], ["walk", "rnu"])


def test_summaries_are_medians_and_leave_out_ratios_that_mean_nothing():
    def row(seed: int, before: float, recovered: float, *, correct: bool) -> SuiteRow:
        return SuiteRow(
            "a", 1, "break:x", seed, "x", correct, "explained", 2, before, 0.0, recovered, 0, 3.0
        )

    rows = [row(0, 2.0, 1.0, correct=True), row(1, -1.0, 3.0, correct=False)]
    case, single = summarise([*rows, row(2, 4.0, 4.0, correct=True)])

    assert (case.case, single.case) == (1, None)
    assert (case.right, case.runs) == (2, 3)
    assert case.before == 2.0
    assert case.recovery == 0.75  # of 0.5 and 1
    assert case.correct.low < 2 / 3 < case.correct.high
