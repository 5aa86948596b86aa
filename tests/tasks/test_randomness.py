"""Tests of seeds: one seed is one sequence of episodes, and all that is random follows from it."""

import numpy as np
import pytest
from dm_control.rl import control

from selfmodel import tasks
from selfmodel.errors import InputError
from selfmodel.simulation.domain import ANGLE_DEVIATION
from selfmodel.tasks.arguments import Seed

WALKER = ("suite-walker", "walk")
OWN = ("quadruped", "walk")
RANDOM = {
    "start noise": (*OWN, {"start_noise": 0.05}),
    "sensor noise": (*OWN, {"hypothesis": "sensor:front_left_angle=noise0.1"}),
    "gap and debris": (*OWN, {"gap": 0.05, "hypothesis": "break:front_left_knee"}),
    "start of the suite": (*WALKER, {}),
    "start of the suite, damaged": (*WALKER, {"hypothesis": "break:left_ankle"}),
    "start noise in the suite": (*WALKER, {"start_noise": 0.05}),
    "gap in the suite": (*WALKER, {"gap": 0.05}),
    "model of the suite": ("suite-lqr", "lqr_6_2", {}),
}
"""What is random, and a task with it."""

every = pytest.mark.parametrize(
    ("domain", "task", "kwargs"),
    [
        pytest.param(*what, id=name, marks=() if what[0] == OWN[0] else pytest.mark.bodies)
        for name, what in RANDOM.items()
    ],
)


def made(domain: str, task: str, kwargs: dict[str, object], seed: Seed) -> control.Environment:
    return tasks.load(domain, task, {**kwargs, "random": seed})


def episode(environment: control.Environment, steps: int = 2) -> bytes:
    """The observations and rewards of the first steps of the next episode."""
    step, seen = environment.reset(), []
    for _ in range(steps):
        seen += [np.asarray(values).tobytes() for values in step.observation.values()]
        step = environment.step(0.3 * np.ones(environment.action_spec().shape))
        seen.append(np.float64(step.reward).tobytes())
    return b"".join(seen)


@every
def test_one_seed_is_one_sequence_of_different_episodes(domain: str, task: str, kwargs: dict):
    first, second = (made(domain, task, kwargs, 1) for _ in range(2))
    episodes = [episode(first), episode(first)]

    assert episodes == [episode(second), episode(second)]
    assert episodes[0] != episodes[1]
    assert episodes[0] != episode(made(domain, task, kwargs, 2))
    assert episodes[0] == episode(made(domain, task, kwargs, np.random.RandomState(1)))


def test_a_generator_seeds_one_environment_after_the_other():
    one, other = np.random.default_rng(3), np.random.default_rng(3)
    firsts = [episode(made(*OWN, {"gap": 0.05}, rng)) for rng in (one, other)]

    assert firsts[0] == firsts[1] != episode(made(*OWN, {"gap": 0.05}, one))


@pytest.mark.bodies
def test_terrain_follows_the_seed_and_stays_for_all_episodes():
    kwargs = {"hypothesis": "roughness=0.03"}
    for domain, task in (OWN, WALKER):
        one, same, other = (made(domain, task, kwargs, seed) for seed in (1, 1, 2))
        heights = one.physics.model.hfield_data.copy()
        one.reset()

        assert len(heights) > 0
        assert heights.tobytes() == one.physics.model.hfield_data.tobytes()
        assert heights.tobytes() == same.physics.model.hfield_data.tobytes()
        assert heights.tobytes() != other.physics.model.hfield_data.tobytes()


def test_the_noise_of_the_start_has_its_standard_deviation():
    environment = made(*OWN, {"start_noise": 0.05}, 0)
    angles = np.array([environment.reset().observation["joint_positions"] for _ in range(40)])

    assert angles.std() == pytest.approx(0.05, rel=0.15)
    assert np.abs(angles.mean()) < 0.01


def test_a_gap_has_start_noise_unless_another_is_given():
    by_gap, none = (
        np.array([environment.reset().observation["base_height"] for _ in range(5)])
        for environment in (
            made(*OWN, {"start_noise": 0.05 * ANGLE_DEVIATION}, 0),
            made(*OWN, {"start_noise": 0.0}, 0),
        )
    )
    poses = made(*OWN, {"gap": 0.05, "start_noise": 0.0}, 0)
    data = poses.physics.data
    fixed = [poses.reset() and data.qpos.copy() for _ in range(2)]

    assert len(np.unique(none)) == 1 < len(np.unique(by_gap))
    np.testing.assert_array_equal(fixed[0], fixed[1])


def test_healthy_and_damaged_bodies_of_the_suite_start_alike():
    whole, damaged = (
        made(*WALKER, kwargs, 7) for kwargs in ({}, {"hypothesis": "motor:left_knee=0.5"})
    )
    for _ in range(2):
        whole.reset()
        damaged.reset()

        np.testing.assert_array_equal(whole.physics.data.qpos, damaged.physics.data.qpos)


def test_a_gap_delays_the_commands_by_as_many_steps_as_it_has_drawn():
    delays = set()
    for seed in range(16):
        environment = made(*OWN, {"gap": 0.05, "start_noise": 0.0}, seed)
        environment.reset()
        applied = []
        for _ in range(4):
            environment.step(np.full(environment.action_spec().shape, 0.3))
            applied.append(environment.physics.data.ctrl[0])
        assert sorted(applied) == applied
        delays.add(applied.index(0.3))

    assert delays == {0, 1, 2}


@pytest.mark.parametrize(("domain", "task"), [OWN, WALKER])
def test_a_level_out_of_range_is_refused(domain: str, task: str):
    with pytest.raises(InputError, match="expected a reality gap with a level from 0"):
        made(domain, task, {"gap": 0.6}, 0)
    for noise in (-0.1, 1.1, float("nan")):
        with pytest.raises(InputError, match="expected a start_noise from 0 to 1 rad"):
            made(domain, task, {"start_noise": noise}, 0)
