"""Promises of the check of a model: what depends on the time step is said, with what mends it."""

import re
from pathlib import Path

import pytest

from selfmodel.arguments import robot_entry
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.mjcf.settings import checked_settings
from selfmodel.robot.robot import Robot
from selfmodel.simulation.model_check import model_notes
from selfmodel.studies import bodies
from tests.helpers.robots.hexapod import EFFORT, VELOCITY, hexapod_urdf

pytestmark = pytest.mark.search

BULLET = {"timestep": 1 / 240, "control_timestep": 4 / 240}
STIFF = {**BULLET, "kp": 40, "kd": 1.67}
DAMPED = {**STIFF, "damping": EFFORT / VELOCITY, "velocity": 0}
MENDED = {**DAMPED, "armature": 0.005, "solref": [0.01, 1]}


def hexapod(folder: Path, settings: dict) -> Robot:
    path = folder / "hexapod.urdf"
    path.write_text(hexapod_urdf())
    return load_mjcf(path, checked_settings(settings))


@pytest.mark.parametrize(
    ("settings", "advice"),
    [
        ({}, []),
        (STIFF, ["timestep", "armature"]),
        (DAMPED, ["timestep", "armature"]),
        (MENDED, []),
        ({**STIFF, "solref": [0.005, 1]}, ["timestep", "armature", "solref"]),
        ({**BULLET, "kp": 400, "kd": 17, "velocity": 0, "base": "fixed"}, ["timestep", "armature"]),
    ],
    ids=["import", "stiff", "damped", "mended", "hard contacts", "fixed"],
)
def test_what_depends_on_the_time_step_is_said(settings: dict, advice: list[str], tmp_path: Path):
    notes = model_notes(hexapod(tmp_path, settings))
    assert [re.findall(r"set (\w+)", note) for note in notes] == [[one] for one in advice]
    assert ("base goes" in "".join(notes)) == (bool(notes) and "base" not in settings)


@pytest.mark.parametrize("settings", [STIFF, DAMPED], ids=["stiff", "damped"])
@pytest.mark.parametrize("remedy", ["timestep", "armature"])
def test_what_a_note_advises_ends_it(settings: dict, remedy: str, tmp_path: Path):
    text = " ".join(model_notes(hexapod(tmp_path, settings)))
    (number,) = re.findall(rf"set {remedy}.*? to ([\d.]+)", text)
    assert model_notes(hexapod(tmp_path, {**settings, remedy: float(number)})) == ()


def test_nothing_is_said_of_the_robots_of_selfmodel(robot: Robot):
    assert model_notes(robot) == ()


@pytest.mark.bodies
@pytest.mark.parametrize("name", bodies.bodies_of([*bodies.DOMAINS], None)[2:])
def test_nothing_is_said_of_bodies_of_the_suite(name: str):
    assert model_notes(robot_entry(name).robot()) == ()
