"""The commands that work on logs: logs, replay, diagnose, render, report."""

import json
import os
import shlex
from pathlib import Path

import gymnasium
import mujoco
import numpy as np
import pytest

from selfmodel.logs import read_log
from selfmodel.logs.inspection import read_info
from tests.cli.conftest import KINDS
from tests.helpers.command import DIAGNOSIS, SMALL, printed, refused, selfmodel, succeeds
from tests.helpers.go2 import STAND, recorded

OLD = Path(__file__).parents[1] / "data" / "logs-0.1" / "recovery" / "trials"
OLD_BEFORE, OLD_AFTER = str(OLD / "00-before.mcap"), str(OLD / "01-after.mcap")
PAPERS = (
    *("--kinds", "paper", "--comparator", "forward-displacement", "--no-calibrate"),
    *("--diagnostic-search", "ea"),
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a log of a damaged quadruped, a cut one, a spoiled one, and a hexapod's."""
    folder = tmp_path_factory.mktemp("logs")
    damage = ("--damage", "break:front_left_knee", "--seed", "3")
    for robot, name, extra in (("quadruped", "a", damage), ("hexapod", "b", ())):
        succeeds("trial", robot, *extra, "--steps", "300", "--out", f"{name}.mcap", cwd=folder)
    data = (folder / "a.mcap").read_bytes()
    (folder / "cut.mcap.part").write_bytes(data[: len(data) // 2])
    (folder / "copy.mcap").write_bytes(data)
    os.mkfifo(folder / "pipe")
    (folder / "empty").mkdir()
    for name in ("taken.png", "taken.html"):
        (folder / name).write_text("{}")
    (folder / "flipped.mcap").write_bytes(data[:60_000] + b"\x00" + data[60_001:])
    return folder


def test_info_tells_what_is_in_a_log_but_not_what_is_hidden(folder: Path):
    done = succeeds("logs", "info", "a.mcap", cwd=folder)
    told = printed("logs", "info", "a.mcap", "--json", cwd=folder)

    for word in ("quadruped", "finished", "/joint_states", "Foxglove", "rerun", "observed"):
        assert word in done.stdout
    assert "front_left_knee" not in done.stdout
    (one,) = told["files"]
    log = read_log(folder / "a.mcap")
    assert one["displacement"] == log.trial.displacement
    assert (one["steps"], one["planned_steps"], one["status"]) == (300, 300, "finished")
    assert one["topics"]["/odom"] == {
        "type": "nav_msgs/msg/Odometry",
        "messages": 300,
        "rate": 100,
    }
    assert one["truth"] == "hidden"
    assert set(one["observed"].values()) == {1}
    assert "front_left_knee" not in json.dumps({**one, "topics": {}})


@pytest.mark.parametrize(
    ("name", "kind", "steps"),
    [("cut.mcap.part", "TruncatedError", 101), ("flipped.mcap", "CorruptError", 51)],
)
def test_damage_is_told_with_what_can_be_saved_and_how(
    folder: Path, tmp_path: Path, name: str, kind: str, steps: int
):
    info = selfmodel("logs", "info", name, "--json", cwd=folder)
    verify = selfmodel("logs", "verify", name, "a.mcap", "--json", cwd=folder)
    (damaged,) = json.loads(info.stdout)["files"]
    checked = json.loads(verify.stdout)

    assert (info.returncode, verify.returncode) == (1, 1)
    assert (damaged["kind"], damaged["salvageable_steps"]) == (kind, steps)
    assert checked["ok"] is False
    assert [one["ok"] for one in checked["files"]] == [False, True]
    command = f"selfmodel logs salvage {name} -o NEW.mcap"
    assert f"`{command}`" in damaged["error"]
    out = tmp_path / "new.mcap"
    arguments = command.replace("NEW.mcap", str(out)).split()[1:]
    assert printed(*arguments, "--json", cwd=folder)["steps"] == steps
    assert selfmodel("logs", "verify", str(out), cwd=folder).returncode == 0
    truth = ("--hypothesis", "break:front_left_knee", "--json")
    told = printed("replay", str(out), *truth, cwd=folder)
    assert (told["identical"], told["steps"]) == (True, steps)


def test_the_command_that_helps_can_be_pasted_whatever_the_file_is_called(
    folder: Path, tmp_path: Path
):
    name = tmp_path / "cut half é.mcap"
    name.write_bytes((folder / "cut.mcap.part").read_bytes())
    told = json.loads(selfmodel("logs", "info", str(name), "--json", cwd=folder).stdout)
    command = told["files"][0]["error"].partition("`")[2].partition("`")[0]
    arguments = shlex.split(command.replace("NEW.mcap", str(tmp_path / "new.mcap")))[1:]

    assert selfmodel(*arguments, cwd=folder).returncode == 0


@pytest.mark.parametrize(
    "arguments", [("replay", "a.mcap"), ("logs", "info", "a.mcap")], ids=["replay", "info"]
)
def test_a_narrow_terminal_loses_no_number(folder: Path, arguments: tuple[str, ...]):
    narrow = selfmodel(*arguments, cwd=folder, COLUMNS="40").stdout
    wide = selfmodel(*arguments, cwd=folder, COLUMNS="120").stdout
    cells = [cell.strip() for line in wide.splitlines() for cell in line.split("│")[1:-1]]

    assert len(cells) > 20
    assert "…" not in narrow
    assert all(cell in narrow for cell in cells)


def test_verify_says_ok_or_what_is_wrong_a_line_a_file(folder: Path):
    good = selfmodel("logs", "verify", "a.mcap", "b.mcap", cwd=folder)
    bad = selfmodel("logs", "verify", "cut.mcap.part", "a.mcap", "no.mcap", cwd=folder)

    assert (good.returncode, bad.returncode) == (0, 1)
    digests = [read_info(folder / f"{n}.mcap")["digest"] for n in "ab"]
    assert good.stdout.splitlines() == [
        f"ok: {n}.mcap: 300 steps, finished; SHA-256 {digest}"
        for n, digest in zip("ab", digests, strict=True)
    ]
    lines = bad.stdout.splitlines()
    assert [line.partition(":")[0] for line in lines] == ["error", "ok", "error"]
    assert "ends too early" in lines[0]
    assert "no.mcap: expected a log file that can be read" in lines[2]


def test_verify_expects_the_digest_that_info_and_verify_print(folder: Path):
    told = printed("logs", "verify", "a.mcap", "--json", cwd=folder)
    digest = told["files"][0]["digest"]
    expected = ("logs", "verify", "--expect", digest)

    assert f"SHA-256 {digest}" in selfmodel("logs", "info", "a.mcap", cwd=folder).stdout
    assert selfmodel(*expected, "copy.mcap", cwd=folder).returncode == 0
    other = selfmodel(*expected, "b.mcap", cwd=folder)
    assert other.returncode == 1
    assert f"expected the file with the SHA-256 {digest}, this one has" in other.stdout
    two = selfmodel(*expected, "a.mcap", "b.mcap", cwd=folder)
    assert two.returncode not in (0, 1)
    assert "give one log, got 2" in two.stderr


def test_replay_of_the_truth_is_identical_and_says_so(folder: Path):
    arguments = ("replay", "a.mcap", "--hypothesis", "break:front_left_knee")
    told = printed(*arguments, "--json", cwd=folder)
    said = selfmodel(*arguments, cwd=folder).stdout

    version = mujoco.__version__
    assert told["identical"] is True
    assert told["first_divergence_step"] is None
    assert set(told["rms"].values()) == {0}
    assert told["mujoco"] == {"logged": version, "running": version}
    assert "identical: every observed number" in said


def test_replay_of_another_hypothesis_shows_where_they_part(folder: Path, tmp_path: Path):
    figure = tmp_path / "parting.png"
    arguments = ("replay", "a.mcap", "--hypothesis", "break:front_left_shoulder")
    told = printed(*arguments, "--json", cwd=folder)
    drawn = selfmodel(*arguments, "--out", str(figure), cwd=folder, COLUMNS="80")

    assert told["identical"] is False
    assert 0 <= told["first_divergence_step"] < 100
    assert all(error > 0 for error in told["rms"].values())
    assert f"They differ from step {told['first_divergence_step']}" in drawn.stdout
    assert max(map(len, drawn.stdout.splitlines())) <= 80
    assert figure.read_bytes().startswith(b"\x89PNG")


def test_replay_with_another_mujoco_compares_with_a_tolerance_and_says_so(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    from selfmodel.cli.commands import ReplayTrial  # noqa: PLC0415  # what is tested
    from selfmodel.cli.replay import TOLERANCE, replay  # noqa: PLC0415  # what is tested

    monkeypatch.setattr(mujoco, "__version__", "3.99.0")
    replay(ReplayTrial(file=folder / "a.mcap", hypothesis="break:front_left_knee", as_json=True))
    told = json.loads(capsys.readouterr().out)
    replay(ReplayTrial(file=folder / "a.mcap"))
    said = capsys.readouterr().out

    assert told["mujoco"]["running"] == "3.99.0"
    assert told["tolerance"] == TOLERANCE
    assert "made with MuJoCo 3" in said
    assert "this is 3.99.0" in said


@pytest.fixture(scope="module")
def recovered_as_the_paper_did(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict]:
    """A folder in which a small recovery by displacement alone ran, and what it printed."""
    folder = tmp_path_factory.mktemp("paper")
    return folder, printed(
        *("recover", "quadruped", "--case", "1", *SMALL, "--steps", "60", *PAPERS),
        *("--repair", "paper", "--trials", "1", "--out", "run", "--json"),
        cwd=folder,
    )


@pytest.mark.search
@pytest.mark.parametrize(
    ("run", "options"), [("short", ("--kinds", KINDS)), ("recovered_as_the_paper_did", PAPERS)]
)
def test_diagnosis_from_logs_alone_says_what_the_run_said_that_wrote_them(
    run: str, options: tuple[str, ...], request: pytest.FixtureRequest
):
    folder, told = request.getfixturevalue(run)
    logs = [trial["log"] for trial in told["trials"]]
    found = printed("diagnose", *logs, *options, "--json", cwd=folder)

    for said in DIAGNOSIS:
        assert found[said] == told[said], said
    assert found["logs"] == logs[1:]
    assert found["intact"] == logs[:1]
    assert found["evaluations"] == told["evaluations"]["diagnostic"]
    assert found["distinct_hypotheses"] == told["evaluations"]["distinct_hypotheses"]
    assert found["seconds"] > 0


def test_a_log_given_as_healthy_is_so_whatever_its_stage(
    recovered_as_the_paper_did: tuple[Path, dict],
):
    folder, told = recovered_as_the_paper_did
    before, failed, later = (trial["log"] for trial in told["trials"][:3])
    given = ("diagnose", before, failed, "--healthy", later)
    found = printed(*given, *PAPERS, "--json", cwd=folder)

    assert (found["logs"], found["intact"]) == ([failed], [later, before])
    assert found["files"].keys() == {before, failed, later}


def test_diagnosis_shows_its_ranking_and_takes_another_self_model(
    recovered_as_the_paper_did: tuple[Path, dict], tmp_path: Path
):
    run, told = recovered_as_the_paper_did
    log = run / told["trials"][1]["log"]
    model = tmp_path / "mine.xml"
    model.write_text(read_log(log).mjcf, encoding="utf-8")
    diagnose = ("diagnose", str(log), *PAPERS)
    named = succeeds(*diagnose, "--robot", "quadruped", cwd=tmp_path)
    own = printed(*diagnose, "--robot", "mine.xml", "--json", cwd=tmp_path)
    begun = ("--hypothesis", "payload=0.2", "--genes", "1")
    known = printed(*diagnose, *begun, "--json", cwd=tmp_path)["diagnosis"]

    assert "payload=0.2" in {one["hypothesis"] for one in known}
    assert not any("+" in one["hypothesis"] for one in known)
    assert own["diagnosis"][0]["hypothesis"] in named.stdout
    assert "1 log, forward-displacement" in named.stdout
    assert "diagnosis from 1 trial" in named.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["diagnose", "a.mcap", "b.mcap"], "a.mcap is of 'quadruped', b.mcap of 'hexapod'"),
        (["diagnose", "a.mcap", "a.mcap"], "a.mcap and a.mcap are the same log"),
        (["diagnose", "a.mcap", "copy.mcap"], "a.mcap and copy.mcap are the same log"),
        (
            ["diagnose", "a.mcap", "--robot", "hexapod"],
            "hexapod is another robot than that of a.mcap: it has 12 sensors, the other 8",
        ),
        (["diagnose", OLD_BEFORE, "--healthy", OLD_AFTER], "given as healthy, after it: swap them"),
        (["diagnose", "a.mcap", "--kinds", "frction"], "'frction': did you mean friction, joint-f"),
        (["diagnose", "pipe"], "pipe: expected a log file, got a pipe or a device"),
        (["replay", "pipe"], "pipe: expected a log file, got a pipe or a device"),
        (["logs", "salvage", "pipe", "-o", "n.mcap"], "expected a log file, got a pipe"),
        (["logs", "import", "pipe", "--suggest", "--robot", "quadruped"], "a bag, got a pipe"),
        (
            ["logs", "import", "a.mcap", "--mapping", "/dev/zero", "-o", "n.mcap"],
            "/dev/zero: expected a mapping, got a pipe or a device",
        ),
        (["diagnose", "a.mcap", "--robot", "no.xml"], "no.xml: expected an MJCF or URDF file"),
        (["diagnose", "a.mcap", "--robot", "octopod"], "unknown robot 'octopod'"),
        (["diagnose", "cut.mcap.part"], "selfmodel logs salvage cut.mcap.part"),
        (["diagnose", "no.mcap"], "no.mcap: expected a log file that can be read"),
        (["diagnose"], "FILE..."),
        (["replay", "flipped.mcap"], "selfmodel logs salvage flipped.mcap"),
        (["replay", "a.mcap", "--hypothesis", "break:front_left_kne"], "did you mean"),
        (["replay", "a.mcap", "--out", "f.gif"], "ends in .png, .svg or .pdf"),
        (["replay", "a.mcap", "--out", "no/f.png"], "there is no folder no"),
        (["logs", "salvage", "cut.mcap.part", "-o", "a.mcap"], "a.mcap exists"),
        (["logs", "salvage", "cut.mcap.part", "-o", "new.bag"], "ends in .mcap"),
        (["logs", "salvage", "a.mcap", "-o", "new.mcap"], "there is nothing to salvage"),
        (["render", "a.mcap", "-o", "a.txt"], "--out needs a name that ends in .gif, .mp4, .png"),
        (["render", "a.mcap", "-o", "a.mcap"], "--out needs a name that ends in"),
        (["render", "a.mcap", "-o", "no/a.png"], "there is no folder no"),
        (["render", "a.mcap", "-o", "taken.png"], "taken.png exists, and is not overwritten"),
        (["render", "a.mcap", "-o", "f.png", "--stick"], "--stick is for films"),
        (["render", "a.mcap", "-o", "f.png", "--hypothesis", "break:nose"], "'nose'"),
        (["render", "a.mcap", "-o", "f.png", "--diagnosis", "taken.png"], "expected a diagnosis"),
        (
            ["render", "a.mcap", "-o", "f.png", "--diagnosis", "x", "--hypothesis", "intact"],
            "got both: leave one out",
        ),
        (["report", "empty"], "expected the folder of a run with its trials"),
        (["report", "empty", "a.mcap"], "expected one folder, or logs"),
        (["report", "a.mcap", "-o", "a.pdf"], "--out needs a name that ends in .html"),
        (["report", "a.mcap", "-o", "taken.html"], "taken.html exists, and is not overwritten"),
        (["report", "no.mcap"], "no.mcap"),
        (["report", "empty", "--diagnosis", "a.json"], "--diagnosis is for logs, and empty"),
        (["report", "a.mcap", "--diagnosis", "a.json"], "a.json: expected the output of"),
    ],
)
def test_bad_input_to_a_command_on_logs_is_one_sentence_and_status_2(
    folder: Path, arguments: list[str], said: str
):
    before = sorted(path.name for path in folder.iterdir())
    done = refused(*arguments, said=said, cwd=folder)
    assert done.stderr.startswith("Usage: ") or done.stderr.count("\n") == 1
    assert sorted(path.name for path in folder.iterdir()) == before


ANT = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets" / "ant.xml"


@pytest.fixture(scope="module")
def ant(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the model of an ant, and a log of it with a broken ankle."""
    folder = tmp_path_factory.mktemp("ant")
    (folder / "ant.xml").write_bytes(ANT.read_bytes())
    succeeds(
        *("trial", "ant.xml", "--damage", "break:ankle_1", "--steps", "200", "--seed", "3"),
        *("--stage", "after", "--out", "after.mcap"),
        cwd=folder,
    )
    return folder


@pytest.mark.process
def test_an_exported_trial_is_imported_as_the_same_trial(ant: Path):
    table = "after.csv"
    given = ("logs", "export", "after.mcap", "-o", table, "--json")
    assert printed(*given, cwd=ant)["rows"] == 200
    done = succeeds("logs", "import", table, "--suggest", "--robot", "ant.xml", cwd=ant)
    (ant / "map.toml").write_text(done.stdout)
    imported = ("logs", "import", table, "--mapping", "map.toml", "--out", "again.mcap")
    succeeds(*imported, cwd=ant)

    original, again = (
        read_log(ant / name).trial.trajectory for name in ("after.mcap", "again.mcap")
    )
    for signal, values in original.signals.items():
        assert values.tobytes() == again[signal].tobytes(), signal


@pytest.mark.process
@recorded
def test_a_recording_of_a_real_robot_is_imported_without_an_edit(tmp_path: Path):
    (tmp_path / "go2.xml").write_bytes((STAND / "go2.xml").read_bytes())
    table = STAND / "go2-stand.npz"
    done = selfmodel("logs", "import", table, "--suggest", "--robot", "go2.xml", cwd=tmp_path)
    (tmp_path / "map.toml").write_text(
        done.stdout.replace("control_timestep = 0.01 ", "control_timestep = 0.02 ")
    )
    succeeds("logs", "import", table, "--mapping", "map.toml", "-o", "g.mcap", cwd=tmp_path)

    trajectory = read_log(tmp_path / "g.mcap").trial.trajectory
    with np.load(table) as recorded:
        position = recorded["position"][::4]
    assert trajectory.steps == 750
    assert np.abs(trajectory["joint_positions"] - position).max() < 0.01
    assert np.isnan(trajectory["base_position"]).all()
