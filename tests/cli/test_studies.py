"""``selfmodel ablate``, ``suite`` and ``paper``: studies that continue where they stopped."""

import csv
import json
from pathlib import Path

import pytest

from selfmodel.report.charts import Table
from selfmodel.report.content import shots_of, trials_section
from selfmodel.report.subject import subject_of_run
from selfmodel.studies import figures, load
from selfmodel.studies.recoveries import ENDS
from selfmodel.studies.study import Study
from tests.helpers.command import SMALL, printed, refused, selfmodel, succeeds

ROOT = Path(__file__).parents[2]
TINY = (*SMALL, "--steps", "60", "--trials", "1", "--workers", "1", "--out", "out")
QUICK = ("--comparator", "forward-displacement")
PAPER = ("paper", "--robots", "quadruped", "--comparator", "forward-displacement", *TINY)
ABLATE = ("ablate", "--robots", "quadruped", "--comparator", "forward-displacement", *TINY)
SUITE = ("suite", "run", "--domains", "walker,biped.xml", "--cases", "1", *QUICK, *TINY)
FRICTION = ("--damage", "friction=0.4", "--kinds", "paper,friction", "--repair", "paper")

THEIRS = """
from dataclasses import dataclass
from selfmodel.comparators.paper import ForwardDisplacement
from selfmodel.errors import InputError

@dataclass(frozen=True)
class Picky(ForwardDisplacement):
    def prepare(self, trial):
        raise InputError("this trial does not please")

PICKY = Picky(name="picky")
"""

SAME = """# the ablation below, without the comparator that fails
study = "ablation"
folder = "out"
robots = "quadruped"
cases = 3
comparators = "forward-displacement"

[settings]
steps = 60
trials = 1
population = 8
generations = 2
"""

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


@pytest.mark.process
@pytest.mark.search
@pytest.mark.bodies
def test_bodies_of_the_suite_and_of_the_user_fail_and_recover_once(tmp_path: Path):
    (tmp_path / "biped.xml").write_text(BIPED)
    first = succeeds(*SUITE, *FRICTION, "--json", cwd=tmp_path)
    logs = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.mcap")}
    again = selfmodel(*SUITE, *FRICTION, "--json", "--table", "csv", cwd=tmp_path)
    said = "contains a study with other settings (controller is"
    refused(*SUITE, *FRICTION, "--controller", "cpg", said=said, cwd=tmp_path)
    told = json.loads(first.stdout)
    rows = told["rows"]

    assert [(row["robot"], row["case"], row["truth"]) for row in rows] == [
        ("biped", 1, ""),
        ("biped", None, "friction=0.4"),
        ("suite-walker-walk", 1, "break:right_ankle"),
        ("suite-walker-walk", None, "friction=0.4"),
    ]
    lacking, own, broken, slippery = rows
    # A limb of one joint has no part that could be lost alone.
    assert "does not apply to biped.xml: it needs a limb of two joints" in lacking["reason"]
    assert lacking["correct"] is lacking["before"] is None
    assert all(row["trials"] == 2 and row["seconds"] > 0 for row in (own, broken, slippery))
    assert broken["before"] == slippery["before"], "one gait for all failures of a body and seed"
    said = [(row["score"], row["unit"], row["control_steps"], row["return_most"]) for row in rows]
    assert said[1:] == [("displacement", "m", 60, None), *[("displacement", "m", 60, 59)] * 2]
    assert own["return_before"] is None, "the user's robot has no task"
    assert all(row["displacement_best_trial"] == row["best_trial"] for row in rows)
    trials = [one for one in told["trials"] if one["robot"] != "biped" and one["case"] == 1]
    assert [one["return"] for one in trials] == [broken[f"return_{end}"] for end in ENDS]
    upright = [broken[f"upright_{end}"] for end in ENDS]
    assert [one["fell_at_step"] is None for one in trials] == upright
    (run,) = (tmp_path / "out" / "runs").glob("suite-walker-walk-case01*")
    alone = json.loads(succeeds("report", str(run), "--json", cwd=tmp_path).stdout)
    assert f"The robot moved {broken['best_trial']:.3f} m at best" in alone["headline"]
    table = trials_section(subject := subject_of_run(run), shots_of(subject)).items[-1]
    assert isinstance(table, Table)
    cells = [dict(zip(table.columns, row, strict=True)) for row in table.rows]
    names = {"score": "displacement, m", "return": "return", "fell_at_step": "fell at step"}
    for shown, one in zip(cells, trials, strict=True):
        assert {name: shown[key] for name, key in names.items()} == {key: one[key] for key in names}
    kept = json.loads((tmp_path / "out" / "results.json").read_text())
    assert kept == {key: told[key] for key in ("rows", "summaries", "trials")}
    study = load(tmp_path / "out" / "results.csv")
    assert study.rows["reason"].notna().tolist() == [True, False, False, False]
    assert load(tmp_path / "out").rows["correct"].tolist() == [row["correct"] for row in rows]
    assert (tmp_path / "out" / "figures" / "bodies.svg").stat().st_size
    files = [*told["files"], "out/tables/summaries.csv"]
    assert json.loads(again.stdout) == {**told, "files": files}
    with (tmp_path / files[-1]).open() as file:
        shares = [row["correct_high"] for row in csv.DictReader(file)]
    known = [row["correct"] and row["correct"]["high"] for row in told["summaries"]]
    assert shares == ["" if one is None else str(one) for one in known]
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.mcap")} == logs


@pytest.mark.process
@pytest.mark.search
def test_a_failure_ends_with_status_one_and_one_json_object(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "theirs.py").write_text(THEIRS)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{ROOT}")
    both = "forward-displacement,theirs:PICKY"
    told = selfmodel(*ABLATE, "--comparator", both, "--case", "3", "--json", cwd=tmp_path)

    assert told.returncode == 1, told.stderr
    found = json.loads(told.stdout)
    assert [row["comparator"] for row in found["rows"]] == ["forward-displacement"]
    (failure,) = found["failures"]
    assert failure["run"] == "quadruped-case03-gap0.0-seed000-theirs%3APICKY-stepwise"
    assert "this trial does not please" in failure["error"]
    assert " failed, the first of them quadruped-case03" in told.stderr
    drawn = {"out/figures/gap.png", "out/figures/cases-quadruped-1.svg"}
    assert drawn < set(found["files"])
    assert "Traceback" not in told.stderr
    mine = tmp_path / "mine.toml"
    mine.write_text(SAME, encoding="utf-8")
    same = succeeds("study", "mine.toml", "--workers", "1", "--json", cwd=tmp_path)
    assert json.loads(same.stdout)["rows"] == found["rows"]
    assert "of 4 were done before" in same.stderr
    assert (tmp_path / "out" / "study.toml").read_bytes() == mine.read_bytes()


@pytest.mark.process
@pytest.mark.search
def test_the_papers_experiment_ends_with_tables_and_figures_and_is_continued(tmp_path: Path):
    first = selfmodel(*PAPER, "--case", "1", "--json", "--table", "csv", cwd=tmp_path)
    second = selfmodel(*PAPER, "--case", "7,1", "--table", "markdown", cwd=tmp_path, COLUMNS="120")

    assert (first.returncode, second.returncode) == (0, 0), first.stderr + second.stderr
    found = json.loads(first.stdout)
    assert [row["case"] for row in found["table_2"]] == [1]
    assert found["failures"] == []
    assert {"out/paper.md", "out/tables/costs.csv"} < set(found["files"])
    assert "3 of 5 were done before" in second.stderr  # gait, recovery and control
    assert "not restored" in second.stdout
    for name in ("paper.md", "figure-1.png", "figure-5.pdf", "figure-6.svg", "tables/table-2.md"):
        assert f"out/{name}" in second.stdout
        assert (tmp_path / "out" / name).stat().st_size > 0


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ((*PAPER, "--case", "11"), "unknown case of Table I '11'"),
        ((*PAPER, "--table", "xls"), "unknown table format 'xls'"),
        ((*ABLATE, "--executor", "dask"), "expected --scheduler ADDRESS with --executor dask"),
        ((*ABLATE, "--scheduler", "host:1"), "expected --scheduler ADDRESS with --executor dask"),
        ((*SUITE, "--domains", "walkr"), "unknown domain 'walkr': did you mean suite-walker"),
    ],
)
def test_wrong_input_is_refused_before_anything_is_written(
    tmp_path: Path, command: tuple[str, ...], message: str
):
    refused(*command, said=message, cwd=tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_planted_link_is_not_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(figures, "of_ablation", lambda *_: {})
    monkeypatch.setattr(Study, "run", lambda *_, **__: ())
    (tmp_path / "precious").write_text("mine")
    (tmp_path / "out").mkdir()
    for name in ("results.csv", "results.csv.part", "results.json.part"):
        (tmp_path / "out" / name).symlink_to(tmp_path / "precious")
    succeeds(*ABLATE, cwd=tmp_path)

    assert (tmp_path / "precious").read_text() == "mine"
    assert not (tmp_path / "out" / "results.csv").is_symlink()


@pytest.mark.bodies
def test_every_domain_is_listed_with_its_parts_and_cases(tmp_path: Path):
    told = {
        one["domain"]: one for one in printed("suite", "list", "--json", cwd=tmp_path)["domains"]
    }

    assert list(told)[:3] == ["quadruped", "hexapod", "suite-quadruped"]
    walker = told["suite-walker"]
    assert (walker["joints"], walker["motors"], walker["sensors"]) == (6, 6, 8)
    assert walker["robots"] == [f"suite-walker-{task}" for task in ("walk", "run", "stand")]
    assert walker["control_timestep"] == 0.025
    assert walker["cases"]["2"] == "break:right_hip"
    assert "8" not in walker["cases"]
