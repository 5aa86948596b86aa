"""Promises of the check of a model: what depends on the time step is said, with what mends it."""

import re
from pathlib import Path

import pytest

from benchmarks.hexapod.robots import CONTROL_TIMESTEP, MODELS, urdf
from selfmodel.arguments import robot_entry
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.mjcf.settings import checked_settings
from selfmodel.robot.robot import Robot
from selfmodel.simulation.model_check import model_notes
from selfmodel.studies import bodies

pytestmark = pytest.mark.search

DAMPED = MODELS["damped"]
HARD = {**DAMPED, "solref": [0.005, 1]}
FIXED = {"timestep": 1 / 240, "kp": 400, "kd": 17, "velocity": 0, "base": "fixed"}


def hexapod(folder: Path, settings: dict) -> Robot:
    path = folder / "hexapod.urdf"
    path.write_text(urdf())
    given = {"control_timestep": CONTROL_TIMESTEP, **settings}
    return load_mjcf(path, checked_settings(given))


@pytest.mark.parametrize(
    ("settings", "advice"),
    [
        *((MODELS[name], []) for name in ("import", "stiff", "servo", "rotor")),
        (DAMPED, ["timestep", "armature"]),
        (HARD, ["timestep", "armature", "solref"]),
        (FIXED, ["timestep", "armature"]),
    ],
    ids=["import", "stiff", "servo", "rotor", "damped", "hard contacts", "fixed"],
)
def test_what_depends_on_the_time_step_is_said(settings: dict, advice: list[str], tmp_path: Path):
    notes = model_notes(hexapod(tmp_path, settings))
    assert [re.findall(r"set (\w+)", note) for note in notes] == [[one] for one in advice]
    assert ("base goes" in "".join(notes)) == (bool(notes) and "base" not in settings)


@pytest.mark.parametrize("remedy", ["timestep", "armature"])
def test_what_a_note_advises_ends_it(remedy: str, tmp_path: Path):
    text = " ".join(model_notes(hexapod(tmp_path, DAMPED)))
    (number,) = re.findall(rf"set {remedy}.*? to ([\d.]+)", text)
    assert model_notes(hexapod(tmp_path, {**DAMPED, remedy: float(number)})) == ()


def test_nothing_is_said_of_the_robots_of_selfmodel(robot: Robot):
    assert model_notes(robot) == ()


@pytest.mark.bodies
@pytest.mark.parametrize("name", bodies.bodies_of([*bodies.DOMAINS], None)[2:])
def test_nothing_is_said_of_bodies_of_the_suite(name: str):
    assert model_notes(robot_entry(name).robot()) == ()
