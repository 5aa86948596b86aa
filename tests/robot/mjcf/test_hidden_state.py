"""Tests of hidden state: the adapted copy has none, and moves as the user's file does."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from selfmodel.faults.hypothesis import INTACT
from selfmodel.robot.mjcf.expand import MIN_ITERATIONS
from selfmodel.robot.mjcf.load import AdaptedMjcf, adapt, robot_from
from selfmodel.robot.mjcf.settings import MjcfSettings
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from tests.helpers.robots.go1 import go1, trot
from tests.robot.mjcf.awkward import mjcf

WARM_START = int(mujoco.mjtDisableBit.mjDSBL_WARMSTART)
SLEEP = int(mujoco.mjtEnableBit.mjENBL_SLEEP)


def adapted(folder: Path, more: str) -> AdaptedMjcf:
    path = folder / "robot.xml"
    path.write_text(mjcf(more=more), encoding="utf-8")
    return adapt(path, MjcfSettings())


def options(copy: AdaptedMjcf) -> mujoco.MjOption:
    return mujoco.MjModel.from_xml_string(copy.mjcf, dict(copy.assets)).opt


@pytest.mark.parametrize(
    "more",
    [
        "",
        '<option><flag warmstart="enable"/></option>',
        '<option timestep=".005"/><option><flag gravity="disable" sleep="enable"/></option>',
    ],
)
def test_warm_start_and_sleep_are_off_and_a_note_says_so(more: str, tmp_path: Path):
    copy = adapted(tmp_path, more)
    found = options(copy)

    assert found.disableflags & WARM_START
    assert not found.enableflags & SLEEP
    assert sum("warm start is off" in note for note in copy.notes) == 1
    assert sum("sleep is off" in note for note in copy.notes) == more.count("sleep")
    gravity = int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    assert bool(found.disableflags & gravity) == ("gravity" in more)


def test_the_iterations_of_a_solver_that_stops_early_are_raised(tmp_path: Path):
    more = '<option iterations="7"/><option iterations="1" ls_iterations="5"/>'
    copy = adapted(tmp_path, more)
    found = options(copy)

    assert (found.iterations, found.ls_iterations) == tuple(MIN_ITERATIONS.values())
    assert any("iterations from 1 to 100, ls_iterations from 5 to 50" in n for n in copy.notes)


def test_more_iterations_than_the_least_are_kept(tmp_path: Path):
    copy = adapted(tmp_path, '<option iterations="200"/>')

    assert options(copy).iterations == 200
    assert not any("iterations" in note for note in copy.notes)


def test_a_file_without_hidden_state_keeps_its_options(tmp_path: Path):
    copy = adapted(tmp_path, '<option iterations="1"><flag warmstart="disable"/></option>')

    assert options(copy).iterations == 1
    assert not any("warm start" in note for note in copy.notes)


def path_of(robot: Robot, stride: float) -> np.ndarray:
    """Returns the positions of the base of the Go1 in three seconds, ``(steps, 3)``."""
    runs = [(INTACT, trot(robot, 300, stride))]
    simulated = Simulator(robot, 1).run(runs, 300, ("base_position",))
    assert not simulated.diverged.any()
    return np.asarray(simulated.behaviour["base_position"][0])


@pytest.mark.parametrize("stride", [0.0, 0.12], ids=["stands", "walks"])
def test_a_go1_of_one_iteration_moves_as_with_its_warm_start(stride: float, tmp_path: Path):
    path = tmp_path / "go1.xml"
    path.write_text(go1(), encoding="utf-8")
    copy = adapt(path, MjcfSettings())
    original = copy.mjcf.replace('warmstart="disable"', 'warmstart="enable"')
    for name, least in MIN_ITERATIONS.items():
        own = {"iterations": 1, "ls_iterations": 5}[name]
        original = original.replace(f' {name}="{least}"', f' {name}="{own}"')
    theirs = robot_from(AdaptedMjcf("go1", original, 0.012, {}, ()), "go1.xml")
    ours = robot_from(copy, "go1.xml")
    before, after = (path_of(robot, stride) for robot in (theirs, ours))

    assert theirs.model.opt.iterations == 1
    assert not theirs.model.opt.disableflags & WARM_START
    assert abs(before[100:, 2].mean() - after[100:, 2].mean()) < 0.002  # 0.01 m with 1 iteration
    assert np.linalg.norm(before[-1] - after[-1]) < 0.02
