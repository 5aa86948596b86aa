"""The environments of dm_control's suite as physical robots, and the return of their episodes."""

import importlib
from collections import OrderedDict
from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.command_source import CommandSource
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.physical.environment_robot import EnvironmentRobot
from selfmodel.physical.simulated_robot import OWN_SEED
from selfmodel.recovery.fitness import Score
from selfmodel.robot.embodiment import Embodiment
from selfmodel.robot.mjcf.mujoco_errors import mujoco_errors_as_input_errors
from selfmodel.robot.robot import Robot
from selfmodel.robot.sensing import SensorReader
from selfmodel.robot.state_access import current_value, signal_fields, state_writer
from selfmodel.simulation.activations import activations_of
from selfmodel.trials.behaviour import SIGNALS, Behaviour, Sample, Signal

STATE: tuple[Signal, ...] = (
    "joint_positions",
    "joint_velocities",
    "base_position",
    "base_orientation",
    "base_linear_velocity",
    "base_angular_velocity",
)


class SuiteRobot:
    """A physical robot in an environment of the suite, stepped through its interface.

    Args:
        domain: Of the suite.
        task: Of the domain.
        robot: The body as its model describes it.
        hidden: What is wrong with it.

    Attributes:
        returns: The sum of the environment's rewards in each run so far.
    """

    def __init__(self, domain: str, task: str, robot: Robot, hidden: Hypothesis) -> None:
        embodiment = build(robot, hidden, OWN_SEED)
        physics, rewarding = episode_parts(domain, task)
        stepped = _Stepped(rewarding, robot, embodiment)
        control = importlib.import_module("dm_control.rl.control")
        env = control.Environment(physics(embodiment.model), stepped, n_sub_steps=robot.substeps)
        self.returns = stepped.returns
        # Nothing but a simulation is to be brought to rest; and a step would be rewarded.
        self._robot = EnvironmentRobot(
            env, robot, stop=lambda: None, silent_neurons=embodiment.silent_neurons
        )
        self.clock = self._robot.clock

    def run(self, controller: CommandSource, steps: int) -> Iterator[Sample]:
        """Runs a controller; see ``PhysicalRobot``."""
        return self._robot.run(controller, steps)


class _Stepped:
    """A task of the suite but for its start, which is always the same, and what is observed.

    Args:
        task: The suite's, begun once; it is asked for everything else.
        robot: The robot with nothing wrong.
        embodiment: The same with what is wrong.
    """

    def __init__(self, task: Any, robot: Robot, embodiment: Embodiment) -> None:  # noqa: ANN401
        self._task = task
        self._robot, self._embodiment = robot, embodiment
        self._places = signal_fields(robot)
        self.returns: list[float] = []

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401  # the task's own
        return getattr(self._task, name)

    def initialize_episode(self, _physics: Any) -> None:  # noqa: ANN401
        """Leaves the robot as the physics' reset has put it."""
        self._senses = SensorReader(self._embodiment.model, self._robot.anatomy, [self._embodiment])
        self.returns.append(0.0)

    def get_reward(self, physics: Any) -> float:  # noqa: ANN401
        """Returns the suite's reward."""
        reward = float(self._task.get_reward(physics))
        self.returns[-1] += reward
        return reward

    def get_observation(self, physics: Any) -> "OrderedDict[str, FloatArray | float]":  # noqa: ANN401
        """Returns what the controller receives, the state, and the time, by our names."""
        data = physics.data
        readings = np.empty((1, len(self._robot.anatomy.sensors)))
        self._senses.read(data.sensordata[np.newaxis], data.qpos[np.newaxis], readings)
        seen: OrderedDict[str, FloatArray | float] = OrderedDict(sensors=readings[0])
        for signal in SIGNALS:
            if signal not in ("sensors", "commands"):
                seen[signal] = current_value(self._places[signal], data)
        seen["time"] = physics.time()
        return seen


@lru_cache
def episode_parts(domain: str, task: str) -> tuple[Callable[[mujoco.MjModel], Any], Any]:
    """Returns what makes the physics of a model as the suite does, and the suite's task.

    The task is begun once, on the suite's own body with nothing wrong: what it measures there, such
    as how heavy a dog is, holds for every episode, and what it draws there is forgotten.
    """
    # When it is needed, because dm_control's physics looks for a display as it is imported.
    suite = importlib.import_module("dm_control.suite")
    wrapper = importlib.import_module("dm_control.mujoco.wrapper.core")
    with mujoco_errors_as_input_errors():  # of a cheetah it warns
        env = suite.load(domain, task, task_kwargs={"random": 0})
    env.reset()
    own = type(env.physics)
    return lambda model: own.from_model(wrapper.MjModel(model)), env.task


def episode_return(domain: str, task: str) -> Score:
    """Returns the score that is the sum of a task's rewards.

    A run of ``steps`` samples has been rewarded after each command but the last, whose consequence
    it does not show. Rewards are computed from the recorded states; what follows from forces of
    contact, such as a dog's weight on its feet, is that of the state itself, where the suite's
    environment has that of one physics step before.
    """

    def of(robot: Robot, hypothesis: Hypothesis, behaviour: Behaviour) -> FloatArray:
        make, rewarding = episode_parts(domain, task)
        physics = make(build(robot, hypothesis).model)
        runs = range(len(behaviour["commands"]))
        return np.array([_sum(robot, physics, rewarding, behaviour, run) for run in runs])

    return Score("return", (*STATE, "commands"), of)


def _sum(robot: Robot, physics: Any, task: Any, behaviour: Behaviour, run: int) -> float:  # noqa: ANN401
    physics.reset()  # the solver's first guess, too, is that of every run
    model, data, commands = physics.model, physics.data, behaviour["commands"][run]
    fields = {"qpos": np.zeros((len(commands), model.nq))}
    fields["qvel"] = np.zeros((len(commands), model.nv))
    state_writer(robot, fields.__getitem__)({signal: behaviour[signal][run] for signal in STATE})
    activations = activations_of(robot, commands)
    total = 0.0
    for k in range(1, len(commands)):
        data.qpos[:], data.qvel[:] = fields["qpos"][k], fields["qvel"][k]
        data.act[:] = activations[k]
        data.ctrl[:] = commands[k - 1]
        mujoco.mj_forward(model.ptr, data.ptr)
        total += float(task.get_reward(physics))
    return total
