"""Promises of replay: the same bits where it is the same, and an honest word where it is not."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from dm_control import suite

import selfmodel
from selfmodel.controllers.controller import CommandSource
from selfmodel.controllers.playback import Playback
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.logs import read_log
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.robots import robot_of
from selfmodel.logs.writer import write_trial
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.simulation.trial_replay import Replay, replay
from selfmodel.tasks import ROBOTS
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.command import refused, succeeds
from tests.helpers.drivers import random_controllers, random_cpgs, random_of
from tests.helpers.hostile import lacking, with_value

TRUTH = "jam:back_left_knee"
OF_0_1 = '<custom><numeric name="selfmodel_hidden_neurons" data="5"/></custom>'
"""Custom numeric of the models of version 0.1."""


def logged(folder: Path, robot: Robot, truth: str, driver: CommandSource, steps: int = 100) -> Path:
    """Logs a trial of a robot with something wrong."""
    plan = TrialPlan("trial", "single", driver, steps, 0)
    samples = SimulatedRobot(robot, parse(truth, robot.anatomy)).run(driver, steps)
    return write_trial(folder / "trial.mcap", robot, plan, samples, TrialHeader(Settings()))


def replayed(path: Path, truth: str, threads: int = 1) -> Replay:
    """The replay of a log by the robot in it."""
    log = read_log(path)
    robot = robot_of(log)
    return replay(log.trial, parse(truth, robot.anatomy), Simulator(robot, threads))


@pytest.mark.parametrize(("name", "first"), [("quadruped", 0), ("hexapod", 1)])
def test_every_second_case_replays_to_the_bit_from_its_log_alone(
    name: str, first: int, tmp_path: Path
):
    entry = ROBOTS[name]
    robot = entry.robot()
    for case, truth in list(entry.cases.items())[first::2]:
        steps = 200 if case == 1 else 30
        (controller,) = random_controllers(robot, 1, seed=case)
        found = replayed(logged(tmp_path, robot, truth, controller, steps), truth, 1 + case % 2)

        assert found.identical, case
        assert found.first_divergence_step is None
        assert all(found.rms(signal) == 0 for signal in SIGNALS)
        (tmp_path / "trial.mcap").unlink()


def test_a_trial_that_oscillators_drove_replays_to_the_bit(quadruped: Robot, tmp_path: Path):
    truth = "break:front_left_knee+sensor:back_right_touch"
    (driver,) = random_cpgs(quadruped, 1)
    path = logged(tmp_path, quadruped, truth, driver)

    assert read_log(path).trial.plan.controller == driver
    assert replayed(path, truth, 2).identical


@pytest.mark.parametrize("text", ["jam:front_left_knee=0.5", "encoder-offset:front_left_knee=0.3"])
def test_a_hypothesis_that_moves_the_pose_or_an_encoder_begins_in_its_own_pose(
    quadruped: Robot, tmp_path: Path, text: str
):
    path = logged(tmp_path, quadruped, "intact", random_cpgs(quadruped, 1)[0], 30)
    found = replayed(path, text)

    assert not found.from_log
    assert found.first_divergence_step == 0


@pytest.mark.parametrize("numeric", ["", OF_0_1], ids=["", "of version 0.1"])
def test_a_trial_of_a_larger_network_replays_to_the_bit_with_its_neurons(
    quadruped: Robot, tmp_path: Path, numeric: str
):
    mjcf = quadruped.mjcf.replace("</mujoco>", f"{numeric}</mujoco>")
    (controller,) = random_of(network_for(quadruped, 5), 1)
    path = logged(tmp_path, dataclasses.replace(quadruped, mjcf=mjcf), "neuron:4", controller)
    log = read_log(path)

    assert ("selfmodel_hidden_neurons" in robot_of(log).mjcf) == bool(numeric)
    assert log.trial.plan.controller == controller
    assert replayed(path, "neuron:4").identical
    assert not replayed(path, "intact").identical


@pytest.fixture(scope="module")
def trial(quadruped: Robot, tmp_path_factory: pytest.TempPathFactory) -> Trial:
    (controller,) = random_controllers(quadruped, 1, seed=3)
    return read_log(logged(tmp_path_factory.mktemp("trial"), quadruped, TRUTH, controller)).trial


def compared(robot: Robot, trial: Trial, truth: str = TRUTH, tolerance: float = 0.0) -> Replay:
    return replay(trial, parse(truth, robot.anatomy), Simulator(robot, 1), tolerance)


def test_a_wrong_hypothesis_parts_from_the_trial_at_a_step(quadruped: Robot, trial: Trial):
    found = compared(quadruped, trial, "intact")

    assert not found.identical
    step = found.first_divergence_step
    assert step is not None
    assert all(np.all(found.errors[signal][:step] == 0) for signal in SIGNALS)
    assert any(found.errors[signal][step] > 0 for signal in SIGNALS)
    difference = found.simulated["base_position"] - trial.trajectory["base_position"]
    assert found.rms("base_position") == pytest.approx(np.sqrt(np.mean(difference**2)))
    assert found.rms("base_position", slice(step)) == 0


def test_the_last_bit_of_one_number_is_noticed_and_a_tolerance_forgives_it(
    quadruped: Robot, trial: Trial
):
    number = trial.trajectory["joint_positions"][50, 3]
    other = with_value(trial, "joint_positions", 50, 3, np.nextafter(number, 1))
    strict, lenient = (compared(quadruped, other, tolerance=own) for own in (0.0, 1e-6))

    assert (strict.identical, strict.first_divergence_step) == (False, 50)
    assert (lenient.identical, lenient.first_divergence_step) == (False, None)
    # Minus zero is another number to the bit.
    assert trial.trajectory["base_position"][0, 1] == 0
    signed = compared(quadruped, with_value(trial, "base_position", 0, 1, -0.0))
    assert (signed.identical, signed.first_divergence_step) == (False, None)


def test_what_was_not_observed_is_not_compared(quadruped: Robot, trial: Trial):
    lost = lacking(trial, ("joint_velocities",), slice(40, 60))
    found = compared(quadruped, with_value(lost, "joint_velocities", slice(None), 2, np.nan))

    assert found.identical
    assert found.rms("joint_velocities") == 0
    assert np.isnan(found.rms("joint_velocities", slice(40, 60)))


def test_recorded_commands_move_the_robot_as_its_controller_did(
    quadruped: Robot, trial: Trial, tmp_path: Path
):
    driver = Playback(quadruped.anatomy.motors, trial.trajectory["commands"])
    path = logged(tmp_path, quadruped, TRUTH, driver)
    trajectory = read_log(path).trial.trajectory

    for signal in set(SIGNALS) - {"sensors"}:
        assert trajectory[signal].tobytes() == trial.trajectory[signal].tobytes()
    assert replayed(path, TRUTH).identical


def test_nothing_observed_is_not_identical(quadruped: Robot, tmp_path: Path):
    (controller,) = random_controllers(quadruped, 1)
    plan = TrialPlan("trial", "single", controller, 20, 0)
    nothing = (
        dataclasses.replace(
            sample, values={s: np.full_like(v, np.nan) for s, v in sample.values.items()}
        )
        for sample in SimulatedRobot(quadruped).run(controller, 20)
    )
    path = write_trial(tmp_path / "t.mcap", quadruped, plan, nothing, TrialHeader(Settings()))
    found = replay(read_log(path).trial, INTACT, Simulator(quadruped, 1))

    assert not found.observed
    assert not found.identical
    assert "nothing was observed" in repr(found)
    said = "nothing was observed: every number of the log is NaN"
    refused("replay", str(path), said=said, cwd=tmp_path)


@pytest.mark.parametrize("domain", ["walker", "quadruped"])
def test_an_episode_with_a_random_start_is_replayed_from_its_first_state(
    domain: str, tmp_path: Path
):
    robot = selfmodel.load_robot(f"suite-{domain}-walk")
    rest = [0.0] * len(robot.anatomy.motors)
    env = suite.load(domain, "walk", {"random": 1})
    path = tmp_path / "episode.mcap"
    trial = selfmodel.record(env, lambda _: rest, path, robot=robot, steps=30)
    found = replayed(path, "intact")

    assert found.from_log
    assert found.rms("joint_positions") < 1e-9
    assert found.rms("base_position") < 1e-9
    said = succeeds("replay", "episode.mcap", cwd=tmp_path).stdout
    assert "began in another pose than the model does" in said
    signals = {"base_linear_velocity": np.full((30, 3), np.nan)}
    part = dataclasses.replace(trial, trajectory=trial.trajectory.with_signals(signals))
    assert not replay(part, INTACT, Simulator(robot, 1)).from_log
