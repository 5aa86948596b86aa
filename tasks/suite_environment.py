"""The environments of dm_control's suite as physical robots, and the returns of episodes."""

import importlib
from collections import OrderedDict, deque
from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import CommandSource
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.physical.environment import EnvironmentRobot
from selfmodel.physical.simulated import OWN_SEED
from selfmodel.recovery.scores.fitness import Score
from selfmodel.robot.control_delay import added_steps
from selfmodel.robot.embodiment import Embodiment
from selfmodel.robot.mujoco_errors import loading_a_model
from selfmodel.robot.robot import Robot
from selfmodel.robot.sensing import SensorReader
from selfmodel.robot.state import current_value, observed_fields, signal_fields, state_writer
from selfmodel.simulation.activations import activations_since_rest
from selfmodel.trials.behaviour import Behaviour, Sample
from selfmodel.trials.signals import SIGNALS, Signal

if TYPE_CHECKING:
    from dm_control.mujoco import Physics
    from dm_control.suite.base import Task

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
        embodiment = build(robot, hidden, OWN_SEED)
        physics, rewarding = episode_parts(domain, task)
        stepped = _Stepped(rewarding, robot, embodiment)
        control = importlib.import_module("dm_control.rl.control")
        env = control.Environment(physics(embodiment.model), stepped, n_sub_steps=robot.substeps)
        self.returns = stepped.returns
        # A simulation needs no stop command, whose step would add a reward.
        self._robot = EnvironmentRobot(
            env, robot, stop=lambda: None, silent_neurons=embodiment.silent_neurons
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
        embodiment: The robot with its faults.
    """

    def __init__(self, task: "Task", robot: Robot, embodiment: Embodiment) -> None:
        self._task = task
        self._robot, self._embodiment = robot, embodiment
        joints = observed_fields(robot, [embodiment])["joint_positions"]
        self._fields = {**signal_fields(robot), "joint_positions": joints}
        self.returns: list[float] = []

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401  # attributes of the suite's task
        return getattr(self._task, name)

    def initialize_episode(self, _physics: "Physics") -> None:
        """Keeps the pose of the physics' reset and starts a new return."""
        self._reader = SensorReader(self._embodiment.model, self._robot.anatomy, [self._embodiment])
        self.returns.append(0.0)
        delay = added_steps(self._robot.control_delay, float(self._embodiment.added_delay[0]))
        self._delayed = deque(np.zeros((delay, self._embodiment.model.nu)))

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

    def of(robot: Robot, hypothesis: Hypothesis, behaviour: Behaviour) -> FloatArray:
        make, rewarding = episode_parts(domain, task)
        physics = make(build(robot, hypothesis).model)
        runs = range(len(behaviour["commands"]))
        return np.array([_sum(robot, physics, rewarding, behaviour, run) for run in runs])

    return Score("return", (*STATE, "commands"), of)


def _sum(robot: Robot, physics: "Physics", task: "Task", behaviour: Behaviour, run: int) -> float:
    physics.reset()  # resets the solver's warm start too
    model, data, commands = physics.model, physics.data, behaviour["commands"][run]
    fields = {"qpos": np.zeros((len(commands), model.nq))}
    fields["qvel"] = np.zeros((len(commands), model.nv))
    state_writer(robot, fields.__getitem__)({signal: behaviour[signal][run] for signal in STATE})
    activations = activations_since_rest(robot, commands)
    total = 0.0
    for k in range(1, len(commands)):
        data.qpos[:], data.qvel[:] = fields["qpos"][k], fields["qvel"][k]
        data.act[:] = activations[k]
        data.ctrl[:] = commands[k - 1]
        mujoco.mj_forward(model.ptr, data.ptr)
        total += float(task.get_reward(physics))
    return total
