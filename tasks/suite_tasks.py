"""The tasks of dm_control's suite as environments, on a healthy or a damaged body."""

import importlib
import inspect
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from selfmodel.errors import InputError
from selfmodel.faults.build import apply_faults
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.sensors import SILENT_NEURON
from selfmodel.robot.anatomy import Anatomy, added_steps
from selfmodel.robot.anatomy_reader import read_anatomy
from selfmodel.robot.model_variant import ModelVariant
from selfmodel.robot.mujoco_errors import loading_a_model, mujoco_errors_as_input_errors
from selfmodel.simulation.domain import randomize_joint_angles, start_spread
from selfmodel.simulation.reality_gap import perturbed_model
from selfmodel.tasks import arguments, suite_bodies
from selfmodel.tasks.arguments import Reality, Seed

if TYPE_CHECKING:
    from dm_control.mujoco import Physics
    from dm_control.rl import control
    from dm_control.suite.base import Task


_FIXED = "its base is fixed, so that it does not walk"

WITHOUT_SELF_MODEL: Mapping[str, Mapping[str, str]] = {
    "quadruped": {
        "escape": "its terrain is random in each episode and unknown to a self-model",
        "fetch": "its ball is a second free body",
    },
    "dog": {"fetch": "its ball is a second free body"},
    "acrobot": dict.fromkeys(("swingup", "swingup_sparse"), _FIXED),
    "ball_in_cup": {"catch": "its ball is a second free body"},
    "cartpole": dict.fromkeys(
        ("balance", "balance_sparse", "swingup", "swingup_sparse", "two_poles", "three_poles"),
        "its motor drives a slide, and no hinge",
    ),
    "finger": dict.fromkeys(("spin", "turn_easy", "turn_hard"), _FIXED),
    "lqr": dict.fromkeys(("lqr_2_1", "lqr_6_2"), "its motors drive slides, and no hinge"),
    "manipulator": dict.fromkeys(("bring_ball", "bring_peg", "insert_ball", "insert_peg"), _FIXED),
    "pendulum": {"swingup": _FIXED},
    "point_mass": dict.fromkeys(("easy", "hard"), "its motors drive slides, and no hinge"),
    "reacher": dict.fromkeys(("easy", "hard"), _FIXED),
    "stacker": dict.fromkeys(("stack_2", "stack_4"), "its boxes are further free bodies"),
}
"""Tasks that are environments only, by domain, and the reason why their body is no self-model."""

TASKS: Mapping[str, tuple[str, ...]] = {
    domain: (*suite_bodies.DOMAINS.get(domain, ()), *WITHOUT_SELF_MODEL.get(domain, ()))
    for domain in (*suite_bodies.DOMAINS, *WITHOUT_SELF_MODEL)
}
"""All tasks of the suite by domain."""


def environment(
    domain: str,
    task: str,
    *,
    hypothesis: str | Hypothesis = "intact",
    time_limit: float | None = None,
    random: Seed = None,
    gap: float = 0.0,
    start_noise: float | None = None,
    environment_kwargs: Mapping[str, Any] | None = None,
) -> "control.Environment":
    """Returns the suite's environment of a task, with a hypothesis applied to the suite's model.

    Without a hypothesis, a gap and start noise, it is the suite's own.

    The other arguments are those of ``selfmodel.tasks.load``. The random numbers of an episode are
    those of the suite's initial state and of the start noise, which is added to it. A gap has
    factors of the model and a control delay, and no measurement noise, because the scales of the
    suite's observations are unknown.

    Raises:
        InputError: The hypothesis cannot be parsed or does not apply, or another argument is out of
            range.
    """
    limit: dict[str, Any] = {}
    if time_limit is not None:
        arguments.check_time_limit(time_limit)
        limit = {"time_limit": time_limit}
    suite = importlib.import_module("dm_control.suite")
    episodes, rng = arguments.random_streams(random)
    extra = dict(environment_kwargs or {})
    with loading_a_model():  # MuJoCo warns about the cheetah
        env = suite.load(domain, task, {"random": episodes, **limit}, extra)
    own = env.physics.model.ptr
    anatomy = _anatomy(domain, task, own)
    reality = arguments.draw_reality(
        own, anatomy, hypothesis, gap=gap, start_noise=start_noise, rng=rng
    )
    if not reality.hypothesis.faults and gap == 0 and reality.start == 0:
        return env
    check_effect(f"{suite_bodies.PREFIX}{domain} {task}", reality.hypothesis)
    variant = _variant(domain, task, own, anatomy, reality)
    delay = reality.gap.delay + added_steps(0, float(variant.added_delay[0]))
    wrapper = importlib.import_module("dm_control.mujoco.wrapper.core")
    extra.pop("n_sub_steps", None)  # is in the control time step of the suite's environment
    constructor = importlib.import_module("dm_control.rl.control").Environment
    module = importlib.import_module(f"dm_control.suite.{domain}")
    default = inspect.signature(module.SUITE[task]).parameters["time_limit"].default
    return constructor(
        type(env.physics).from_model(wrapper.MjModel(variant.model)),
        DamagedTask(env.task, variant, anatomy, delay, reality.start),
        **{
            "time_limit": float(default),
            **limit,
            **extra,
            "control_timestep": env.control_timestep(),
        },
    )


def _anatomy(domain: str, task: str, model: mujoco.MjModel) -> Anatomy:
    """Returns the parts of a body, by the names of the robot if the domain has one."""
    known = suite_bodies.DOMAINS.get(domain)
    if known is None:
        return read_anatomy(model, 0)
    return suite_bodies.robot(domain, task if task in known else known[0]).anatomy


def check_effect(name: str, hypothesis: Hypothesis) -> None:
    """Refuses faults of sensors and neurons, which do not change what a task observes.

    Raises:
        InputError: A fault is one.
    """
    for fault in hypothesis.faults:
        if not fault.kind.affects_dynamics or fault.kind == SILENT_NEURON:
            raise InputError(
                f"{Hypothesis((fault,))} has no effect in {name}: its observations are "
                f"the suite's, not the readings of the robot's sensors; leave the fault out"
            )


def _variant(
    domain: str, task: str, own: mujoco.MjModel, anatomy: Anatomy, reality: Reality
) -> ModelVariant:
    """Returns the suite's compiled model of a task with the faults and the gap."""
    edits, seed = reality.hypothesis.spec_part.faults, reality.seed
    if edits and task not in suite_bodies.DOMAINS.get(domain, ()):
        raise InputError(
            f"{edits[0].kind.name} replaces flat ground, and {domain} {task} has other ground "
            f"or further bodies: use it with a task of {', '.join(suite_bodies.DOMAINS)} that "
            f"selfmodel suite list names"
        )
    if edits:
        spec = suite_bodies.specification(domain, task)
        for fault in edits:
            fault.kind.edit_specification(spec, fault, seed)
        with mujoco_errors_as_input_errors(f"compile the model of {reality.hypothesis}"):
            own = spec.compile()
    with loading_a_model():
        perturbed = perturbed_model(own, reality.gap)
        return apply_faults(perturbed, anatomy, reality.hypothesis, seed)


class DamagedTask(suite_bodies.SuiteTask):
    """A task of the suite with welded joints at their angles, a control delay and start noise.

    Observations, rewards and the end of an episode are the suite's. The delay is in control steps,
    the noise of the joint angles at the start a level of the reality gap.
    """

    def __init__(
        self, task: "Task", variant: ModelVariant, anatomy: Anatomy, delay: int, start: float
    ) -> None:
        super().__init__(task, delay)
        self._variant, self._anatomy, self._start = variant, anatomy, start

    @property
    def visualize_reward(self) -> bool:
        """Whether the colours of the body show the reward."""
        return bool(self._task.visualize_reward)

    @visualize_reward.setter
    def visualize_reward(self, value: bool) -> None:
        self._task.visualize_reward = value

    @property
    def _random(self) -> np.random.RandomState:
        """Generator of the episodes, which Shimmy replaces to seed a task."""
        random: np.random.RandomState = self._task.random
        return random

    @_random.setter
    def _random(self, value: np.random.RandomState) -> None:
        self._task._random = value  # noqa: SLF001  # dm_control has no other way to seed a task

    def initialize_episode(self, physics: "Physics") -> None:
        """Draws the suite's initial state, adds the start noise and keeps welded joints welded."""
        super().initialize_episode(physics)
        self._task.initialize_episode(physics)
        model, data = physics.model.ptr, physics.data.ptr
        if self._start > 0:
            rng = np.random.default_rng(arguments.next_seed(self._task.random))
            spread = start_spread(self._start)
            randomize_joint_angles(self._anatomy, model, data, spread.angles, rng)
        for position, velocity, angle in self._variant.welded:
            data.qpos[position], data.qvel[velocity] = angle, 0.0
