"""Tests of recordings for Rerun: both bodies as MuJoCo poses them, and the joints of the log."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from selfmodel.cli.rendering.film import film_of
from selfmodel.cli.viewing.recording import LOGGED, SIMULATED, fill_recording
from selfmodel.cli.viewing.rerun_view import write_recording
from selfmodel.errors import WorkError
from selfmodel.faults.notation import parse
from selfmodel.logs import read_log
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.writing.writer import write_trial
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.simulation.trial_replay import replay
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.trial import TrialPlan
from tests.helpers.drivers import random_controllers

pytest.importorskip("rerun", reason="the extra rerun is not installed")

Shown = tuple[dict[tuple[str, str], list[list]], Behaviour, Behaviour]

STEPS = 31
DAMAGE = "break:front_left_knee"


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory, quadruped: Robot) -> Path:
    """A short log of a damaged quadruped."""
    path = tmp_path_factory.mktemp("view") / "a.mcap"
    (controller,) = random_controllers(quadruped, 1, seed=3)
    plan = TrialPlan("trial", "single", controller, STEPS, 0)
    samples = SimulatedRobot(quadruped, parse(DAMAGE, quadruped.anatomy)).run(controller, STEPS)
    write_trial(path, quadruped, plan, samples, TrialHeader(Settings()))
    return path


def columns(path: Path) -> dict[tuple[str, str], list[list]]:
    """The values of each column of a recording, by entity and name."""
    from rerun.chunk import RrdReader  # noqa: PLC0415  # an extra

    found = {}
    for chunk in RrdReader(str(path)).stream():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            found[chunk.entity_path, name] = batch.column(name).to_pylist()
    return found


@pytest.fixture(scope="module")
def shown(log: Path, quadruped: Robot, tmp_path_factory: pytest.TempPathFactory) -> Shown:
    """The columns of a recording, with the logged and the simulated behaviour."""
    trial = read_log(log).trial
    hypothesis = parse("jam:back_left_knee", quadruped.anatomy)
    found = replay(trial, hypothesis, Simulator(quadruped, 1))
    logged = trial.behaviour
    motions = [(LOGGED, logged), (SIMULATED, found.simulated)]
    film = film_of(quadruped, hypothesis, motions, np.asarray(logged.time))
    out = tmp_path_factory.mktemp("rrd") / "a.rrd"
    size = write_recording(out, lambda to: fill_recording(to, film, logged, found, "about"))

    assert size == out.stat().st_size
    return columns(out), logged, found.simulated


def test_both_bodies_move_as_logged_and_as_simulated(shown: Shown, quadruped: Robot):
    values, logged, simulated = shown
    model, data = quadruped.model, mujoco.MjData(quadruped.model)
    for name, behaviour in ((LOGGED, logged), (SIMULATED, simulated)):
        torso = np.array(values[f"/world/{name}/torso", "Transform3D:translation"])[:, 0]
        shin = np.array(values[f"/world/{name}/front_left_lower", "Transform3D:translation"])
        turn = np.array(values[f"/world/{name}/front_left_lower", "Transform3D:quaternion"])

        assert np.allclose(torso, behaviour["base_position"], atol=1e-6)
        for step in (0, 15, STEPS - 1):
            data.qpos[:3] = behaviour["base_position"][step]
            data.qpos[3:7] = behaviour["base_orientation"][step]
            for hinge, angle in zip(
                behaviour.names.hinges, behaviour["joint_positions"][step], strict=True
            ):
                data.joint(hinge).qpos[:] = angle
            mujoco.mj_kinematics(model, data)
            body = data.body("front_left_lower")

            assert np.allclose(shin[step, 0], body.xpos, atol=1e-6)
            assert np.allclose(turn[step, 0], np.roll(body.xquat, -1), atol=1e-6)


def test_the_plotted_joints_are_those_of_the_log_to_the_bit(shown: Shown):
    values, logged, simulated = shown
    for name, behaviour in ((LOGGED, logged), (SIMULATED, simulated)):
        for column, hinge in enumerate(behaviour.names.hinges):
            line = np.array(values[f"/joints/{hinge}/{name}", "Scalars:scalars"])[:, 0]

            assert np.array_equal(line, behaviour["joint_positions"][:, column])
    times = values["/joints/front_left_knee/logged", "trial time"]
    assert [round(time.total_seconds(), 6) for time in times] == pytest.approx(logged.time)


def test_a_jammed_part_is_red_in_both_bodies(shown: Shown):
    values = shown[0]
    colours = {
        entity.split("/")[3]: column[0][0]
        for (entity, name), column in values.items()
        if name.endswith(":colors") and entity.startswith("/world/simulated")
    }

    assert colours["back_left_lower"] == 0xC82828FF
    assert colours["torso"] == 0xE67814FF


def test_a_recording_that_cannot_be_written_is_an_error_and_leaves_no_file(tmp_path: Path):
    with pytest.raises(WorkError, match="it could not be written"):
        write_recording(tmp_path / "missing" / "a.rrd", lambda _recording: None)
    assert list(tmp_path.iterdir()) == []
