"""Tests of the walking task and its robots: the checks of dm_control's suite, with damage."""

from collections.abc import Iterator

import dm_env
import numpy as np
import pytest
from dm_control.rl import control
from dm_control.viewer import runtime
from dm_env import specs

from selfmodel import tasks
from selfmodel.controllers.controller import Controller
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import KINDS
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.designs import network_for
from selfmodel.robot.model_variant import ModelVariant
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import ROBOTS

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


EVERY = [
    (domain, text)
    for first, domain in enumerate(ROBOTS)
    for number, text in enumerate(damages(domain))
    if number % len(ROBOTS) == first
]
"""Each damage on one of the robots."""


def load(domain: str, hypothesis: str = "intact", limit: float = 0.1) -> control.Environment:
    return tasks.load(domain, "walk", {"hypothesis": hypothesis, "time_limit": limit, "random": 0})


def episodes(environment: control.Environment, count: int) -> Iterator[dm_env.TimeStep]:
    """Every time step of some episodes with random actions in range."""
    rng, spec = np.random.default_rng(0), environment.action_spec()
    for _ in range(count):
        step = environment.reset()
        yield step
        while not step.last():
            step = environment.step(rng.uniform(spec.minimum, spec.maximum))
            yield step


@pytest.mark.parametrize(("domain", "hypothesis"), EVERY)
def test_every_time_step_is_in_its_specs_and_the_same_to_the_bit_again(
    domain: str, hypothesis: str
):
    environment, again = (load(domain, hypothesis) for _ in range(2))
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


@pytest.mark.parametrize("domain", ROBOTS)
def test_actions_are_the_motors_targets_in_their_range(domain: str):
    robot = ROBOTS[domain].robot()
    spec = load(domain).action_spec()

    assert isinstance(spec, specs.BoundedArray)
    assert (spec.shape, spec.dtype) == ((len(robot.anatomy.motors),), np.float64)
    np.testing.assert_array_equal(spec.minimum, robot.model.actuator_ctrlrange[:, 0])
    np.testing.assert_array_equal(spec.maximum, robot.model.actuator_ctrlrange[:, 1])


def test_the_time_limit_ends_an_episode_and_none_never_does():
    environment = load("quadruped", limit=0.05)
    steps = list(episodes(environment, 1))

    assert environment.control_timestep() == pytest.approx(0.01)
    assert len(steps) == 6
    assert steps[-1].last()
    assert environment.step(np.zeros(8)).first()  # starts a new episode
    assert load("quadruped", limit=float("inf"))._step_limit == float("inf")


def test_the_suites_own_arguments_are_taken_by_place_and_by_name():
    environment = tasks.load("quadruped", "walk", {"time_limit": 0.02}, None, False)
    by_name = tasks.load(domain_name="quadruped", task_name="walk", visualize_reward=False)

    assert len(list(episodes(environment, 1))) == 3
    assert by_name.task.visualize_reward is False
    with pytest.raises(InputError, match="the reward is a speed and has no colours"):
        tasks.load("quadruped", "walk", visualize_reward=True)


def test_the_viewers_runtime_runs_episodes():
    """Runs the steps of ``dm_control.viewer.launch`` without a window."""
    viewed = runtime.Runtime(load("quadruped", "slope=0.1", limit=0.06), policy=None)
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


STANDING_DRIFT = 0.05
"""Maximum drift of a standing robot in one run, m."""


def test_its_parts_are_named_for_their_limbs(robot: Robot):
    legs = {
        joint.name.removesuffix("_knee") for joint in robot.anatomy.joints if "knee" in joint.name
    }

    assert len(legs) == {"quadruped": 4, "hexapod": 6}[robot.name]
    proximal = {"quadruped": "shoulder", "hexapod": "hip"}[robot.name]
    assert {joint.name for joint in robot.anatomy.joints} == {
        f"{leg}_{part}" for leg in legs for part in (proximal, "knee")
    }
    assert {sensor.name for sensor in robot.anatomy.sensors} == {
        f"{leg}_{kind}" for leg in legs for kind in ("touch", "angle")
    }


def test_its_joints_flex_and_extend_thirty_degrees(robot: Robot):
    for joint in robot.anatomy.joints:
        np.testing.assert_allclose(joint.limits, [[-np.pi / 6, np.pi / 6]] * len(joint.limits))


def test_told_to_stand_it_stands(robot: Robot):
    still = Controller(network_for(robot), np.zeros(network_for(robot).weights))
    path = Simulator(robot, 1).run(
        [(parse("intact", robot.anatomy), still)], 1000, ["base_position"]
    )
    position = path.trajectory["base_position"][0]
    drift = np.linalg.norm(position[:, :2] - position[0, :2], axis=1)

    assert not path.diverged.any()
    assert drift.max() < STANDING_DRIFT
    assert position[:, 2].min() > 0.8 * robot.standing_height
