"""Promises of replay: the same bits where it is the same, and an honest word where it is not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

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
from selfmodel.simulation.trial_replay import replay
from selfmodel.tasks import ROBOTS
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.command import selfmodel
from tests.helpers.drivers import random_controllers, random_cpgs, random_of

STEPS = 1000


def logged(folder: Path, robot: Robot, truth: str, driver: CommandSource) -> Path:
    """Logs a trial of a robot with something wrong."""
    plan = TrialPlan("trial", "single", driver, STEPS, 0)
    samples = SimulatedRobot(robot, parse(truth, robot.anatomy)).run(driver, STEPS)
    path = folder / "trial.mcap"
    return write_trial(path, robot, plan, samples, TrialHeader(Settings()))


@pytest.mark.parametrize("name", sorted(ROBOTS))
@pytest.mark.parametrize("case", range(1, 11))
def test_every_case_replays_to_the_bit_from_its_log_alone(name: str, case: int, tmp_path: Path):
    entry = ROBOTS[name]
    made = entry.robot()
    (controller,) = random_controllers(made, 1, seed=case)
    log = read_log(logged(tmp_path, made, entry.cases[case], controller))
    robot = robot_of(log)
    truth = parse(entry.cases[case], robot.anatomy)
    for threads in (1, 2):
        found = replay(log.trial, truth, Simulator(robot, threads))

        assert found.identical
        assert found.first_divergence_step is None
        assert all(found.rms(signal) == 0 for signal in SIGNALS)


@pytest.mark.parametrize("truth", ["intact", "break:front_left_knee+sensor:back_right_touch"])
def test_a_trial_that_oscillators_drove_replays_to_the_bit(
    robot: Robot, truth: str, tmp_path: Path
):
    (driver,) = random_cpgs(robot, 1)
    log = read_log(logged(tmp_path, robot, truth, driver))
    hypothesis = parse(truth, robot.anatomy)

    assert log.trial.plan.controller == driver
    assert replay(log.trial, hypothesis, Simulator(robot_of(log), 2)).identical


def test_a_trial_of_a_larger_network_replays_to_the_bit_with_its_neurons(
    quadruped: Robot, tmp_path: Path
):
    (controller,) = random_of(network_for(quadruped, 5), 1)
    log = read_log(logged(tmp_path, quadruped, "neuron:4", controller))
    robot = robot_of(log)

    assert log.trial.plan.controller.design.hidden == 5
    assert replay(log.trial, parse("neuron:4", robot.anatomy), Simulator(robot, 1)).identical
    assert not replay(log.trial, INTACT, Simulator(robot, 1)).identical


@pytest.fixture(scope="module")
def trial(quadruped: Robot, tmp_path_factory: pytest.TempPathFactory) -> Trial:
    (controller,) = random_controllers(quadruped, 1, seed=3)
    folder = tmp_path_factory.mktemp("trial")
    return read_log(logged(folder, quadruped, "jam:back_left_knee", controller)).trial


def test_a_wrong_hypothesis_parts_from_the_trial_and_is_told_where(quadruped: Robot, trial: Trial):
    found = replay(trial, INTACT, Simulator(quadruped, 2))

    assert not found.identical
    step = found.first_divergence_step
    assert step is not None
    assert all(np.all(found.errors[signal][:step] == 0) for signal in SIGNALS)
    assert any(found.errors[signal][step] > 0 for signal in SIGNALS)
    difference = found.simulated["base_position"] - trial.behaviour["base_position"]
    assert found.rms("base_position") == pytest.approx(np.sqrt(np.mean(difference**2)))
    assert found.rms("base_position", slice(step)) == 0


def test_the_last_bit_of_one_number_is_noticed_and_a_tolerance_forgives_it(
    quadruped: Robot, trial: Trial
):
    behaviour = trial.behaviour
    values = behaviour["joint_positions"].copy()
    values[500, 3] = np.nextafter(values[500, 3], 1)
    changed = changed_trial(trial, "joint_positions", values)
    truth = parse("jam:back_left_knee", quadruped.anatomy)
    strict = replay(changed, truth, Simulator(quadruped, 2))
    lenient = replay(changed, truth, Simulator(quadruped, 2), tolerance=1e-6)

    assert (strict.identical, strict.first_divergence_step) == (False, 500)
    assert (lenient.identical, lenient.first_divergence_step) == (False, None)


def test_what_was_not_observed_is_not_compared(quadruped: Robot, trial: Trial):
    values = trial.behaviour["joint_velocities"].copy()
    values[100:200] = np.nan
    values[:, 2] = np.nan
    changed = changed_trial(trial, "joint_velocities", values)
    found = replay(changed, parse("jam:back_left_knee", quadruped.anatomy), Simulator(quadruped, 2))

    assert found.identical
    assert found.rms("joint_velocities") == 0
    assert np.isnan(found.rms("joint_velocities", slice(100, 200)))


def test_minus_zero_is_another_number_to_the_bit(quadruped: Robot, trial: Trial):
    values = trial.behaviour["base_position"].copy()
    values[0, 1] = -0.0
    assert trial.behaviour["base_position"][0, 1] == 0
    found = replay(
        changed_trial(trial, "base_position", values),
        parse("jam:back_left_knee", quadruped.anatomy),
        Simulator(quadruped, 2),
    )

    assert not found.identical
    assert found.first_divergence_step is None


def changed_trial(trial: Trial, signal: str, values: np.ndarray) -> Trial:
    """A trial with another signal in the place of one."""
    behaviour = trial.behaviour
    signals = {**behaviour.signals, signal: values}
    return Trial(
        trial.plan, trial.robot, Behaviour(behaviour.names, behaviour.time, signals), trial.path
    )


def test_recorded_commands_move_the_robot_as_its_controller_did(
    quadruped: Robot, trial: Trial, tmp_path: Path
):
    driver = Playback(quadruped.anatomy.motors, trial.behaviour["commands"])
    log = read_log(logged(tmp_path, quadruped, "jam:back_left_knee", driver))

    assert log.trial.plan.controller == driver
    for signal in set(SIGNALS) - {"sensors"}:
        assert log.trial.behaviour[signal].tobytes() == trial.behaviour[signal].tobytes()
    truth = parse("jam:back_left_knee", quadruped.anatomy)
    assert replay(log.trial, truth, Simulator(robot_of(log), 2)).identical


def test_nothing_observed_is_not_identical(quadruped: Robot, tmp_path: Path):
    (controller,) = random_controllers(quadruped, 1)
    plan = TrialPlan("trial", "single", controller, 20, 0)
    samples = SimulatedRobot(quadruped).run(controller, 20)
    nothing = (
        replace(sample, values={s: np.full_like(v, np.nan) for s, v in sample.values.items()})
        for sample in samples
    )
    path = write_trial(tmp_path / "t.mcap", quadruped, plan, nothing, TrialHeader(Settings()))
    found = replay(read_log(path).trial, INTACT, Simulator(quadruped, 1))

    assert not found.observed
    assert not found.identical
    assert "nothing was observed" in repr(found)
    done = selfmodel("replay", str(path), cwd=tmp_path)
    assert done.returncode == 2
    assert "nothing was observed: every number of the log is NaN" in done.stderr
    assert not done.stdout
