"""``--controller`` and ``--neurons``: the design that is evolved, and its logs."""

import json
from pathlib import Path

import pytest

from selfmodel.logs import read_log
from selfmodel.logs.journal import is_calibrated
from tests.helpers.command import SMALL, printed, refused, selfmodel, succeeds

FEW = (*SMALL, "--kinds", "paper", "--trials", "1", "--steps", "60", "--out", "run", "--json")


@pytest.fixture(scope="module")
def rhythmic(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict]:
    """A folder in which a robot was recovered with oscillators, and what it said."""
    folder = tmp_path_factory.mktemp("rhythmic")
    asked = ("--case", "3", "--controller", "cpg", "--no-calibrate")
    return folder, printed("recover", "quadruped", *asked, *FEW, cwd=folder)


@pytest.mark.search
def test_a_recovery_evolves_oscillators_where_they_are_asked_for(rhythmic: tuple[Path, dict]):
    folder, told = rhythmic
    drivers = [read_log(folder / one["log"]).trial.plan.controller for one in told["trials"]]

    assert told["controller"] == "cpg"
    assert len(drivers) == 3
    assert all(driver.design.name == "cpg" for driver in drivers)
    assert drivers[0] == drivers[1] != drivers[2]


@pytest.mark.search
def test_oscillators_of_a_log_drive_another_trial_which_replays(rhythmic: tuple[Path, dict]):
    folder, told = rhythmic
    given = ("--controller", told["trials"][0]["log"], "--damage", "break:back_left_knee")
    succeeds("trial", "quadruped", *given, "--out", "broken.mcap", "--json", cwd=folder)
    again = selfmodel(
        *("replay", "broken.mcap", "--hypothesis", "break:back_left_knee", "--json"), cwd=folder
    )
    info = selfmodel("logs", "info", "broken.mcap", cwd=folder)

    assert json.loads(again.stdout)["identical"] is True
    assert "a CPG of" in info.stdout


def test_a_trial_takes_random_cpgs_or_a_random_network_of_any_size(tmp_path: Path):
    for number, asked in enumerate((["--controller", "cpg"], ["--neurons", "6"])):
        out = f"{number}.mcap"
        succeeds("trial", "quadruped", *asked, "--steps", "9", "--out", out, cwd=tmp_path)
    rhythmic, large = (read_log(tmp_path / f"{k}.mcap").trial.plan.controller for k in (0, 1))

    assert rhythmic.design.name == "cpg"
    assert large.design.hidden == 6


@pytest.mark.search
def test_a_recovery_s_network_has_as_many_neurons_as_are_asked_for(tmp_path: Path):
    asked = ("--neurons", "5", "--damage", "neuron:4", "--no-calibrate")
    told = printed("recover", "quadruped", *asked, *FEW, cwd=tmp_path)
    log = read_log(tmp_path / told["trials"][-1]["log"])

    assert told["neurons"] == 5
    assert told["controller"] == "network"
    assert told["calibration"] is None
    assert not is_calibrated(tmp_path / Path(told["trials"][-1]["log"]).parents[1])
    assert log.trial.plan.controller.design.hidden == 5


def test_a_controller_of_another_size_is_refused_by_what_differs(tmp_path: Path):
    few = ("--steps", "9", "--out", "6.mcap")
    first = selfmodel("trial", "quadruped", "--neurons", "6", *few, cwd=tmp_path)
    done = refused(
        *("trial", "quadruped", "--controller", "6.mcap", "--neurons", "3", "--out", "3.mcap"),
        said="6 hidden neurons and 8 motors; this robot needs one for",
        cwd=tmp_path,
    )

    assert first.returncode == 0
    assert "3 hidden neurons" in done.stderr
