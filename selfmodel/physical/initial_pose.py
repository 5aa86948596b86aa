"""How a physical robot stands when a trial starts: never quite as its model does."""

import mujoco
import numpy as np

from selfmodel.physical.measurement_noise import turned
from selfmodel.robot.embodiment import WELD_ARMATURE
from selfmodel.robot.robot import Robot
from selfmodel.robot.state_access import bind_data, current_value, signal_fields, state_writer

ANGLES = 0.2
"""Standard deviation of the joint angles at the start, rad, at a level of 1."""

TILT = 0.1
"""That of the base's roll and of its pitch."""


def randomize_initial_pose(
    robot: Robot, model: mujoco.MjModel, data: mujoco.MjData, level: float, rng: np.random.Generator
) -> None:
    """Moves a robot from its reference pose to one nearby, and lifts it out of the ground.

    Joint angles stay within their limits, held joints and the heading as they are. A root that
    cannot tilt or rise does not.

    Args:
        robot: The robot, whose parts are moved.
        model: What it is like.
        data: Its state, in the reference pose; written.
        level: The gap's.
        rng: Where the pose is drawn from.
    """
    where, write = signal_fields(robot, model), state_writer(robot, bind_data(data), model)
    deepest = _depth(robot, model, data)
    angles = level * ANGLES * rng.standard_normal(len(robot.anatomy.hinges))
    for name, angle in zip(robot.anatomy.hinges, angles, strict=True):
        hinge = model.joint(name)
        if model.dof_armature[hinge.dofadr[0]] == WELD_ARMATURE:
            continue
        moved = data.qpos[hinge.qposadr[0]] + angle
        data.qpos[hinge.qposadr[0]] = np.clip(moved, *hinge.range) if hinge.limited[0] else moved
    tilt = np.append(level * TILT * rng.standard_normal(2), 0.0)
    base = turned(current_value(where["base_orientation"], data), tilt)
    write({"base_orientation": base[np.newaxis]})
    # Contact forces start within the skin: no deeper than in the reference pose, nothing kicks.
    lift = [0.0, 0.0, max(0.0, _depth(robot, model, data) - deepest)]
    write({"base_position": (current_value(where["base_position"], data) + lift)[np.newaxis]})


def _depth(robot: Robot, model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """How deep the robot is in the ground, m; negative within a contact's margin."""
    mujoco.mj_fwdPosition(model, data)
    root = model.body(robot.root).id
    roots = model.body_rootid[model.geom_bodyid[data.contact.geom]]
    # A contact of the world with the robot, in either order.
    depths = -data.contact.dist[(roots == root).any(axis=1) & (roots == 0).any(axis=1)]
    return float(depths.max(initial=-np.inf)) if len(depths) else 0.0
