"""Tests of the suite's tasks on damaged bodies: observations and rewards are the suite's."""

import numpy as np
import pytest
from dm_control import suite
from dm_control.rl import control

from selfmodel import tasks
from selfmodel.errors import InputError
from selfmodel.robot.mujoco_errors import loading_a_model
from selfmodel.tasks import entry, suite_bodies, suite_tasks

FAST = (("walker", "walk"), ("reacher", "easy"))
EVERY = [
    pytest.param(domain, task, marks=() if (domain, task) in FAST else pytest.mark.bodies)
    for domain, own in suite_tasks.TASKS.items()
    for task in own[:1]
]
"""A task of every domain."""


def own_environment(domain: str, task: str, seed: int = 3) -> control.Environment:
    with loading_a_model():
        return suite.load(domain, task, {"random": seed})


def a_damage(domain: str, task: str) -> str:
    """A broken and a jammed joint, or other ground if the body has no such joints."""
    anatomy = suite_tasks._anatomy(domain, task, own_environment(domain, task).physics.model.ptr)
    if len(anatomy.joints) > 1:
        return f"break:{anatomy.joints[-1].name}+jam:{anatomy.joints[0].name}"
    return "wind=5"


def test_every_task_of_the_suite_is_there():
    listed = {(domain, task) for domain, own in suite_tasks.TASKS.items() for task in own}

    assert listed == set(suite.ALL_TASKS)
    assert {(f"suite-{domain}", task) for domain, task in listed} < set(tasks.ALL_TASKS)


@pytest.mark.parametrize(("domain", "task"), FAST)
def test_a_healthy_body_has_the_suites_own_episodes(domain: str, task: str):
    expected, got = (
        own_environment(domain, task),
        tasks.load(f"suite-{domain}", task, {"random": 3}),
    )
    spec = expected.action_spec()
    rng = np.random.default_rng(0)
    for _ in range(2):
        steps = [expected.reset(), got.reset()]
        for _ in range(3):
            for name, values in steps[0].observation.items():
                np.testing.assert_array_equal(steps[1].observation[name], values, name)
            assert steps[0].reward == steps[1].reward
            action = np.clip(rng.standard_normal(spec.shape), spec.minimum, spec.maximum)
            steps = [expected.step(action), got.step(action)]


@pytest.mark.parametrize(("domain", "task"), EVERY)
def test_a_damaged_body_is_in_the_suites_specs(domain: str, task: str):
    damage = a_damage(domain, task)
    healthy = own_environment(domain, task)
    environment = tasks.load(
        f"suite-{domain}", task, {"random": 3, "hypothesis": damage, "time_limit": 0.2}
    )
    observations, actions = environment.observation_spec(), environment.action_spec()
    rng = np.random.default_rng(0)

    changed = [
        name
        for name in ("body_mass", "dof_armature")
        if not np.array_equal(
            getattr(environment.physics.model, name), getattr(healthy.physics.model, name)
        )
    ]

    assert changed == ([] if damage == "wind=5" else ["body_mass", "dof_armature"])
    assert abs(environment.physics.model.opt.wind[0]) == (5 if damage == "wind=5" else 0)
    assert observations == healthy.observation_spec()
    assert actions == healthy.action_spec()
    assert environment.control_timestep() == pytest.approx(healthy.control_timestep())
    step, steps = environment.reset(), 0
    while not step.last():
        step = environment.step(
            np.clip(rng.standard_normal(actions.shape), actions.minimum, actions.maximum)
        )
        steps += 1
        for name, spec in observations.items():
            spec.validate(step.observation[name])
            assert np.isfinite(step.observation[name]).all(), name
        assert np.isfinite(step.reward)
    assert steps == np.ceil(0.2 / healthy.control_timestep() - 1e-9)


def test_a_welded_joint_keeps_its_angle_although_the_suite_draws_another():
    environment = tasks.load("suite-walker", "walk", {"hypothesis": "jam:left_knee=-0.5"})
    for _ in range(2):
        environment.reset()
        for _ in range(20):
            environment.step(np.ones(6))
        angle = environment.physics.named.data.qpos["left_knee"]
        assert angle == pytest.approx(-0.5, abs=1e-5)


@pytest.mark.parametrize(
    ("domain", "task", "message"),
    [
        ("suite-walker", "wlk", "unknown task of suite-walker 'wlk': did you mean walk"),
        ("suite-walker-run", "walk", "unknown task of suite-walker-run 'walk'.*run"),
        ("suite-walkr", "walk", "unknown robot 'suite-walkr': did you mean suite-walker"),
        ("walker", "walk", "unknown robot 'walker'.*suite-walker"),
        ("quadrupd", "walk", "unknown robot 'quadrupd': did you mean quadruped"),
        ("hexapod", "wlk", "unknown task of hexapod 'wlk': did you mean walk"),
    ],
)
def test_an_unknown_name_is_refused_with_the_nearest(domain: str, task: str, message: str):
    with pytest.raises(InputError, match=message):
        tasks.load(domain, task)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("suite-dog-fetch", "its ball is a second free body"),
        ("suite-quadruped-escape", "its terrain is random in each episode"),
        ("suite-reacher-easy", "its base is fixed"),
        ("suite-cartpole-balance", "its motor drives a slide"),
    ],
)
def test_a_body_that_is_no_self_model_is_refused_as_a_robot_with_the_reason(name: str, reason: str):
    with pytest.raises(InputError, match=f"{name} is a task, and its body is no robot.*{reason}"):
        entry(name)


def test_a_fault_of_the_controllers_inputs_is_refused():
    sensor = suite_bodies.robot("walker", "walk").anatomy.sensors[0].name
    for text in (f"sensor:{sensor}", "neuron:0"):
        with pytest.raises(InputError, match=f"{text} has no effect in suite-walker walk"):
            tasks.load("suite-walker", "walk", {"hypothesis": f"break:left_ankle+{text}"})


def test_rough_ground_needs_flat_ground():
    with pytest.raises(InputError, match="roughness replaces flat ground, and reacher easy has"):
        tasks.load("suite-reacher", "easy", {"hypothesis": "roughness=0.03"})


@pytest.mark.bodies
def test_the_suites_arguments_are_the_suites():
    kwargs = {"hypothesis": "break:left_ankle", "time_limit": 0.5}
    environment = tasks.load(
        "suite-walker", "walk", kwargs, {"flat_observation": True, "legacy_step": False}, True
    )

    assert environment.task.visualize_reward is True
    assert environment.physics.legacy_step is False
    assert list(environment.reset().observation) == ["observations"]
    colours = environment.physics.named.model.mat_rgba["self"].copy()
    environment.step(np.ones(6))
    assert not np.array_equal(colours, environment.physics.named.model.mat_rgba["self"])
    default = tasks.load("suite-walker", "walk", {"hypothesis": "break:left_ankle"})
    assert default._step_limit == 1000
    repeated = tasks.load("suite-cartpole", "swingup", {"hypothesis": "wind=5"}, {"n_sub_steps": 2})
    assert repeated.control_timestep() == pytest.approx(0.02)
