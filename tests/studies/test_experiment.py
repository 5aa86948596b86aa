"""Promises of an experiment: its score, by name and from files, and when a diagnosis is correct."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import selfmodel
from selfmodel.controllers.controller import Controller
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.logs.physical_trial import run_trial
from selfmodel.logs.records import TrialHeader
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.recovery.scores import ENERGY, UPRIGHT, Score, check_measurable, upright_within
from selfmodel.recovery.tracking import Reference
from selfmodel.robot.designs import cpg_for, network_for
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.studies.experiment import (
    ChosenScore,
    choose_score,
    is_correct,
    read_reference,
    simulated_reference,
)
from selfmodel.tasks import Entry
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.drivers import random_controllers, random_cpgs
from tests.helpers.memory import in_memory
from tests.helpers.robots.arms import arm


def chosen(name: str, robot: Robot, reference: Path | None = None, seed: int = 0) -> ChosenScore:
    entry = Entry(robot=lambda: robot)
    return choose_score(name, entry, cpg_for(robot), steps=30, seed=seed, reference=reference)


def test_without_a_reference_the_first_controller_follows_itself(quadruped: Robot):
    for robot in (arm(), quadruped):
        found = chosen("tracking", robot)
        run = Simulator(robot, 1).run([(INTACT, found.gait)], 30, found.score.record)
        assert found.score.of(robot, INTACT, run.trajectory)[0] == 0
    assert chosen("tracking", arm(), seed=1).gait != chosen("tracking", arm(), seed=2).gait


def test_a_first_controller_that_settles_in_a_pose_is_refused_with_the_remedy():
    with pytest.raises(InputError, match=r"no motion to follow: give --controller cpg"):
        choose_score(
            "tracking", Entry(robot=arm), network_for(arm()), steps=600, seed=0, reference=None
        )


def test_a_limit_is_that_of_its_quantity(quadruped: Robot):
    def name(**limits: float) -> str:
        entry = Entry(robot=lambda: quadruped)
        found = choose_score("upright", entry, cpg_for(quadruped), steps=30, seed=0, **limits)
        return found.score.name

    assert [name(max_speed=9), name(max_torque=8), name(max_self_collision=0)] == [
        *("upright within 9 rad/s", "upright within 8 N m"),
        "upright within 0 m of self-collision",
    ]


@pytest.mark.parametrize(
    ("name", "robot", "reference", "words"),
    [
        ("displacement", arm, None, "base of robot is fixed.*give --score tracking"),
        ("energy", arm, None, "base of robot is fixed.*give --score tracking"),
        ("upright", None, Path("walk.mcap"), "trajectory for --score tracking, got upright"),
        ("traking", None, None, "did you mean tracking"),
    ],
)
def test_a_score_that_a_robot_cannot_have_is_refused(
    name: str, robot: type | None, reference: Path | None, words: str, quadruped: Robot
):
    with pytest.raises(InputError, match=words):
        chosen(name, robot() if robot else quadruped, reference)


@pytest.mark.parametrize(
    "score",
    [
        *(upright_within(5), upright_within(max_torque=2), upright_within(max_self_collision=0.01)),
        *(ENERGY, dataclasses.replace(UPRIGHT, name="mine")),
    ],
)
def test_a_score_in_python_is_refused_by_what_it_needs_and_not_by_its_name(
    score: Score, tmp_path: Path
):
    physical = selfmodel.simulated_robot(arm())
    with pytest.raises(InputError, match=rf"base of robot is fixed, and the score {score.name}"):
        selfmodel.recover(physical, physical, arm(), tmp_path / "run", score=score)
    with pytest.raises(InputError, match="give --score tracking"):
        selfmodel.evolve(arm(), score=score)
    check_measurable(dataclasses.replace(score, needs_free_base=False), arm())
    assert not (tmp_path / "run").exists()


(DRIVER,) = random_cpgs(arm(), 1)


def same(first: Reference, second: Reference) -> bool:
    return (
        first.hinges == second.hinges
        and np.array_equal(first.time, second.time)
        and np.array_equal(first.positions, second.positions)
    )


def test_the_reference_of_a_log_is_the_motion_of_its_robot(tmp_path: Path):
    path = tmp_path / "walk.mcap"
    plan = TrialPlan("walk", "single", DRIVER, 40, seed=0)
    run_trial(SimulatedRobot(arm()), plan, path, arm(), TrialHeader(Settings()))
    assert same(read_reference(path, arm()), simulated_reference(arm(), DRIVER, 40))


@pytest.mark.process
def test_the_reference_of_a_table_has_its_joints_from_its_first_time_on(tmp_path: Path):
    wanted = simulated_reference(arm(), DRIVER, 40)
    path = tmp_path / "walk.npz"
    joints = dict(zip(wanted.hinges, wanted.positions.T, strict=True))
    np.savez(path, time=wanted.time, **joints, temperature=np.ones(40))
    assert same(read_reference(path, arm()), wanted)
    csv = tmp_path / "part.csv"
    csv.write_text("time,joint2,other\n5.0,0.5,1\n5.5,0.75,2\n")
    part = read_reference(csv, arm())
    assert (part.hinges, part.time.tolist()) == (("joint2",), [0.0, 0.5])
    assert part.positions.tolist() == [[0.5], [0.75]]


@pytest.mark.process
@pytest.mark.parametrize(
    ("name", "text", "sentence"),
    [
        ("a.csv", "t,joint2\n0,0\n1,0\n", "expected a column time.*got t, joint2: rename"),
        ("a.csv", "time,elbow\n0,0\n1,0\n", "names of joints of robot.*got time, elbow"),
        ("a.csv", "time,joint2\n1,0\n0,0\n", "a.csv: the time .* strictly increasing"),
        ("a.txt", "", "expected a log .* or a table"),
    ],
)
def test_a_file_that_is_no_reference_is_refused(
    tmp_path: Path, name: str, text: str, sentence: str
):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InputError, match=sentence):
        read_reference(path, arm())


def test_a_diagnosis_is_correct_if_it_cannot_be_told_from_the_truth(quadruped: Robot):
    def logged(controller: Controller) -> Trial:
        physical = SimulatedRobot(quadruped, truth)
        return in_memory(quadruped)(physical, TrialPlan("t", "after", controller, 300, 0))

    design, truth = network_for(quadruped), parse("neuron:0", quadruped.anatomy)
    (awake,) = random_controllers(quadruped, 1)
    deaf, simulator = Controller(design, np.zeros(design.weights)), Simulator(quadruped, 2)

    asleep = [logged(deaf)]
    assert is_correct(INTACT, truth, asleep, simulator)  # its neurons do nothing anyway
    assert not is_correct(INTACT, truth, [*asleep, logged(awake)], simulator)
    assert is_correct(truth, truth, [logged(awake)], simulator)
