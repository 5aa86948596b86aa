"""Random initial pose of a physical robot, near the reference pose of its model."""

from dataclasses import dataclass

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.embodiment import WELD_ARMATURE
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import bind_data, current_value, signal_fields, state_writer

ANGLE_DEVIATION = 0.2
"""Standard deviation of the initial joint angles, rad, at a gap level of 1."""

TILT_DEVIATION = 0.1
"""Standard deviation of the initial roll and pitch of the base, rad, at a gap level of 1."""


@dataclass(frozen=True)
class StartSpread:
    """Random deviation of initial poses from the reference pose of a model.

    Attributes:
        angles: Standard deviation of the joint angles, rad.
        tilt: Standard deviation of the roll and of the pitch of the base, rad.
    """

    angles: float
    tilt: float


def start_spread(level: float) -> StartSpread:
    """Returns the spread of the initial poses of a physical robot at a level of the gap."""
    return StartSpread(level * ANGLE_DEVIATION, level * TILT_DEVIATION)


def randomize_initial_pose(
    robot: Robot,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    spread: StartSpread,
    rng: np.random.Generator,
) -> None:
    """Moves a robot from its reference pose to a random pose nearby, above the ground.

    Joint angles stay within their limits. Welded joints and the heading are unchanged, and so are
    degrees of freedom that the base does not have, such as the tilt of a planar base.

    Args:
        robot: The robot as its model describes it.
        model: Compiled model of the robot, with its faults.
        data: State of the model in the reference pose; it is changed.
        spread: Standard deviations of the pose.
        rng: Random numbers of the pose.
    """
    fields, write = signal_fields(robot, model), state_writer(robot, bind_data(data), model)
    reference_depth = _penetration_depth(robot, model, data)
    randomize_joint_angles(robot.anatomy, model, data, spread.angles, rng)
    tilt = np.append(spread.tilt * rng.standard_normal(2), 0.0)
    base = rotated_by_vector(current_value(fields["base_orientation"], data), tilt)
    write({"base_orientation": base[np.newaxis]})
    # Penetration no deeper than in the reference pose: deeper contacts would throw the robot up.
    depth = _penetration_depth(robot, model, data)
    lift = [0.0, 0.0, max(0.0, depth - reference_depth)]
    write({"base_position": (current_value(fields["base_position"], data) + lift)[np.newaxis]})


def randomize_joint_angles(
    anatomy: Anatomy,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    deviation: float,
    rng: np.random.Generator,
) -> None:
    """Adds normal noise to the joint angles of a robot, within their limits.

    Args:
        anatomy: Parts of the robot.
        model: Compiled model of the robot; its welded joints keep their angles.
        data: State of the model; it is changed.
        deviation: Standard deviation of the angles, rad.
        rng: Random numbers of the angles.
    """
    angles = deviation * rng.standard_normal(len(anatomy.hinges))
    for name, angle in zip(anatomy.hinges, angles, strict=True):
        hinge = model.joint(name)
        if model.dof_armature[hinge.dofadr[0]] == WELD_ARMATURE:
            continue
        shifted = data.qpos[hinge.qposadr[0]] + angle
        data.qpos[hinge.qposadr[0]] = (
            np.clip(shifted, *hinge.range) if hinge.limited[0] else shifted
        )


def _penetration_depth(robot: Robot, model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Returns the depth of the robot's deepest contact with the world, m.

    The depth is negative for a contact within its margin, and 0 without a contact.
    """
    mujoco.mj_fwdPosition(model, data)
    root = model.body(robot.root).id
    roots = model.body_rootid[model.geom_bodyid[data.contact.geom]]
    # The world and the robot, in either order.
    depths = -data.contact.dist[(roots == root).any(axis=1) & (roots == 0).any(axis=1)]
    return float(depths.max(initial=-np.inf)) if len(depths) else 0.0


def rotated_by_vector(orientation: FloatArray, vector: FloatArray) -> FloatArray:
    """Returns an orientation (w x y z) rotated by a rotation vector in the body frame, rad."""
    rotation, result = np.array([1.0, 0, 0, 0]), np.empty(4)
    mujoco.mju_quatIntegrate(rotation, vector, 1.0)
    mujoco.mju_mulQuat(result, orientation, rotation)
    mujoco.mju_normalize4(result)
    return result
