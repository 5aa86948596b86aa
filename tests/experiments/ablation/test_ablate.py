"""Promises of the ablation: paired, resumable, extendable, and told in rows that anybody reads."""

import csv
import dataclasses
import itertools
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from selfmodel.controllers.controller import Controller
from selfmodel.errors import InputError
from selfmodel.experiments.ablation import Ablation, AblationRow, ablate, collect, write_results
from selfmodel.experiments.ablation.plan import runs
from selfmodel.experiments.ablation.scores import summarise
from selfmodel.experiments.grid import GridBegins, PartEnds, processes
from selfmodel.experiments.study.gaits import FILE
from selfmodel.logs import load_controller, read_gap, read_log, read_truth
from selfmodel.settings import Settings
from tests.helpers.command import selfmodel

PAPERS = "forward-displacement"
BEGINS = {".png": b"\x89PNG", ".pdf": b"%PDF-", ".svg": b"<?xml"}  # files of figures
DAMAGES = ("break:back_left_knee+friction=0.4", "motor:front_left_knee=0.5")
THEIRS = """
from dataclasses import dataclass
from selfmodel.comparators.forward_displacement import ForwardDisplacement
from selfmodel.errors import InputError

@dataclass(frozen=True)
class Picky(ForwardDisplacement):
    def prepare(self, trial):
        raise InputError("this trial does not please")

SAME = ForwardDisplacement(name="same")
PICKY = Picky(name="picky")
"""


@pytest.fixture(autouse=True)
def _their_comparators(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs" / "their_comparators.py").write_text(THEIRS)
    monkeypatch.syspath_prepend(str(tmp_path / "theirs"))


def small(folder: Path, **changes: object) -> Ablation:
    """An ablation that takes a second or two."""
    ablation = Ablation(
        robots=["quadruped"],
        cases=[1, 9],
        comparators=[PAPERS],
        gaps=[0.0],
        seeds=[5],
        folder=folder,
        settings=Settings(steps=60, generations=2, trials=2).scaled(6),
    )
    return dataclasses.replace(ablation, **changes)


def run(ablation: Ablation, workers: int = 1, **more: object) -> tuple[PartEnds, ...]:
    return ablate(ablation, workers=processes(workers), on_progress=lambda _event: None, **more)


def evolved(folder: Path, number: int) -> Controller:
    """The gait of an ablation with a number."""
    (gait,) = folder.glob(f"gaits/quadruped-seed{number:03d}-*")
    return load_controller(gait / FILE)


def timeless(rows: Sequence[AblationRow], **changes: object) -> list[AblationRow]:
    return [dataclasses.replace(row, seconds=0, **changes) for row in rows]


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a small ablation that nobody stopped."""
    folder = tmp_path_factory.mktemp("done") / "ablation"
    assert run(small(folder), workers=2) == ()
    return folder


def test_a_run_keeps_its_trials_and_has_a_row_for_the_diagnosis_after_each(done: Path):
    (folder,) = done.glob("trials/*case01*")
    logs = sorted(folder.glob("*.mcap"))
    bank = {k: evolved(done, k) for k in (5, 0)}
    rows = [row for row in collect(done) if row.case == 1]

    assert [path.name for path in logs] == [
        *("00-before.mcap", "01-before.mcap", "02-after.mcap", "03-after.mcap"),
    ]
    driven = [read_log(path).trial.plan.controller for path in logs]
    assert driven == [bank[5], bank[0], bank[5], bank[0]]  # gaits s, s + 1, ... modulo six
    assert [read_truth(path) for path in logs] == ["intact"] * 2 + ["break:front_left_knee"] * 2
    assert [row.trials for row in rows] == [1, 2]
    assert [row.evaluations for row in rows] == [9, 18]
    assert {(row.truth, row.repair) for row in rows} == {("break:front_left_knee", "paper")}
    assert all(row.intact_distance >= row.distance >= 0 for row in rows)


@pytest.mark.search
def test_the_rows_do_not_depend_on_the_number_of_workers_or_on_how_runs_are_shared_out(
    done: Path, tmp_path: Path
):
    for i in (1, 2):
        run(small(tmp_path / "shared"), only=(i, 2))

    assert timeless(collect(tmp_path / "shared")) == timeless(collect(done))


@pytest.mark.search
def test_one_more_comparator_diagnoses_from_the_same_logs_and_nothing_is_done_again(
    done: Path, tmp_path: Path
):
    extended = tmp_path / "extended"
    run(small(extended, bank=done / "gaits"))
    kept = {path: path.read_bytes() for path in extended.rglob("*") if path.is_file()}
    events: list[GridBegins | PartEnds] = []
    same = "their_comparators:SAME"
    both = small(extended, bank=done / "gaits", comparators=[PAPERS, same])
    ablate(both, workers=processes(1), on_progress=events.append)

    assert events[0] == GridBegins(total=8, finished=6)
    assert [event.part for event in events[1:]] == [same, same]
    assert all(path.read_bytes() == data for path, data in kept.items())
    rows = timeless(collect(extended))
    papers = [row for row in rows if row.comparator == PAPERS]
    theirs = [row for row in rows if row.comparator == same]
    # Paired: the same arithmetic on the same trials with the same seeds finds the same.
    assert [dataclasses.replace(row, comparator=PAPERS) for row in theirs] == papers


def test_what_fails_is_told_and_stops_nothing(done: Path, tmp_path: Path):
    picky = "their_comparators:PICKY"
    ablation = small(tmp_path / "out", bank=done / "gaits", comparators=[picky, PAPERS])
    failed = run(ablation)

    assert {(one.part, one.error) for one in failed} == {
        (picky, "; ".join(["this trial does not please"] * 4))  # two before the failure, two after
    }
    assert len(failed) == 2
    assert timeless(collect(ablation.folder)) == timeless(collect(done), repair=None, search=None)


@pytest.mark.process
def test_a_command_with_a_failure_ends_with_status_one_and_prints_one_object(
    done: Path, tmp_path: Path
):
    told = selfmodel(
        *("ablate", "--robots", "quadruped", "--cases", "3", "--population", "4"),
        *("--comparators", f"{PAPERS},their_comparators:PICKY", "--generations", "1"),
        *("--trials", "1", "--bank", str(done / "gaits"), "--seed", "5", "--out", "out", "--json"),
        cwd=tmp_path,
        PYTHONPATH=os.pathsep.join([str(tmp_path / "theirs"), os.environ.get("PYTHONPATH", "")]),
    )
    assert told.stdout, told.stderr
    assert told.returncode == 1
    found = json.loads(told.stdout)
    assert [row["comparator"] for row in found["rows"]] == [PAPERS]
    assert found["failures"] == [
        {
            "run": "quadruped-case03-gap0.0-seed005",
            "part": "their_comparators:PICKY",
            "error": "; ".join(["this trial does not please"] * 3),
        }
    ]
    assert "1 failed, the first of them quadruped-case03" in told.stderr
    assert "Traceback" not in told.stderr


def test_the_csv_says_what_the_json_says(done: Path):
    results = write_results(done)
    with (done / "results.csv").open(newline="") as file:
        table = list(csv.DictReader(file))
    objects = json.loads((done / "results.json").read_text())["rows"]

    assert len(table) == len(objects) == len(results.rows) == 4
    for line, values in zip(table, objects, strict=True):
        assert list(line) == list(values)
        for name, cell in line.items():
            text = values[name] is not None and isinstance(values[name], str)
            assert (cell if text else json.loads(cell or "null")) == values[name]
    assert {path.suffix for path in results.files[2:]} == set(BEGINS)
    for path in results.files[2:]:
        assert path.read_bytes().startswith(BEGINS[path.suffix])


def test_repairs_are_tried_and_their_way_is_told(done: Path, tmp_path: Path):
    ablation = small(tmp_path / "out", cases=[1], bank=done / "gaits", next_trial="repair")
    assert run(ablation) == ()
    first, last = collect(ablation.folder)
    (score,) = (s for s in summarise([first, last]) if s.trials == 2)

    assert (first.trials, first.recovered) == (1, None)
    assert (last.trials, last.repair, last.search) == (2, "paper", "ea")
    assert isinstance(last.recovered, float)
    assert first.before == last.before
    assert (score.recovery is None) == (last.before <= 0)
    assert len(list(ablation.folder.glob("runs/*/recovery/trials/*.mcap"))) == 3


@pytest.mark.search
@pytest.mark.parametrize("way", ["repair", "disagreement"])
def test_trials_that_are_chosen_are_a_comparators_own(tmp_path: Path, way: str):
    ablation = small(
        tmp_path / "out",
        cases=[1],
        next_trial=way,
        comparators=[PAPERS, "their_comparators:SAME"],
        settings=Settings(steps=60, generations=2, trials=3).scaled(6),
    )
    assert run(ablation) == ()
    (folder,) = ablation.folder.glob(f"runs/*{PAPERS}*")
    healthy, *own = sorted((folder / "recovery" / "trials").iterdir())
    drivers = [read_log(path).trial.plan.controller for path in (healthy, *own)]
    rows = timeless(collect(ablation.folder))
    papers, theirs = rows[:3], rows[3:]

    assert [path.name[3:] for path in own] == ["after.mcap", *["recovery.mcap"] * 2]
    assert drivers[0] == drivers[1] == evolved(ablation.folder, 5)
    # A repair may find nothing better than what walked before.
    assert drivers[2] != drivers[1] or way == "repair"
    assert {read_truth(path) for path in own} == {"break:front_left_knee"}
    assert [row.trials for row in papers] == [1, 2, 3]
    assert {row.next_trial for row in papers} == {way}
    assert all(row.verdict and row.correct is not None for row in papers)
    # The same arithmetic leads to the same trials, in whatever folder they are.
    assert [dataclasses.replace(row, comparator=PAPERS) for row in theirs] == papers


@pytest.mark.parametrize("way", ["repair", "disagreement"])
def test_a_way_to_choose_needs_a_trial_to_choose(tmp_path: Path, way: str):
    settings = Settings(steps=60, generations=2, trials=1).scaled(6)

    with pytest.raises(InputError, match=f"at least 2 trials with --next-trial {way}"):
        run(small(tmp_path / "out", next_trial=way, settings=settings))


@pytest.mark.process
def test_a_killed_ablation_goes_on_and_finds_what_an_unbroken_one_finds(done: Path, tmp_path: Path):
    out = tmp_path / "out"
    script = tmp_path / "script.py"
    script.write_text(
        "from pathlib import Path\n"
        "from tests.experiments.ablation.test_ablate import run, small\n"
        f"if __name__ == '__main__':\n    run(small(Path({str(out)!r})))\n"
    )
    root = str(Path(__file__).parents[3])
    process = subprocess.Popen([sys.executable, script], env={**os.environ, "PYTHONPATH": root})
    while not list(out.rglob("*.mcap*")):
        assert process.poll() is None
        time.sleep(0.005)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert len(collect(out)) < 4

    assert run(small(out)) == ()
    assert timeless(collect(out)) == timeless(collect(done))


def test_a_folder_with_another_ablation_is_refused(done: Path):
    other = Settings(steps=60, generations=3, trials=2).scaled(6)

    with pytest.raises(InputError, match=r"settings.generations is 2 there, requested is 3"):
        run(small(done, cases=[2], settings=other))
    assert not list(done.glob("runs/*case02*"))


def test_a_bank_without_a_gait_is_refused_before_anything_is_run(done: Path, tmp_path: Path):
    with pytest.raises(InputError, match=r"quadruped-1.npz: expected a controller file"):
        run(small(tmp_path / "out", seeds=[0], bank=done / "gaits"))
    assert not (tmp_path / "out").exists()


def test_a_row_changed_by_hand_is_in_no_table(done: Path, tmp_path: Path):
    altered = shutil.copytree(done, tmp_path / "altered")
    path = next(altered.glob("runs/*case01*/cell.json"))
    path.write_text(path.read_text().replace('"correct": false', '"correct": true', 1))
    (altered / "results.csv").unlink()
    command = ("ablate", "--robots", "quadruped", "--case", "1,9", "--comparator", PAPERS)
    command += ("--seed", "5", "--steps", "60", "--generations", "2", "--trials", "2")
    command += ("--population", "6", "--workers", "1", "--out", "altered")
    told = selfmodel(*command, cwd=tmp_path)

    assert told.returncode == 2
    assert f"{path.name}: expected a cell of a study: its digest is missing or wrong" in told.stderr
    assert "delete the file, and the same command computes its cell again" in told.stderr
    assert not (altered / "results.csv").exists()


@pytest.fixture(scope="module")
def otherwise(tmp_path_factory: pytest.TempPathFactory, done: Path) -> Path:
    """The folder of an ablation of damages that have no number, on a robot built differently."""
    folder = tmp_path_factory.mktemp("otherwise") / "ablation"
    ablation = small(
        folder,
        bank=done / "gaits",
        cases=[9],
        damages=["friction=0.4+break:back_left_knee", "motor:front_left_knee=0.5"],
        kinds="break,friction",
        settings=Settings(steps=60, generations=2, trials=2).scaled(6),
        comparators=["segment-prediction"],
    )
    assert run(ablation) == ()
    return folder


@pytest.mark.search
def test_a_damage_without_a_number_has_rows_like_a_case(otherwise: Path):
    rows = collect(otherwise)

    assert {(row.case, row.truth, row.failure) for row in rows} == {
        (9, "intact", " 9"),
        (None, DAMAGES[0], DAMAGES[0]),
        (None, DAMAGES[1], DAMAGES[1]),
    }
    assert [row.trials for row in rows] == [1, 2] * 3
    (score,) = (score for score in write_results(otherwise).scores if score.trials == 2)
    assert score.runs == 3
    assert len({folder.name for folder in (otherwise / "runs").iterdir()}) == 3


@pytest.mark.search
def test_a_diagnosis_of_an_ablation_considers_the_kinds_that_were_chosen(otherwise: Path):
    words = {
        term.partition("=")[0].partition(":")[0]
        for row in collect(otherwise)
        for term in row.best.split("+")
    }

    assert words <= {"break", "friction", "intact"}


@pytest.mark.search
def test_rows_say_how_sure_each_diagnosis_is(otherwise: Path, done: Path):
    rows = [*collect(otherwise), *collect(done)]

    assert {row.verdict for row in rows} <= {"intact", "explained", "ambiguous", "unexplained"}
    assert all(0 <= row.rivals <= 10 for row in rows)
    for row in rows:
        if row.verdict == "ambiguous":
            assert row.rivals
        if row.verdict == "explained":
            assert not row.rivals


@pytest.mark.search
def test_every_trial_of_a_robot_built_differently_hides_how(otherwise: Path, done: Path):
    logs = sorted(otherwise.glob("trials/*/*.mcap"))

    assert len(logs) == 3 * 4
    assert all(read_gap(log) is None for log in done.glob("trials/*/*.mcap"))


@pytest.mark.parametrize("changes", [{"kinds": "break,jam"}], ids=["kinds"])
def test_what_is_not_of_one_table_does_not_go_into_one_folder(done: Path, changes: dict):
    with pytest.raises(InputError, match="contains an ablation with other settings"):
        run(small(done, cases=[2], **changes))


@given(st.integers(1, 7), st.integers(1, 5), st.integers(1, 9))
def test_the_shares_of_a_cluster_are_the_whole_and_nothing_twice(seeds: int, gaps: int, n: int):
    ablation = small(Path("nowhere"), seeds=range(seeds), gaps=[float(gap) for gap in range(gaps)])
    shares = [runs(ablation, (i, n)) for i in range(1, n + 1)]

    assert sorted(map(str, itertools.chain(*shares))) == sorted(map(str, runs(ablation)))
    assert max(map(len, shares)) - min(map(len, shares)) <= 1


def scored(comparator: str, case: int, seconds: float, *, correct: bool) -> AblationRow:
    return AblationRow(
        **dict.fromkeys(field.name for field in dataclasses.fields(AblationRow))
        | {"robot": "quadruped", "gap": 0.05, "seed": 0, "trials": 1, "best": "intact"}
        | {"comparator": comparator, "case": case, "seconds": seconds, "correct": correct}
        | {"truth": f"the failure of case {case}", "repair": "paper", "search": "ea"}
    )


def test_time_is_compared_on_the_runs_that_both_have():
    rows = [scored(PAPERS, case, 2.0, correct=case > 7) for case in range(10)]
    rows += [scored("other", case, 3.0, correct=True) for case in range(5, 15)]
    rows += [scored("other", 20, 1000.0, correct=True)]
    ours, other = summarise(rows)

    assert (ours.right, ours.runs, ours.correct.estimate) == (2, 10, 0.2)
    assert ours.correct.low == pytest.approx(0.0567, abs=1e-4)
    assert ours.time.estimate == 1
    assert other.time.estimate == other.time.low == 1.5
