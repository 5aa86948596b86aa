"""Logs that are sound files of impossible robots: every command ends with a sentence."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from selfmodel.logs.records import MODEL_FILE, TrialHeader
from selfmodel.logs.writer import write_trial
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.signals import Signal
from selfmodel.trials.trajectory import Sample
from tests.helpers.command import Done, selfmodel
from tests.logs.conftest import MJCF, plan_of
from tests.logs.edits import attach

BOX = '<geom type="box" size="0.3 0.3 0.3" {}/>'
CROWD = MJCF.replace('<body name="torso"', 120 * BOX.format('pos="0 0 0.6"') + '<body name="torso"')
CROWD = CROWD.replace('<freejoint name="root"/>', '<freejoint name="root"/>' + 125 * BOX.format(""))
"""A model with 15,000 pairs of geoms in contact: MuJoCo's memory for contacts is too small."""

SINGULAR = MJCF.replace(
    '<joint name="left_hip_y" axis="0 1 0" range="-30 30" pos="0.02 0 0.03"/>',
    '<joint name="left_hip_y" axis="1 0 0" range="-30 30" pos="0.01 0 0"/>',
)
"""A model whose two hinges of a hip have one axis: MuJoCo warns of its inertia matrix."""

Make = Callable[..., Path]


@pytest.fixture
def make(tmp_path: Path) -> Make:
    """Returns a function that writes the log of a biped, with another model or other numbers."""

    def written(mjcf: str = MJCF, **values: float) -> Path:
        robot = Robot("biped", MJCF, 0.01)
        plan = replace(plan_of(robot, 60), stage="single")
        few = Settings(generations=1, genes=1).scaled(4)
        samples = (
            _with(sample, values) for sample in SimulatedRobot(robot).run(plan.controller, 60)
        )
        path = write_trial(tmp_path / "trial.mcap", robot, plan, samples, TrialHeader(few))
        attach(path, MODEL_FILE, "model_sha256", mjcf.encode())
        return path

    return written


def _with(sample: Sample, values: dict[Signal, float]) -> Sample:
    others = {
        signal: np.full_like(sample.values[signal], value) for signal, value in values.items()
    }
    return replace(sample, values={**sample.values, **others})


def run(log: Path, *command: str) -> Done:
    done = selfmodel(command[0], str(log), *command[1:], cwd=log.parent)
    assert not (log.parent / "MUJOCO_LOG.TXT").exists()
    assert "WARNING" not in done.stderr
    return done


def test_too_many_contacts_are_a_diverged_simulation(make: Make, capfd: pytest.CaptureFixture[str]):
    log = make(CROWD)
    replayed = run(log, "replay", "--json")
    assert (replayed.returncode, replayed.stderr) == (0, "")
    assert json.loads(replayed.stdout)["diverged"]
    drawn = run(log, "render", "--out", "strip.png", "--pictures", "2")
    assert drawn.returncode == 0
    assert "note: the simulation diverged" in drawn.stderr
    assert capfd.readouterr() == ("", "")


@pytest.mark.search
def test_a_diagnosis_with_too_many_contacts_is_unexplained(make: Make):
    found = run(make(CROWD), "diagnose", "--kinds", "break")
    assert found.returncode == 0
    assert "Unexplained: no simulation of the trials remained finite" in found.stdout
    assert "every simulation diverged" in found.stderr


def test_warnings_of_mujoco_are_one_sentence_with_their_number(
    make: Make, capfd: pytest.CaptureFixture[str]
):
    done = run(make(SINGULAR), "diagnose", "--kinds", "break")
    assert done.returncode == 0
    notes = [line for line in done.stderr.splitlines() if line.startswith("note: ")]
    assert len(notes) == 1
    assert notes[0].startswith("note: MuJoCo warned ")
    assert " times: Inertia matrix is too close to singular" in notes[0]
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(("signal", "value"), [("base_position", 1e308), ("sensors", -np.inf)])
def test_absurd_numbers_are_refused_or_compared_and_never_a_traceback(
    make: Make, signal: Signal, value: float
):
    log = make(**{signal: value})
    assert selfmodel("logs", "verify", str(log), cwd=log.parent).returncode == 0
    found = run(log, "diagnose", "--comparator", "segment-prediction")
    assert found.returncode == 2
    assert signal in found.stderr
    assert found.stderr.startswith("error: ")
    replayed = run(log, "replay")
    assert (replayed.returncode, replayed.stderr) == (0, "")
    drawn = run(log, "render", "--out", "strip.png", "--pictures", "2")
    assert drawn.returncode == (2 if signal == "base_position" else 0)


def test_infinite_positions_are_compared_by_a_comparator_without_them_and_named(make: Make):
    found = run(make(base_position=np.inf), "diagnose")

    assert found.returncode == 0
    assert "segment-prediction-onboard: " in found.stderr
    assert "needs base_position" in found.stderr


def test_an_impossible_gravity_is_refused_before_any_search(make: Make):
    log = make(MJCF.replace("<option ", '<option gravity="0 0 1e300" '))
    for command in (["diagnose"], ["replay"]):
        done = run(log, *command)
        assert done.returncode == 2
        assert (
            "expected finite numbers of at most 1e+10 in the model's option gravity" in done.stderr
        )
