"""Where in MuJoCo's state each signal of a behaviour stands."""

from collections.abc import Callable, Mapping

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray, columns
from selfmodel.robot.floating_base import Bind, DerivedSignal, StateField, root_of
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import Signal

Writer = Callable[[Mapping[Signal, FloatArray]], None]
"""Puts signals of the state, ``(n, width)`` each, into it; what is not given stays."""


def signal_fields(
    robot: Robot, *models: mujoco.MjModel
) -> dict[Signal, StateField | DerivedSignal]:
    """Returns where each signal stands that is part of the physics' state.

    The commands are the controls; what the sensors read is not among them, because a controller
    receives it only through ``SensorReader``.

    Args:
        robot: The robot, whose parts the signals tell of.
        models: What the states are of, if not of the robot's own: one for all of them, or one for
            each, of one layout. It has all of the robot's parts; a physical robot may have more.
    """
    models = models or (robot.model,)
    model = models[0]
    motors = columns([int(model.actuator(name).id) for name in robot.anatomy.motors])
    return {
        "commands": StateField("ctrl", motors),
        **_joints(robot, model),
        **root_of(models, robot.root).signal_fields(),
    }


def writer(robot: Robot, bind: Bind, *models: mujoco.MjModel) -> Writer:
    """Returns what writes joints and base into a state.

    Args:
        robot: The robot, whose parts the signals tell of.
        bind: Gives the fields that are written.
        models: As for ``places``.
    """
    models = models or (robot.model,)
    qpos, qvel = bind("qpos"), bind("qvel")
    fields = {"qpos": qpos, "qvel": qvel}
    root, joints = root_of(models, robot.root), _joints(robot, models[0])

    def write(state: Mapping[Signal, FloatArray]) -> None:
        for signal in ("joint_positions", "joint_velocities"):
            if signal in state:
                fields[joints[signal].field][:, joints[signal].columns] = state[signal]
        root.write(qpos, qvel, state)

    return write


def fields_of(data: mujoco.MjData) -> Bind:
    """Returns what gives the fields of a single robot's state as those of many, of which it is."""

    def bind(field: str) -> FloatArray:
        values: FloatArray = getattr(data, field)
        return values[np.newaxis]

    return bind


def present(place: StateField | DerivedSignal, data: mujoco.MjData) -> FloatArray:
    """Returns a copy of the present value of a signal of a single robot, ``(width,)``."""
    return np.array(place.reader(fields_of(data))()[0])


def _joints(robot: Robot, model: mujoco.MjModel) -> dict[Signal, StateField]:
    hinges = [model.joint(name) for name in robot.anatomy.hinges]
    hinge_q = columns([int(hinge.qposadr[0]) for hinge in hinges])
    hinge_v = columns([int(hinge.dofadr[0]) for hinge in hinges])
    return {
        "joint_positions": StateField("qpos", hinge_q),
        "joint_velocities": StateField("qvel", hinge_v),
        "joint_efforts": StateField("qfrc_actuator", hinge_v),
    }
