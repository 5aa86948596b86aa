"""Where each body of a robot is, as its own model says for the angles that were measured."""

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.logs.topics import WORLD
from selfmodel.robot.robot import Robot
from selfmodel.robot.state_access import bind_data, state_writer
from selfmodel.trials.rotation import product

_POSITION_XYZW = [0, 1, 2, 4, 5, 6, 3]


def body_names(model: mujoco.MjModel) -> tuple[str, ...]:
    """Returns the name of each body but the world; it names the body's frame."""
    return tuple(model.body(b).name or f"body_{b}" for b in range(1, model.nbody))


def parent_names(model: mujoco.MjModel) -> tuple[str, ...]:
    """Returns, for each body but the world, the name of the frame that it is told in."""
    names = (WORLD, *body_names(model))
    return tuple(names[parent] for parent in model.body_parentid[1:])


class Kinematics:
    """Computes poses from joint angles, like ROS's robot_state_publisher.

    Args:
        robot: Whose model is used: the nominal one, whatever is wrong with the physical robot.
    """

    def __init__(self, robot: Robot) -> None:
        self._model = robot.model
        self._data = mujoco.MjData(robot.model)
        self._write = state_writer(robot, bind_data(self._data))

    def transforms(
        self, joint_positions: FloatArray, position: FloatArray, orientation: FloatArray
    ) -> FloatArray:
        """Returns the pose of each body in the frame of its parent.

        Args:
            joint_positions: ``(steps, hinges)`` rad.
            position: ``(steps, 3)`` of the root body, m.
            orientation: ``(steps, 4)`` of the root body, w x y z.

        Returns:
            ``(steps, 7 bodies)``: of each body x y z in metres and the quaternion x y z w, rounded
            like all that is derived.
        """
        data = self._data
        poses = np.empty((len(position), self._model.nbody, 7))
        for k in range(len(position)):
            self._write(
                {
                    "joint_positions": joint_positions[k : k + 1],
                    "base_position": position[k : k + 1],
                    "base_orientation": orientation[k : k + 1],
                }
            )
            mujoco.mj_kinematics(self._model, data)
            poses[k, :, :3] = data.xpos
            poses[k, :, 3:] = data.xquat
        parents = self._model.body_parentid[1:]
        with np.errstate(over="ignore", invalid="ignore"):  # a robot may be lost to sight
            relative = _relative(poses[:, parents], poses[:, 1:])[..., _POSITION_XYZW]
        return to_micrometres(relative).reshape(len(position), 7 * len(parents))


def to_micrometres(values: FloatArray) -> FloatArray:
    """Returns derived numbers rounded to multiples of 2**-20.

    They are for looking at: a micrometre and a microradian are enough for that, and what does not
    move takes no place in the file.
    """
    with np.errstate(over="ignore"):  # a robot may be lost to sight
        rounded: FloatArray = np.rint(values * 2.0**20) / 2.0**20
    return rounded + 0.0  # 0 is 0, never -0


def into_child_frame(velocity: FloatArray, orientation: FloatArray) -> FloatArray:
    """Returns vectors of the world's frame in the frame of a body.

    Args:
        velocity: ``(..., 3)`` in the world's frame: for nav_msgs/Odometry, which wants it so.
        orientation: ``(..., 4)`` of the body, w x y z.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        scalar, axis = orientation[..., :1], -orientation[..., 1:]
        twice = 2 * np.cross(axis, velocity)
        rotated: FloatArray = velocity + scalar * twice + np.cross(axis, twice)
    return rotated


def _relative(parents: FloatArray, children: FloatArray) -> FloatArray:
    """The poses of children in the frames of their parents, each ``(..., 7)``, w x y z last."""
    back = parents[..., 3:] * (1.0, -1.0, -1.0, -1.0)
    moved = into_child_frame(children[..., :3] - parents[..., :3], parents[..., 3:])
    return np.concatenate([moved, product(back, children[..., 3:])], axis=-1)
