"""Tests of the dm_control tasks: the checks of dm_control's own suite, and further ones.

They are parametrised over every task, with every failure of Table I and every environment.
"""

from collections.abc import Iterator
from functools import partial

import dm_env
import numpy as np
import pytest
from dm_control.rl import control
from dm_control.viewer import runtime
from dm_env import specs

from selfmodel import tasks
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import KINDS
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.model_variant import ModelVariant
from selfmodel.tasks import ALL_TASKS, ROBOTS

FASTEST = 50.0
"""Upper bound on the robots' speed, m/s."""

WORLDS = ("friction=0.4", "slope=0.17", "roughness=0.03", "wind=-5", "crosswind=3")
OTHERS = ("motor:{joint}=0.5+sensor:{sensor}=gain0.5", "jam:{joint}=0.2+slope=-0.1+friction=0.6")


def damages(domain: str) -> Iterator[str]:
    """The failures of Table I, every environment, and faults with severities in environments."""
    yield from ROBOTS[domain].cases.values()
    yield from WORLDS
    anatomy = ROBOTS[domain].robot().anatomy
    for text in OTHERS:
        yield text.format(joint=anatomy.joints[0].name, sensor=anatomy.sensors[0].name)


OWN_TASKS = [(domain, task) for domain, task in ALL_TASKS if domain in ROBOTS]
EVERY = [
    (domain, task, text)
    for first, (domain, task) in enumerate(OWN_TASKS)
    for number, text in enumerate(damages(domain))
    if number % len(OWN_TASKS) == first
]
"""Each damage on one of the robots."""

every_task = pytest.mark.parametrize(("domain", "task"), OWN_TASKS)
every_body = pytest.mark.parametrize(("domain", "task", "hypothesis"), EVERY)


def load(
    domain: str, task: str, hypothesis: str = "intact", limit: float = 0.1, **environment: object
) -> control.Environment:
    kwargs = {"hypothesis": hypothesis, "time_limit": limit, "random": 0}
    return tasks.load(domain, task, kwargs, environment)


def episodes(
    environment: control.Environment, count: int, seed: int = 0
) -> Iterator[dm_env.TimeStep]:
    """Every time step of some episodes with random actions in range."""
    rng, spec = np.random.default_rng(seed), environment.action_spec()
    for _ in range(count):
        step = environment.reset()
        yield step
        while not step.last():
            step = environment.step(rng.uniform(spec.minimum, spec.maximum))
            yield step


@every_body
def test_every_time_step_is_in_its_specs_and_the_same_to_the_bit_again(
    domain: str, task: str, hypothesis: str
):
    environment, again = (load(domain, task, hypothesis) for _ in range(2))
    expected = environment.observation_spec()
    steps = list(episodes(environment, 2))

    for step, other in zip(steps, episodes(again, 2), strict=True):
        assert (step.reward, step.discount) == (other.reward, other.discount)
        for name, values in step.observation.items():
            assert values.tobytes() == other.observation[name].tobytes(), name
    assert [step.step_type.name for step in steps] == 2 * ["FIRST", *["MID"] * 9, "LAST"]
    for step in steps:
        assert list(step.observation) == list(expected)
        for name, spec in expected.items():
            spec.validate(step.observation[name])
            assert step.observation[name].dtype == spec.dtype == np.float64
            assert np.isfinite(step.observation[name]).all(), name
        if step.first():
            assert (step.reward, step.discount) == (None, None)
            continue
        assert isinstance(step.reward, float)
        assert isinstance(step.discount, float)
        environment.reward_spec().validate(step.reward)
        environment.discount_spec().validate(step.discount)
        assert abs(step.reward) < FASTEST
        assert step.discount == 1  # an episode ends at the time limit only
        assert np.abs(step.observation["sensors"]).max() < 2  # touch is 0 or 1, angles nearly


def test_a_robot_may_have_a_fault_of_a_kind_of_ones_own():
    class Lighter(FaultKind):
        def apply(self, variant: ModelVariant, _anatomy: Anatomy, fault: Fault) -> None:
            variant.model.body_mass[1] *= fault.severity

    kind = Lighter(name="lighter", bounds=(0.1, 0.9), levels=(0.5,))
    robot = ROBOTS["quadruped"].robot()
    made = parse("lighter=0.5", robot.anatomy, (*KINDS.values(), kind))
    whole, light = (
        tasks.load("quadruped", "walk", {"hypothesis": one}).physics.model.body_mass
        for one in (INTACT, made)
    )

    np.testing.assert_array_equal(whole, robot.model.body_mass)
    assert light[1] == 0.5 * whole[1]


@every_task
def test_actions_are_the_motors_targets_in_their_range(domain: str, task: str):
    robot = ROBOTS[domain].robot()
    spec = load(domain, task).action_spec()

    assert isinstance(spec, specs.BoundedArray)
    assert (spec.shape, spec.dtype) == ((len(robot.anatomy.motors),), np.float64)
    np.testing.assert_array_equal(spec.minimum, robot.model.actuator_ctrlrange[:, 0])
    np.testing.assert_array_equal(spec.maximum, robot.model.actuator_ctrlrange[:, 1])
    assert np.all(spec.minimum < spec.maximum)
    assert np.isfinite([spec.minimum, spec.maximum]).all()


@every_task
def test_the_time_limit_ends_an_episode_and_none_never_does(domain: str, task: str):
    environment = load(domain, task, limit=0.05)
    control_timestep = ROBOTS[domain].robot().control_timestep

    assert environment.control_timestep() == pytest.approx(control_timestep)
    lengths = [len(list(episodes(load(domain, task, limit=t), 1))) - 1 for t in (0.05, 0.2)]
    assert lengths == [round(t / control_timestep) for t in (0.05, 0.2)]
    steps = list(episodes(environment, 1))
    assert steps[-1].last()
    assert environment.step(
        np.zeros(environment.action_spec().shape)
    ).first()  # starts a new episode
    endless = load(domain, task, limit=float("inf"))
    endless.reset()
    action = np.zeros(endless.action_spec().shape)
    assert endless._step_limit == float("inf")
    assert not endless.step(action).last()


@every_task
def test_the_suites_own_arguments_are_taken_by_place_and_by_name(domain: str, task: str):
    environment = tasks.load(domain, task, {"time_limit": 0.02}, None, False)
    by_name = tasks.load(domain_name=domain, task_name=task, visualize_reward=False)

    assert len(list(episodes(environment, 1))) == 3
    assert by_name.task.visualize_reward is False
    with pytest.raises(InputError, match="the reward is a speed and has no colours"):
        tasks.load(domain, task, visualize_reward=True)


@pytest.mark.parametrize(("domain", "task", "hypothesis"), EVERY[:1])
def test_the_viewers_runtime_runs_episodes(domain: str, task: str, hypothesis: str):
    """Runs the steps of ``dm_control.viewer.launch`` without a window."""
    environment = partial(load, domain, task, hypothesis, limit=0.06)()
    viewed = runtime.Runtime(environment, policy=None)
    errors: list[object] = []
    viewed.on_error += errors.append
    viewed.tick(0.03, paused=True)
    assert viewed.get_time() == 0
    for _ in range(4):
        viewed.tick(0.03, paused=False)
    assert viewed.state is runtime.State.STOPPED  # at the time limit
    assert viewed.get_time() == pytest.approx(0.06)
    viewed.restart()
    viewed.tick(0.01, paused=False)
    viewed.single_step()
    assert viewed.state is runtime.State.RUNNING
    assert errors == []
