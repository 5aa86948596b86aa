"""The bodies of dm_control's suite as robots, and their environments as physical robots."""

import importlib
import math
from collections import OrderedDict, deque
from collections.abc import Callable, Mapping
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import TASK_PREFIX
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.physical.environment import EnvironmentRobot
from selfmodel.physical.simulated import OWN_SEED
from selfmodel.recovery.scores import Score
from selfmodel.robot.actuators import holding_commands
from selfmodel.robot.anatomy import added_steps
from selfmodel.robot.mjcf.load import adapt_text
from selfmodel.robot.mjcf.settings import MjcfSettings
from selfmodel.robot.mjcf.untrusted import InMemory, parse_xml
from selfmodel.robot.mjcf.work import read_mjcf
from selfmodel.robot.model_variant import ModelVariant
from selfmodel.robot.mujoco_errors import loading_a_model
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import (
    SensorReader,
    current_value,
    observed_fields,
    signal_fields,
    state_writer,
)
from selfmodel.simulation.prediction import activations
from selfmodel.tasks.entry import Entry
from selfmodel.trials.signals import SIGNALS, Signal
from selfmodel.trials.trajectory import Trajectory

if TYPE_CHECKING:
    from dm_control.mujoco import Physics
    from dm_control.suite.base import Task


PREFIX = "suite-"
"""Prefix of the robots' names, as in ``suite-walker-run``."""

DOMAINS: Mapping[str, tuple[str, ...]] = {
    "quadruped": ("walk", "run"),
    "walker": ("walk", "run", "stand"),
    "cheetah": ("run",),
    "hopper": ("hop", "stand"),
    "humanoid": ("walk", "run", "stand", "run_pure_state"),
    "humanoid_CMU": ("walk", "run", "stand"),
    "dog": ("walk", "trot", "run", "stand"),
    "swimmer": ("swimmer6", "swimmer15"),
    "fish": ("swim", "upright"),
}
"""Tasks by domain; the first is the default.

Tasks with a ball are omitted, because the ball is a second free body, and so is the quadruped's
``escape``, because its terrain is random in each episode and unknown to a self-model.
"""


BODIES = tuple((domain, task) for domain, tasks in DOMAINS.items() for task in tasks)
"""Domain and task of each body."""


def name(domain: str, task: str) -> str:
    """Returns the robot's name of the body of a task."""
    return f"{PREFIX}{domain}-{task}"


def entry(domain: str, task: str) -> Entry:
    """Returns the registry entry of the body of a task, with its environment and its return."""
    return Entry(
        robot=partial(robot, domain, task),
        physical=partial(suite_robot, domain, task),
        episode_return=episode_return(domain, task),
    )


@lru_cache
def robot(domain: str, task: str) -> Robot:
    """Returns the healthy body of a task of ``DOMAINS``, with the suite's own time steps.

    The initial pose is that of ``Physics.reset``, without the random pose of the suite's episodes.
    A swimmer is rotated by a right angle, so that its nose points forward.
    """
    mjcf, assets = _model(domain, task)
    text = mjcf.decode() if isinstance(mjcf, bytes) else mjcf
    keyframe = "none"
    if domain == "swimmer":
        keyframe, others = "forward", " 0" * (_links(task) - 1)
        key = f'<key name="{keyframe}" qpos="0 0 {math.pi / 2!r}{others}"/>'
        text = text.replace("</mujoco>", f"<keyframe>{key}</keyframe></mujoco>")
    # Without it, the control time step is the physics time step.
    timestep: float | None = getattr(_module(domain), "_CONTROL_TIMESTEP", None)
    settings = MjcfSettings(keyframe=keyframe, control_timestep=timestep)
    return adapt_text(name(domain, task), text, assets, settings)


def specification(domain: str, task: str) -> mujoco.MjSpec:
    """Returns the suite's own model of a task of ``DOMAINS``, as an editable specification."""
    mjcf, assets = _model(domain, task)
    work = read_mjcf(parse_xml(mjcf), InMemory(assets))
    with loading_a_model():
        return mujoco.MjSpec.from_string(work.text, assets=dict(work.assets))


def _model(domain: str, task: str) -> tuple[str | bytes, Mapping[str, bytes]]:
    """The MJCF of a task and its assets, from the suite.

    The size of the ground, which depends on the task in the suite, is visual only: planes are
    infinite.
    """
    module = _module(domain)
    if domain == "quadruped":
        return module.make_model(), importlib.import_module("dm_control.suite.common").ASSETS
    size = (_links(task),) if domain == "swimmer" else ()
    found: tuple[str | bytes, Mapping[str, bytes]] = module.get_model_and_assets(*size)
    return found


def _links(task: str) -> int:
    return int(task.removeprefix("swimmer"))


def _module(domain: str) -> Any:  # noqa: ANN401  # modules of dm_control have no types
    # Imported here, because dm_control's physics initialises a display when imported.
    return importlib.import_module(f"dm_control.suite.{domain}")


EPISODE = 1000
"""Rewards in an episode of each task of ``DOMAINS``: its time limit over its control time step."""

STATE: tuple[Signal, ...] = (
    "joint_positions",
    "joint_velocities",
    "base_position",
    "base_orientation",
    "base_linear_velocity",
    "base_angular_velocity",
)


class SuiteTask:
    """A task of the suite whose commands are delayed by some control steps.

    All other attributes are those of the suite's task.
    """

    def __init__(self, task: "Task", delay: int) -> None:
        self._task, self._delay = task, delay

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401  # attributes of the suite's task
        if name == "_task":  # a copy has no attributes yet
            raise AttributeError(name)
        return getattr(self._task, name)

    def initialize_episode(self, physics: "Physics") -> None:
        """Starts the delay line."""
        self._delayed = deque([holding_commands(physics.model.ptr)] * self._delay)

    def before_step(self, action: FloatArray, physics: "Physics") -> None:
        """Applies the commands of some control steps ago."""
        self._delayed.append(np.array(action, dtype=np.float64))
        self._task.before_step(self._delayed.popleft(), physics)


def suite_robot(domain: str, task: str, robot: Robot, hidden: Hypothesis) -> EnvironmentRobot:
    """Returns a physical robot in an environment of the suite, stepped by the dm_env interface."""
    variant = build(robot, hidden, OWN_SEED)
    physics, rewarding = episode_parts(domain, task)
    control = importlib.import_module("dm_control.rl.control")
    env = control.Environment(
        physics(variant.model),
        _ObservedTask(rewarding, robot, variant),
        n_sub_steps=robot.substeps,
    )
    return EnvironmentRobot(
        *(env, robot),
        stop=lambda: None,  # a simulation needs no stop command, whose step would add a reward
        signals=SIGNALS,
        silent_neurons=variant.silent_neurons,
    )


class _ObservedTask(SuiteTask):
    """A task of the suite, which was reset once, with the robot's initial pose and observations.

    Attributes:
        returns: Sum of the rewards, per run so far.
    """

    def __init__(self, task: "Task", robot: Robot, variant: ModelVariant) -> None:
        super().__init__(task, added_steps(robot.control_delay, float(variant.added_delay[0])))
        from selfmodel.robot.observations import observation_of  # noqa: PLC0415  # few commands

        self._robot, self._variant, key = robot, variant, observation_of(robot.name)
        self._observation = f"{TASK_PREFIX}{key}" if key else ""
        joints = observed_fields(robot, [variant])["joint_positions"]
        self._fields = {**signal_fields(robot), "joint_positions": joints}
        self.returns: list[float] = []

    def initialize_episode(self, physics: "Physics") -> None:
        """Keeps the pose of the physics' reset and starts a new return."""
        super().initialize_episode(physics)
        self._reader = SensorReader(self._variant.model, self._robot.anatomy, [self._variant])
        self.returns.append(0.0)

    def get_reward(self, physics: "Physics") -> float:
        """Returns the suite's reward, and adds it to the return."""
        reward = float(self._task.get_reward(physics))
        self.returns[-1] += reward
        return reward

    def get_observation(self, physics: "Physics") -> "OrderedDict[str, FloatArray | float]":
        """Returns the sensor readings, the state signals and the time, by signal name."""
        data = physics.data
        readings = np.empty((1, len(self._robot.anatomy.sensors)))
        self._reader.read(data.sensordata[np.newaxis], data.qpos[np.newaxis], readings)
        observation: OrderedDict[str, FloatArray | float] = OrderedDict(sensors=readings[0])
        for signal in SIGNALS:
            if signal not in ("sensors", "commands"):
                observation[signal] = current_value(self._fields[signal], data)
        if self._observation:
            own = self._task.get_observation(physics).values()
            observation[self._observation] = np.concatenate([np.ravel(one) for one in own])
        observation["time"] = physics.time()
        return observation


@lru_cache
def episode_parts(domain: str, task: str) -> tuple[Callable[[mujoco.MjModel], Any], Any]:
    """Returns the suite's constructor of a physics from a model, and the suite's task.

    The task is reset once, on the suite's healthy body: constants measured in the reset, such as
    the mass of the dog, hold for every episode, and the random pose of the reset is discarded.
    """
    # Imported here, because dm_control's physics initialises a display when imported.
    suite = importlib.import_module("dm_control.suite")
    wrapper = importlib.import_module("dm_control.mujoco.wrapper.core")
    with loading_a_model():  # MuJoCo warns about the cheetah
        env = suite.load(domain, task, task_kwargs={"random": 0})
    env.reset()
    own = type(env.physics)
    return lambda model: own.from_model(wrapper.MjModel(model)), env.task


def episode_return(domain: str, task: str) -> Score:
    """Returns the score that is the sum of a task's rewards.

    The reward of every command but the last is included: a run does not record the state after its
    last command. Rewards are computed from the recorded states. Rewards that depend on contact
    forces, such as the dog's, use the forces in the recorded state, where the suite's environment
    uses the forces one physics step earlier.
    """

    def of(robot: Robot, hypothesis: Hypothesis, trajectory: Trajectory) -> FloatArray:
        make, rewarding = episode_parts(domain, task)
        physics = make(build(robot, hypothesis).model)
        runs = range(len(trajectory["commands"]))
        return np.array([_sum(robot, physics, rewarding, trajectory, run) for run in runs])

    return Score("return", (*STATE, "commands"), of, episode=EPISODE)


def _sum(robot: Robot, physics: "Physics", task: "Task", trajectory: Trajectory, run: int) -> float:
    physics.reset()  # resets the solver's warm start too
    model, data, commands = physics.model, physics.data, trajectory["commands"][run]
    fields = {"qpos": np.zeros((len(commands), model.nq))}
    fields["qvel"] = np.zeros((len(commands), model.nv))
    state_writer(robot, fields.__getitem__)({signal: trajectory[signal][run] for signal in STATE})
    activation = activations(robot, commands)
    total = 0.0
    for k in range(1, len(commands)):
        data.qpos[:], data.qvel[:] = fields["qpos"][k], fields["qvel"][k]
        data.act[:] = activation[k]
        data.ctrl[:] = commands[k - 1]
        mujoco.mj_forward(model.ptr, data.ptr)
        total += float(task.get_reward(physics))
    return total
