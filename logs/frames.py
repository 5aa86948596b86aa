"""Where each body of a robot is, as its own model says for the angles that were measured."""

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.behaviour import Signal
from selfmodel.places import places
from selfmodel.robot import Robot

_CONFIGURATION: tuple[Signal, ...] = ("joint_positions", "base_position", "base_orientation")
_POSITION_XYZW = [0, 1, 2, 4, 5, 6, 3]


def body_names(model: mujoco.MjModel) -> tuple[str, ...]:
    """Returns the name of each body but the world; it names the body's frame."""
    return tuple(model.body(b).name or f"body_{b}" for b in range(1, model.nbody))


class Kinematics:
    """Computes poses from joint angles, like ROS's robot_state_publisher.

    Args:
        robot: Whose model is used: the nominal one, whatever is wrong with the physical robot.
    """

    def __init__(self, robot: Robot) -> None:
        where = places(robot)
        self._model = robot.model
        self._data = mujoco.MjData(robot.model)
        self._columns = [where[signal].columns for signal in _CONFIGURATION]

    def transforms(
        self, joint_positions: FloatArray, position: FloatArray, orientation: FloatArray
    ) -> FloatArray:
        """Returns the pose of each body in the world.

        Args:
            joint_positions: ``(steps, hinges)`` rad.
            position: ``(steps, 3)`` of the root body, m.
            orientation: ``(steps, 4)`` of the root body, w x y z.

        Returns:
            ``(steps, 7 bodies)``: of each body x y z in metres and the quaternion x y z w, each
            rounded to a multiple of 2**-20. They are derived, and for looking at; a micrometre
            and a microradian are enough for that and take half the place in the file.
        """
        data, (hinges, where, turn) = self._data, self._columns
        poses = np.empty((len(position), self._model.nbody, 7))
        for k in range(len(position)):
            data.qpos[hinges] = joint_positions[k]
            data.qpos[where] = position[k]
            data.qpos[turn] = orientation[k]
            mujoco.mj_kinematics(self._model, data)
            poses[k, :, :3] = data.xpos
            poses[k, :, 3:] = data.xquat
        poses = poses[:, 1:, _POSITION_XYZW]
        with np.errstate(over="ignore"):  # a robot that was lost to sight may be anywhere
            rounded: FloatArray = np.rint(poses * 2.0**20) / 2.0**20
        return rounded.reshape(len(position), -1)


def into_child_frame(velocity: FloatArray, orientation: FloatArray) -> FloatArray:
    """Returns velocities in the frame of a body, as nav_msgs/Odometry wants them.

    Args:
        velocity: ``(steps, 3)`` in the world's frame.
        orientation: ``(steps, 4)`` of the body, w x y z.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        scalar, axis = orientation[:, :1], -orientation[:, 1:]
        twice = 2 * np.cross(axis, velocity)
        rotated: FloatArray = velocity + scalar * twice + np.cross(axis, twice)
    return rotated
