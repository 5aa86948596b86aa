"""Tests of awkward files, which give a robot that moves or are refused, and of hidden state."""

from pathlib import Path
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pytest

from selfmodel.controllers.controller import Controller
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT
from selfmodel.isolation import Message
from selfmodel.logs import read_log
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.writer import write_trial
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.designs import cpg_for
from selfmodel.robot.mjcf import load
from selfmodel.robot.mjcf.load import adapt_message, load_mjcf
from selfmodel.robot.mjcf.structure import MIN_ITERATIONS, expand
from selfmodel.robot.mjcf.work import Work
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import TrialPlan
from tests.helpers.drivers import random_controllers
from tests.helpers.exactness import exactness
from tests.helpers.robots.arms import robot_of
from tests.helpers.robots.go1 import go1, trot
from tests.robot.mjcf.awkward import AWKWARD, LEGS, MOTORS, mjcf

STEPS = 20

ROUNDING = 1e-9
"""Largest error of a prediction from a logged state: the base of a planar robot is logged as a
position and a quaternion."""


@pytest.mark.parametrize("what", [what for what, case in AWKWARD.items() if not case.sentence])
def test_an_awkward_but_valid_file_gives_a_robot_that_moves(what: str, tmp_path: Path):
    path = AWKWARD[what].write(tmp_path)
    before = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}

    robot = load_mjcf(path)
    (controller,) = random_controllers(robot, 1)
    found = exactness(robot, INTACT, controller, STEPS)

    assert found.prediction <= ROUNDING  # which no diverged state is
    assert found.displacement == 0.0
    assert before == {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}


@pytest.mark.parametrize("what", [what for what, case in AWKWARD.items() if case.sentence])
def test_an_invalid_file_is_refused_in_one_sentence(what: str, tmp_path: Path):
    path = AWKWARD[what].write(tmp_path)

    with pytest.raises(InputError) as refusal:
        load_mjcf(path)

    said = str(refusal.value)
    assert said.startswith(str(path.parent))
    assert AWKWARD[what].sentence in said
    assert "\n" not in said
    assert len(said) < 500


@pytest.mark.usefixtures("isolated")
def test_a_child_process_reads_a_file_and_gives_the_robot_or_the_refusal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    path = AWKWARD["UTF-16"].write(tmp_path)
    here = adapt_message(Message({"path": str(path), "settings": {}}, {"file": path.read_bytes()}))

    monkeypatch.delattr(load.untrusted, "parse_xml")  # of this process
    robot = load_mjcf(path)

    assert robot.mjcf == here.header["mjcf"]
    with pytest.raises(InputError, match=r"robot\.xml: .*no actuators"):
        load_mjcf(AWKWARD["no actuator"].write(tmp_path))


def test_a_trial_of_a_robot_without_any_sensor_is_logged_and_read(tmp_path: Path):
    robot = robot_of(mjcf(), touch=(), angle=())
    driver = Controller(cpg_for(robot), np.full(cpg_for(robot).weights, 0.5))
    path = write_trial(
        tmp_path / "trial.mcap",
        robot,
        TrialPlan("trial", "single", driver, 20, 0),
        SimulatedRobot(robot).run(driver, 20),
        TrialHeader(Settings()),
    )
    read = read_log(path).trial.trajectory

    assert read["sensors"].shape == (20, 0)
    assert read["joint_positions"].shape == (20, robot.model.nu)


WARM_START = int(mujoco.mjtDisableBit.mjDSBL_WARMSTART)
SLEEP = int(mujoco.mjtEnableBit.mjENBL_SLEEP)


@pytest.mark.parametrize(
    "more",
    [
        "",
        '<option><flag warmstart="enable"/></option>',
        '<option timestep=".005"/><option><flag gravity="disable" sleep="enable"/></option>',
    ],
)
def test_warm_start_and_sleep_are_off_and_a_note_says_so(more: str):
    copy = robot_of(mjcf(more=more))
    found = copy.model.opt

    assert found.disableflags & WARM_START
    assert not found.enableflags & SLEEP
    assert sum("warm start is off" in note for note in copy.notes) == 1
    assert sum("sleep is off" in note for note in copy.notes) == more.count("sleep")
    gravity = int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    assert bool(found.disableflags & gravity) == ("gravity" in more)


def test_the_iterations_of_a_solver_that_stops_early_are_raised():
    more = '<option iterations="7"/><option iterations="1" ls_iterations="5"/>'
    copy = robot_of(mjcf(more=more))
    found = copy.model.opt

    assert (found.iterations, found.ls_iterations) == tuple(MIN_ITERATIONS.values())
    assert any("iterations from 1 to 100, ls_iterations from 5 to 50" in n for n in copy.notes)


def test_a_file_without_hidden_state_keeps_its_options():
    more = '<option iterations="1"><flag warmstart="disable"/></option>'
    copy = robot_of(mjcf(more=more))

    assert copy.model.opt.iterations == 1
    assert not any("warm start" in note for note in copy.notes)


def path_of(robot: Robot, stride: float) -> np.ndarray:
    """Returns the positions of the base of the Go1 in three seconds, ``(steps, 3)``."""
    runs = [(INTACT, trot(robot, 300, stride))]
    simulated = Simulator(robot, 1).run(runs, 300, ("base_position",))
    assert not simulated.diverged.any()
    return np.asarray(simulated.trajectory["base_position"][0])


@pytest.mark.parametrize("stride", [0.0, 0.12], ids=["stands", "walks"])
def test_a_go1_of_one_iteration_moves_as_with_its_warm_start(stride: float):
    ours = robot_of(go1())
    original = ours.mjcf.replace('warmstart="disable"', 'warmstart="enable"')
    for name, least in MIN_ITERATIONS.items():
        own = {"iterations": 1, "ls_iterations": 5}[name]
        original = original.replace(f' {name}="{least}"', f' {name}="{own}"')
    theirs = Robot("go1", original, 0.012)
    before, after = (path_of(robot, stride) for robot in (theirs, ours))

    assert theirs.model.opt.iterations == 1
    assert not theirs.model.opt.disableflags & WARM_START
    assert abs(before[100:, 2].mean() - after[100:, 2].mean()) < 0.002  # 0.01 m with 1 iteration
    assert np.linalg.norm(before[-1] - after[-1]) < 0.02


def test_a_large_reservation_of_memory_is_left_out_and_a_usual_one_stays():
    large = robot_of(mjcf(more='<size njmax="8000" nconmax="4000"/>'))
    usual = robot_of(mjcf(more='<size njmax="500" nconmax="100"/>'))

    assert any("without njmax=8000, nconmax=4000" in note for note in large.notes)
    assert "njmax" not in large.mjcf
    assert 'njmax="500"' in usual.mjcf


FRAMES = """<mujoco><default><default class="c"><geom type="capsule" size=".01"
fromto="0 0 0 0 0 .3"/><site pos="1 0 0"/><joint pos="0 0 1" axis="1 0 0"/></default></default>
<asset><mesh name="m" vertex="1 0 0 2 0 0 0 1 0 0 0 3"/></asset><worldbody>
<frame pos="0 0 3"><geom size=".1"/></frame><body name="a"><freejoint/><geom size=".1"/>
<frame pos="1 0 0" euler="0 0 70" childclass="c"><geom/><geom class="main" size=".1"/>
  <geom type="mesh" mesh="m" pos="0 1 0" euler="10 20 30" class="main"/>
  <site name="s"/><camera pos="0 0 1" xyaxes="0 1 0 0 0 1"/><light pos="0 1 1" dir="1 0 0"/>
  <body name="b" pos="0 1 0" euler="5 0 0"><frame euler="0 30 0"><joint name="j"/></frame>
    <geom fromto="0 0 0 0 1 0"/><frame pos="0 0 1"><body name="d"><geom/></body></frame></body>
  <frame pos="0 0 2" axisangle="0 1 0 40"><body name="e"><geom/></body></frame></frame></body>
<replicate count="2" offset=".1 0 0" euler="0 0 10"><geom size=".01"/></replicate>
</worldbody></mujoco>"""


def test_every_part_of_a_frame_keeps_its_place():
    before = mujoco.MjModel.from_xml_string(FRAMES)
    document = Work(ET.fromstring(FRAMES))  # noqa: S314  # the text is above

    expand(document)
    after = mujoco.MjModel.from_xml_string(document.text)

    assert "<frame" not in document.text
    for kind in ("body", "geom", "site", "cam"):
        for part in ("pos", "quat"):
            old, new = (getattr(model, f"{kind}_{part}") for model in (before, after))
            assert np.allclose(old, new, atol=1e-5), (kind, part)
    for name in ("jnt_pos", "jnt_axis", "light_pos", "light_dir", "geom_size", "geom_type"):
        assert np.allclose(getattr(before, name), getattr(after, name), atol=1e-5), name


@pytest.mark.parametrize("keyframe", ["", "<keyframe><key name='home' qpos='{}'/></keyframe>"])
def test_limbs_in_frames_are_driven_named_and_started_in_a_keyframe(keyframe: str):
    legs = f'<frame pos="0 .1 .01" euler="0 0 5">{LEGS}</frame>'
    pose = "0 0 .4 1 0 0 0 .3 -.3"
    robot = robot_of(mjcf(legs=legs, motors=MOTORS, more=keyframe.format(pose)))

    assert robot.anatomy.hinges == ("left_hip", "right_hip")
    assert "<frame" not in robot.mjcf
