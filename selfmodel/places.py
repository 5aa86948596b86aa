"""Where in MuJoCo's state each signal of a behaviour stands."""

from dataclasses import dataclass

import mujoco

from selfmodel.arrays import columns
from selfmodel.behaviour import Signal
from selfmodel.robot import Robot


@dataclass(frozen=True)
class Place:
    """A field of MjData, and the columns of it that hold a signal."""

    field: str
    columns: slice | list[int]


def places(robot: Robot, model: mujoco.MjModel | None = None) -> dict[Signal, Place]:
    """Returns where each signal stands that is part of the physics' state.

    The commands are the controls; what the sensors read is not among them, because a controller
    receives it only through ``Senses``.

    Args:
        robot: The robot, whose parts the signals tell of.
        model: A model that has all its parts, if not the robot's own: a physical robot may have
            more of them.
    """
    model = robot.model if model is None else model
    root = model.body_jntadr[model.body(robot.root).id]
    q, v = int(model.jnt_qposadr[root]), int(model.jnt_dofadr[root])
    hinges = [model.joint(name) for name in robot.anatomy.hinges]
    hinge_q = columns([int(hinge.qposadr[0]) for hinge in hinges])
    hinge_v = columns([int(hinge.dofadr[0]) for hinge in hinges])
    return {
        "commands": Place(
            "ctrl", columns([int(model.actuator(name).id) for name in robot.anatomy.motors])
        ),
        "joint_positions": Place("qpos", hinge_q),
        "joint_velocities": Place("qvel", hinge_v),
        "joint_efforts": Place("qfrc_actuator", hinge_v),
        "base_position": Place("qpos", slice(q, q + 3)),
        "base_orientation": Place("qpos", slice(q + 3, q + 7)),
        "base_linear_velocity": Place("qvel", slice(v, v + 3)),
        "base_angular_velocity": Place("qvel", slice(v + 3, v + 6)),
    }
