"""Promises of batched rewards and starts: those of dm_control's own tasks and episodes."""

import numpy as np
import pytest
from dm_control import suite

from selfmodel.robot.observations import Fields, observation_of, observation_source
from selfmodel.robot.state import bind_data
from selfmodel.tasks import suite_bodies
from selfmodel.tasks.rewards import Starts, reward_of

SUPPORTED = [parts for parts in suite_bodies.BODIES if observation_of(suite_bodies.name(*parts))]


@pytest.mark.parametrize("parts", SUPPORTED, ids="-".join)
def test_a_reward_is_dm_controls(parts: tuple[str, str]):
    robot, rng = suite_bodies.robot(*parts), np.random.default_rng(5)
    make, task = suite_bodies.episode_parts(*parts)
    physics, data = make(robot.model), None
    reward = reward_of(*parts)
    own, batched = [], []
    for _ in range(40):
        physics.reset()
        data = physics.data
        data.qpos[:] += rng.normal(0, 0.1, robot.model.nq)
        data.qvel[:] = rng.normal(0, 1, robot.model.nv)
        data.ctrl[:] = rng.uniform(-1, 1, robot.model.nu)
        physics.forward()
        own.append(task.get_reward(physics))
        fields = Fields(robot.model, bind_data(data.ptr))
        batched.append(reward(fields, data.ctrl[np.newaxis].copy())[0])

    np.testing.assert_allclose(batched, own, rtol=1e-12)
    assert np.ptp(own) > 1e-3


@pytest.mark.parametrize("parts", [("walker", "walk"), ("cheetah", "run"), ("fish", "swim")])
def test_a_start_is_that_of_the_suites_episode_with_the_seed(parts: tuple[str, str]):
    robot, seeds = suite_bodies.robot(*parts), np.array([7, 2**32 - 1])
    positions, velocities = Starts(*parts).draw(seeds)
    again, _ = Starts(*parts).draw(seeds[::-1])
    for seed, position, velocity in zip(seeds, positions, velocities, strict=True):
        env = suite.load(*parts, {"random": np.random.RandomState(seed)})
        expected = np.concatenate([np.ravel(one) for one in env.reset().observation.values()])
        physics = suite_bodies.episode_parts(*parts)[0](robot.model)
        with physics.reset_context():
            physics.data.qpos[:], physics.data.qvel[:] = position, velocity
        source = observation_source(observation_of(robot.name), robot.model)
        seen = source(bind_data(physics.data.ptr))()[0]
        np.testing.assert_allclose(seen, expected, atol=1e-12)
    np.testing.assert_array_equal(again, positions[::-1])
    assert not np.allclose(*positions)
