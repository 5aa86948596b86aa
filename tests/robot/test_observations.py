"""Promises of the observations of tasks: those of dm_control, wherever a policy runs."""

from pathlib import Path

import numpy as np
import pytest

from selfmodel import tasks
from selfmodel.arguments import read_controller
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT
from selfmodel.physical.environment import EnvironmentRobot
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.observations import (
    OBSERVATIONS,
    observation_of,
    observation_source,
    observation_width,
)
from selfmodel.simulation.rollout import RobotBatch
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import suite_bodies

SUPPORTED = [parts for parts in suite_bodies.BODIES if observation_of(suite_bodies.name(*parts))]


def flat(observation: dict) -> np.ndarray:
    return np.concatenate([np.ravel(part) for part in observation.values()])


def task_policy(folder: Path, body: str, seed: int = 0) -> Path:
    """Writes a random linear policy of a body's task."""
    robot = tasks.entry(body).robot()
    width = observation_width(observation_of(body), robot.model)
    rng, motors = np.random.default_rng(seed), len(robot.anatomy.motors)
    weights = 0.1 * rng.standard_normal((motors, width))
    np.savez(folder / "net.npz", weight0=weights, bias0=0.1 * rng.standard_normal(motors))
    text = 'network = "net.npz"\nlast = "Tanh"\n[[observation]]\nterm = "task"\n'
    (path := folder / "policy.toml").write_text(text)
    return path


def test_six_domains_have_an_observation():
    assert {domain for domain, _ in SUPPORTED} == {
        *("walker", "cheetah", "hopper", "quadruped", "humanoid", "fish")
    }
    assert observation_of("suite-humanoid-run_pure_state") == ""
    assert {observation_of("quadruped"), observation_of("my-walker")} == {""}


@pytest.mark.parametrize("parts", SUPPORTED, ids="-".join)
def test_an_observation_of_many_states_is_dm_controls(parts: tuple[str, str]):
    robot, states = suite_bodies.robot(*parts), 4
    make, task = suite_bodies.episode_parts(*parts)
    physics, rng, model = make(robot.model), np.random.default_rng(3), robot.model
    variant = Simulator(robot)._variant(INTACT)
    batch = RobotBatch(model, [variant] * states, 1)
    observe = observation_source(observation_of(robot.name), model)(batch.bind)
    rows = []
    for row in range(states):
        physics.reset()
        physics.data.qpos[:] += rng.normal(0, 0.3, model.nq)
        for name in ("qvel", "act", "ctrl"):
            getattr(physics.data, name)[:] = rng.uniform(-1, 1, getattr(physics.data, name).size)
        for name in ("qpos", "qvel", "act", "ctrl"):
            batch.bind(name)[row] = getattr(physics.data, name)
        physics.forward()
        rows.append(flat(task.get_observation(physics)))
    batch.forward()

    # dm_control turns points by BLAS, whose last bit depends on the processor.
    atol = 1e-15 if parts[0] in ("humanoid", "fish") else 0
    np.testing.assert_allclose(observe(), rows, rtol=0, atol=atol)


@pytest.mark.parametrize("body", ["suite-walker-walk", "suite-hopper-hop", "suite-fish-upright"])
def test_a_policy_of_a_task_is_driven_as_in_dm_control(body: str, tmp_path: Path):
    """In the simulator, as a simulated physical robot, and in an environment of the suite."""
    robot, steps = tasks.entry(body).robot(), 8
    controller = read_controller(task_policy(tmp_path, body), robot)
    simulated = Simulator(robot, 1).run([(INTACT, controller)] * 3, steps, ["commands"])
    commands = simulated.trajectory["commands"]
    own = suite_bodies.suite_robot(*body.split("-")[1:], robot, INTACT)
    assert isinstance(own, EnvironmentRobot)
    there, physical = (
        np.array([sample.values["commands"] for sample in one.run(controller, steps)])
        for one in (own, SimulatedRobot(robot))
    )

    np.testing.assert_array_equal(commands[0], commands[2])
    np.testing.assert_array_equal(physical, commands[0])
    np.testing.assert_allclose(there, commands[0], atol=1e-8)
    assert np.ptp(commands[0], axis=0).max() > 0.01


def test_a_robot_without_the_observation_is_refused(tmp_path: Path):
    walker, hexapod = (tasks.entry(name).robot() for name in ("suite-walker-walk", "hexapod"))
    path = task_policy(tmp_path, walker.name)
    with pytest.raises(InputError, match=r"hexapod is no body .*give task = one of walker"):
        read_controller(path, hexapod)
    path.write_text('task = "humanoid"\n' + path.read_text())
    with pytest.raises(InputError, match=r"has no observation of humanoid.*torso"):
        read_controller(path, hexapod)
    path.write_text(path.read_text().replace("humanoid", "walkr"))
    with pytest.raises(InputError, match=r"unknown observation of a task 'walkr'.*walker"):
        read_controller(path, walker)


def test_an_environment_that_lacks_the_observation_is_refused(tmp_path: Path):
    body = "suite-walker-walk"
    robot = tasks.entry(body).robot()
    controller = read_controller(task_policy(tmp_path, body), robot)
    env = tasks.load("suite-walker", "walk")
    physical = EnvironmentRobot(env, robot, observe=lambda _: {"base_position": np.zeros(3)})
    with pytest.raises(InputError, match=r"expected 24 numbers as task:walker .* observe= return"):
        list(physical.run(controller, 2))


def test_every_observation_is_of_a_body():
    keys = {observation_of(suite_bodies.name(*parts)) for parts in SUPPORTED}
    assert keys == OBSERVATIONS.keys()
