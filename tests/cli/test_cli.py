"""The command line: its outputs, exit statuses and error messages."""

import json
import signal
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from selfmodel import cli
from selfmodel.diagnosis.diagnosis import Verdict
from selfmodel.errors import TrialError
from selfmodel.evolution import Generation, GenerationCallback
from selfmodel.files import file_digest
from selfmodel.logs import read_log, save_controller
from selfmodel.logs.results import read_result, versions
from selfmodel.recovery.recover import RecoveryLoop
from selfmodel.robot.robot import Robot
from selfmodel.studies.training import Training
from tests.cli.conftest import SHORT
from tests.helpers.command import (
    DIAGNOSIS,
    SMALL,
    Done,
    printed,
    refused,
    selfmodel,
    selfmodel_process,
    succeeds,
)
from tests.helpers.drivers import random_controllers

ROOT = Path(__file__).parents[2]


def test_recover_prints_one_json_object_with_every_key(short: tuple[Path, dict]):
    _, told = short

    assert set(told) == {
        *("robot", "case", "truth", "comparator", "kinds", "gap", "structure", "seed", "trials"),
        *DIAGNOSIS,
        *("displacement", "recovery", "physical_trials", "evaluations", "seconds", "next_trial"),
        *("controller", "neurons", "correct", "score", "comparator_reason", "repair", "fell"),
        *("search", "repertoire", "model", "summary"),
        *({"detectable"} & set(told)),
        *("doubt", "also_searched", "left_out", "cost", "warnings"),
    }
    assert (told["robot"], told["case"], told["seed"], told["gap"]) == ("quadruped", 4, 0, 0)
    assert told["truth"] == "break:front_left_shoulder+sensor:front_right_touch"
    assert told["comparator"] == "segment-prediction"
    assert (told["controller"], told["neurons"]) == ("network", 3)
    assert told["verdict"] in set(get_args(Verdict))
    assert set(told["calibration"]) >= {"deviations", "error_before", "error"}
    assert told["intact_distance"] >= told["diagnosis"][0]["distance"] >= 0
    stages = [trial["stage"] for trial in told["trials"]]
    assert stages == ["before", "after", "recovery"]
    assert told["physical_trials"] == 1
    assert told["evaluations"]["diagnostic"] == 8 + 4, "the EA of the first diagnosis"
    assert told["evaluations"]["repair"] >= 2 * 2 * 8
    assert set(told["evaluations"]) == {
        *("repair", "diagnostic", "distinct_hypotheses", "simulated_steps", "diverged")
    }
    assert 1 <= len(told["diagnosis"]) <= 10
    ways = [trial["displacement"] for trial in told["trials"]]
    assert told["displacement"] == {"before": ways[0], "after": ways[1], "recovered": max(ways[2:])}
    assert told["recovery"] == max(ways[2:]) / ways[0]
    assert isinstance(told["correct"], bool)


def test_every_trial_of_a_recovery_is_a_log_with_the_same_values(short: tuple[Path, dict]):
    folder, told = short
    for trial in told["trials"]:
        log = read_log(folder / trial["log"])

        assert log.trial.displacement == trial["displacement"]
        assert log.trial.plan.stage == trial["stage"]
        assert log.trial.trajectory.steps == 60
    assert not list(folder.rglob("*.part"))


def test_the_result_file_has_the_printed_object_and_what_it_was_made_with(short: tuple[Path, dict]):
    folder, told = short
    found = read_result(folder / "run" / "result.json", "a result", "")

    logs = {f"trials/{Path(one['log']).name}": one for one in told["trials"]}
    trials = [{**one, "log": log} for log, one in logs.items()]
    assert {key: found[key] for key in told} == {**told, "trials": trials}
    assert found.keys() - told.keys() == {"settings", "files"}
    written = json.loads((folder / "run" / "result.json").read_text(encoding="utf-8"))
    assert written["made_with"] == versions()
    assert found["files"] == {log: file_digest(folder / one["log"]) for log, one in logs.items()}
    assert found["settings"]["population"] == 8


@pytest.mark.process
def test_the_same_seed_gives_the_same_in_another_process(short: tuple[Path, dict]):
    folder, told = short
    again = selfmodel_process(
        *("recover", *SHORT, "--threads", "1", "--out", "again", "--json"), cwd=folder
    )

    def timeless(one: dict) -> dict:
        return {**one, "seconds": 0, "trials": [{**trial, "log": ""} for trial in one["trials"]]}

    assert timeless(json.loads(again.stdout)) == timeless(told)


def test_progress_goes_to_standard_error_in_plain_lines_when_piped(recovery: tuple[Path, Done]):
    folder, done = recovery
    # Neither progress, of a slow machine, nor warnings of its small searches.
    every = [line for line in done.stderr.splitlines() if not line.startswith("warning: ")]
    lines = [line for line in every if not line.endswith(" left")]
    begins = [
        *("repair for intact:", "trial 00-before:", "calibration: error ", "trial 00-before by "),
        *("trial 01-after:", "comparator segment-prediction: ", "diagnostic EA:"),
        *("diagnosis from 1 trial:", "trial 01-after by ", "repair for ", "trial 02-recovery:"),
        *("diagnosis from 2 trials:", "trial 02-recovery by "),
    ]

    assert "\x1b" not in done.stderr + done.stdout
    assert len(lines) == len(begins)
    assert all(line.startswith(begin) for line, begin in zip(lines, begins, strict=True))
    result = json.loads((folder / "run" / "result.json").read_text())
    scores = [f"{one['score']:.3f} m" for one in result["trials"]]
    assert [line.split("upright ")[1] for line in lines if "upright" in line] == scores


def test_a_trial_of_a_robot_that_falls_says_when(tmp_path: Path):
    given = ("trial", "suite-walker-walk", "--controller", "cpg", "--steps", "150", "--out")
    told = printed(*given, "a.mcap", "--json", cwd=tmp_path)
    said = succeeds(*given, "b.mcap", cwd=tmp_path).stdout
    heights = read_log(tmp_path / "a.mcap").trial.trajectory["base_position"][:, 2]

    assert f"{told['displacement']:.3f} m forward, fell at step {told['fell_at_step']}: " in said
    assert 0 < told["fell_at_step"] < 150
    assert heights[-1] < heights[0] / 2


def test_a_folder_that_holds_another_run_is_refused_and_left_alone(short: tuple[Path, dict]):
    folder, _ = short
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    said = "run holds another run or other files"
    refused("recover", "hexapod", "--case", "1", "--out", "run", said=said, cwd=folder)
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["trial", "quadruped", "--out", "no/such/folder/a.mcap"], "there is no folder"),
        (["trial", "quadruped", "--out", "a.bag"], "ends in .mcap"),
        (["trial", "quadruped", "--out", "a.mcap", "--controller", "no.npz"], "no.npz"),
        (["trial", "quadruped", "--out", "a.mcap", "--controller", "bad.mcap"], "bad.mcap"),
        (["trial", "quadruped", "--out", "a.mcap", "--stage", "befor"], "did you mean before"),
        (["robots", "octopod"], "unknown robot 'octopod'"),
    ],
)
def test_bad_input_is_one_sentence_and_status_2(tmp_path: Path, arguments: list[str], said: str):
    (tmp_path / "bad.mcap").write_bytes(b"not a log")
    refused(*arguments, said=said, cwd=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["bad.mcap"]


def test_a_narrow_terminal_loses_no_name(tmp_path: Path):
    done = selfmodel("robots", "quadruped", cwd=tmp_path, COLUMNS="40")
    text = "".join(
        character for character in done.stdout if character.isalnum() or character in "_:+"
    )

    assert max(map(len, done.stdout.splitlines())) <= 40
    assert "break:front_left_shoulder+jam:back_left_shoulder+sensor:back_right_angle" in text


def test_a_trial_takes_a_controller_from_a_file_or_from_a_log(tmp_path: Path, quadruped: Robot):
    (controller,) = random_controllers(quadruped, 1, seed=9)
    save_controller(tmp_path / "gait.npz", controller)
    few, damage = ("--steps", "200", "--json"), ("--damage", "break:front_left_knee")
    a, b, c = (
        printed("trial", "quadruped", *few, "--controller", *given, "--out", out, cwd=tmp_path)
        for out, *given in (
            *(("a.mcap", "gait.npz"), ("b.mcap", "a.mcap")),
            ("c.mcap", "a.mcap", *damage),
        )
    )

    assert read_log(tmp_path / "b.mcap").trial.plan.controller == controller
    assert a["displacement"] == b["displacement"] != c["displacement"]
    assert (a["truth"], c["truth"]) == ("intact", "break:front_left_knee")
    other = ("trial", "hexapod", "--controller", "a.mcap", "--out", "d.mcap")
    refused(*other, said="give a controller of this robot", cwd=tmp_path)


def test_an_interrupted_recovery_keeps_its_finished_trials(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def interrupted(*_: object) -> None:
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(RecoveryLoop, "_diagnose", interrupted)
    run = ("recover", "quadruped", "--case", "1", *SMALL, "--kinds", "paper", "--no-calibrate")
    done = selfmodel(*run, "--steps", "40", "--out", "run", cwd=tmp_path)

    assert done.returncode == 130
    assert "interrupted: the finished trials are in run" in done.stderr
    assert "Traceback" not in done.stderr
    for name in ("00-before", "01-after"):
        log = read_log(tmp_path / "run" / "trials" / f"{name}.mcap")
        assert log.trial.trajectory.steps == 40


def test_an_interrupted_training_says_that_the_same_command_continues(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def interrupted(_: Training, __: int, after: GenerationCallback) -> None:
        after(Generation(1, 1, 2.5, 24, 6.0))
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(Training, "run", interrupted)
    done = selfmodel("suite", "evolve", "suite-hopper-stand", "--out", "policy", cwd=tmp_path)

    assert done.returncode == 130
    assert done.stderr.startswith("policy: 24 evaluations, best 2.5000, 4/s"), "with its stage"
    assert "finished generations are kept in policy; the same command continues" in done.stderr


def test_a_file_in_place_of_the_folder_of_an_export_is_refused_before_the_logs_are_read(
    tmp_path: Path,
):
    (tmp_path / "taken").write_text("mine", encoding="utf-8")
    said = "taken: expected a folder, got a file: choose another name"
    refused("diagnose", "missing.mcap", "--export", "taken", said=said, cwd=tmp_path)


def test_a_comparator_from_elsewhere_plugs_in(tmp_path: Path):
    options = ("--kinds", "break", "--trials", "1", "--steps", "20", "--no-calibrate")
    done = succeeds(
        *("recover", "quadruped", "--damage", "intact", *SMALL, *options),
        *("--comparator", "heading_comparator:HEADING"),
        cwd=tmp_path,
        PYTHONPATH=str(ROOT / "examples"),
    )

    assert "comparator heading: " in done.stderr
    assert "truth: intact; the diagnosis is" in done.stdout
    assert any(
        line.startswith(("Intact: ", "Explained: ", "Ambiguous: ", "Unexplained: "))
        for line in done.stdout.splitlines()
    )
    (run,) = (tmp_path / "runs").iterdir()
    found = read_result(run / "result.json", "a result", "")
    assert all(np.isfinite(candidate["distance"]) for candidate in found["diagnosis"])


def test_robots_are_listed_with_their_parts_and_cases(tmp_path: Path):
    told = printed("robots", "--json", cwd=tmp_path)["robots"]

    assert [one["robot"] for one in told] == ["quadruped", "hexapod"]
    assert [one["weights"] for one in told] == [68, 120]
    assert [len(one["cases"]) for one in told] == [10, 10]


@pytest.mark.process
def test_a_process_ends_with_the_status_and_writes_each_stream_apart(tmp_path: Path):
    good = selfmodel_process("robots", "quadruped", "--json", cwd=tmp_path)
    bad = selfmodel_process("robots", "octopod", cwd=tmp_path)
    failed = selfmodel_process("logs", "verify", "no.mcap", cwd=tmp_path)

    assert json.loads(good.stdout)["robot"] == "quadruped"
    assert (good.returncode, good.stderr) == (0, "")
    assert (bad.returncode, bad.stdout) == (2, "")
    assert bad.stderr.startswith("error: unknown robot 'octopod'")
    assert (failed.returncode, failed.stderr) == (1, "")


def test_the_notes_of_an_error_are_in_its_message(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    def fail() -> None:
        error = TrialError("the environment failed")
        error.add_note("the safe command could not be sent")
        raise error

    monkeypatch.setattr(cli, "_run", fail)
    with pytest.raises(SystemExit, match="1"):
        cli.main()
    told = capsys.readouterr().err
    assert told == "error: the environment failed; the safe command could not be sent\n"
