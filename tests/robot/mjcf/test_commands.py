"""Tests of the command line with a user's MJCF."""

import json
import shutil
from pathlib import Path

import pytest

from tests.helpers.command import SMALL, printed, refused, selfmodel
from tests.robot.mjcf.awkward import mjcf
from tests.robot.mjcf.samples import SAMPLES


@pytest.fixture
def ant(tmp_path: Path) -> Path:
    """Returns the path of a copy of gymnasium's ant."""
    return Path(shutil.copy(SAMPLES["gymnasium ant"], tmp_path / "ant.xml"))


@pytest.mark.search
def test_a_users_robot_is_recovered_and_diagnosed_from_its_logs(ant: Path, tmp_path: Path):
    before = ant.read_bytes()
    damage = ("--damage", "break:ankle_1", "--trials", "1", "--steps", "80", *SMALL)
    kinds = ("--kinds", "paper", "--json")
    told = printed("recover", "ant.xml", *damage, "--out", "run", *kinds, cwd=tmp_path)

    logs = sorted(str(path) for path in (tmp_path / "run" / "trials").glob("*.mcap"))
    alone = selfmodel("diagnose", *logs, *kinds, cwd=tmp_path)
    with_file = selfmodel("diagnose", *logs, "--robot", "ant.xml", *kinds, cwd=tmp_path)

    assert (told["robot"], told["truth"]) == ("ant", "break:ankle_1")
    assert alone.returncode == with_file.returncode == 0, alone.stderr + with_file.stderr
    for found in (alone, with_file):
        assert json.loads(found.stdout)["diagnosis"] == told["diagnosis"]
    assert ant.read_bytes() == before


def test_the_parts_of_a_robot_are_shown(ant: Path, tmp_path: Path):
    told = printed("robots", str(ant), "--json", cwd=tmp_path)
    shown = selfmodel("robots", str(ant), cwd=tmp_path, COLUMNS="60").stdout

    assert told["root"] == {"body": "torso", "floats": True, "fixed": False}
    assert told["joint_details"][1]["limb"] == ["ankle_1"]
    assert told["motor_details"][0]["drives"] == ["hip_4"]
    assert {"break", "jam", "sensor", "motor", "friction"} <= {f["kind"] for f in told["faults"]}
    assert "8 angle sensors and 4 touch sensors were added" in told["notes"]
    assert all(name in shown for name in ("torso", "ankle_1_touch", "break:", "note: "))
    tables = [line for line in shown.splitlines() if not line.startswith("note: ")]
    assert max(map(len, tables)) <= 60
    assert "set timestep to 0.005" in told["notes"][-1], "1.96 m in place of 1.72 m"


def test_settings_are_options(ant: Path, tmp_path: Path):
    options = ("--set", "control_timestep=0.02", "--set", "touch=[]")
    told = printed("robots", str(ant), *options, "--json", cwd=tmp_path)

    assert (told["control_timestep"], told["hidden_neurons"]) == (0.02, 3)
    assert not any(sensor["kind"] == "touch" for sensor in told["sensor_details"])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("recover", "ant.xml", "--case", "11"), "unknown case"),
        (("recover", "ant.xml"), "a notation is like break:ankle_1"),
        (("recover", "ant.xml", "--damage", "break:hipp"), "did you mean hip_"),
        (("recover", "quadruped", "--case", "1", "--set", "forward=y"), "is the name of a robot"),
        (("robots", "ant.xml", "--set", "forwards=y"), "did you mean forward"),
        (("robots", "ant.xml", "--set", "y"), "a setting such as forward=-x, got 'y'"),
        (("robots", "ant.xml", "--set", "touch=['torso_geom']"), "unknown body"),
        (("robots", "no.xml"), "no.xml: expected an MJCF or URDF file"),
        (("trial", "bad.xml", "--out", "t.mcap"), "ctrlrange=[-1, 1]"),
    ],
)
def test_invalid_arguments_are_refused_before_a_run(
    ant: Path, tmp_path: Path, arguments: tuple[str, ...], said: str
):
    bad = mjcf(motors='<motor name="m" joint="left_hip"/>')
    (tmp_path / "bad.xml").write_text(bad, encoding="utf-8")

    done = refused(*arguments, said=said, cwd=tmp_path)

    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1
    assert {path.name for path in tmp_path.iterdir()} == {ant.name, "bad.xml"}
