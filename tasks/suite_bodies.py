"""The bodies of dm_control's suite as robots, and their environments as physical robots."""

import importlib
import math
from collections import OrderedDict, deque
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import CommandSource
from selfmodel.errors import unknown_name
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.physical.environment import EnvironmentRobot
from selfmodel.physical.simulated import OWN_SEED
from selfmodel.recovery.scores import Score
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
from selfmodel.trials.trajectory import Sample, Trajectory

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


def names() -> tuple[str, ...]:
    """Returns the names of all robots of the suite."""
    return tuple(name(domain, task) for domain, tasks in DOMAINS.items() for task in tasks)


def name(domain: str, task: str) -> str:
    """Returns the robot's name of the body of a task."""
    return f"{PREFIX}{domain}-{task}"


def parse_name(text: str) -> tuple[str, str]:
    """Returns the domain and the task of a robot's name.

    Raises:
        InputError: The name is unknown; the message contains the nearest one.
    """
    domain, _, task = text.removeprefix(PREFIX).partition("-")
    if not text.startswith(PREFIX) or task not in DOMAINS.get(domain, ()):
        raise unknown_name("robot", text, names())
    return domain, task


def entry(domain: str, task: str) -> Entry:
    """Returns the registry entry of the body of a task, with its environment and its return."""
    return Entry(
        robot=partial(robot, domain, task),
        physical=partial(SuiteRobot, domain, task),
        episode_return=episode_return(domain, task),
    )


@lru_cache
def robot(domain: str, task: str) -> Robot:
    """Returns the healthy body of a task, with the suite's own time steps.

    The initial pose is that of ``Physics.reset``, without the random pose of the suite's episodes.
    A swimmer is rotated by a right angle, so that its nose points forward.

    Args:
        domain: One of ``DOMAINS``.
        task: One of its tasks.
    """
    mjcf, assets = _model(domain, task)
    text = mjcf.decode() if isinstance(mjcf, bytes) else mjcf
    keyframe = "none"
    if domain == "swimmer":
        keyframe, text = _FORWARD, text.replace("</mujoco>", _swimmer_keyframe(_links(task)))
    settings = MjcfSettings(keyframe=keyframe, control_timestep=control_timestep(domain))
    return adapt_text(name(domain, task), text, assets, settings)


def specification(domain: str, task: str) -> mujoco.MjSpec:
    """Returns the suite's own model of a task, as an editable specification.

    Args:
        domain: One of ``DOMAINS``.
        task: One of its tasks.
    """
    mjcf, assets = _model(domain, task)
    work = read_mjcf(parse_xml(mjcf), InMemory(assets))
    with loading_a_model():
        return mujoco.MjSpec.from_string(work.text, assets=dict(work.assets))


def control_timestep(domain: str) -> float | None:
    """Returns the control time step of a domain, s; None if it is the physics time step."""
    found: float | None = getattr(_module(domain), "_CONTROL_TIMESTEP", None)
    return found


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


def _swimmer_keyframe(links: int) -> str:
    """A keyframe of a swimmer rotated by a right angle; its ``links - 1`` other joints are at 0."""
    qpos = f"0 0 {math.pi / 2!r}" + " 0" * (links - 1)
    return f'<keyframe><key name="{_FORWARD}" qpos="{qpos}"/></keyframe></mujoco>'


_FORWARD = "forward"


def _module(domain: str) -> Any:  # noqa: ANN401  # modules of dm_control have no types
    # Imported here, because dm_control's physics initialises a display when imported.
    return importlib.import_module(f"dm_control.suite.{domain}")


STATE: tuple[Signal, ...] = (
    "joint_positions",
    "joint_velocities",
    "base_position",
    "base_orientation",
    "base_linear_velocity",
    "base_angular_velocity",
)


class SuiteRobot:
    """A physical robot in an environment of the suite, stepped through the dm_env interface.

    Args:
        domain: Domain of the suite.
        task: Task of the domain.
        robot: The healthy body.
        hidden: Faults of the physical robot.

    Attributes:
        returns: Sum of the environment's rewards, per run so far.
    """

    def __init__(self, domain: str, task: str, robot: Robot, hidden: Hypothesis) -> None:
        variant = build(robot, hidden, OWN_SEED)
        physics, rewarding = episode_parts(domain, task)
        stepped = _Stepped(rewarding, robot, variant)
        control = importlib.import_module("dm_control.rl.control")
        env = control.Environment(physics(variant.model), stepped, n_sub_steps=robot.substeps)
        self.returns = stepped.returns
        # A simulation needs no stop command, whose step would add a reward.
        self._robot = EnvironmentRobot(
            env, robot, stop=lambda: None, silent_neurons=variant.silent_neurons
        )
        self.clock = self._robot.clock

    def run(self, controller: CommandSource, steps: int) -> Iterator[Sample]:
        """Runs a controller; see ``PhysicalRobot``."""
        return self._robot.run(controller, steps)


class _Stepped:
    """A task of the suite with a fixed initial pose and with the robot's own observations.

    Args:
        task: The suite's task after one reset; all other attributes are delegated to it.
        robot: The healthy robot.
        variant: The robot with its faults.
    """

    def __init__(self, task: "Task", robot: Robot, variant: ModelVariant) -> None:
        self._task = task
        self._robot, self._variant = robot, variant
        joints = observed_fields(robot, [variant])["joint_positions"]
        self._fields = {**signal_fields(robot), "joint_positions": joints}
        self.returns: list[float] = []

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401  # attributes of the suite's task
        return getattr(self._task, name)

    def initialize_episode(self, _physics: "Physics") -> None:
        """Keeps the pose of the physics' reset and starts a new return."""
        self._reader = SensorReader(self._variant.model, self._robot.anatomy, [self._variant])
        self.returns.append(0.0)
        delay = added_steps(self._robot.control_delay, float(self._variant.added_delay[0]))
        self._delayed = deque(np.zeros((delay, self._variant.model.nu)))

    def before_step(self, action: FloatArray, physics: "Physics") -> None:
        """Applies the commands of some control steps ago."""
        self._delayed.append(np.array(action, dtype=np.float64))
        self._task.before_step(self._delayed.popleft(), physics)

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

    return Score("return", (*STATE, "commands"), of)


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
