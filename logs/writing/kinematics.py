"""Forward kinematics: pose of each body, from the nominal model and the measured joint angles."""

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.logs.messages.topics import WORLD
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import bind_data, state_writer
from selfmodel.trials.rotation import product

_POSITION_XYZW = [0, 1, 2, 4, 5, 6, 3]


def body_names(model: mujoco.MjModel) -> tuple[str, ...]:
    """Returns the names of all bodies but the world, which are the names of their frames."""
    return tuple(model.body(b).name or f"body_{b}" for b in range(1, model.nbody))


def parent_names(model: mujoco.MjModel) -> tuple[str, ...]:
    """Returns the name of the parent's frame for each body but the world."""
    names = (WORLD, *body_names(model))
    return tuple(names[parent] for parent in model.body_parentid[1:])


class Kinematics:
    """Forward kinematics of a nominal model, like ROS's robot_state_publisher.

    Args:
        robot: Robot without faults, also for a damaged physical robot.
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
            joint_positions: Joint angles, ``(steps, hinges)`` rad.
            position: Position of the root body, ``(steps, 3)`` m.
            orientation: Quaternion of the root body, ``(steps, 4)``, w x y z.

        Returns:
            Position x y z in metres and quaternion x y z w of each body, ``(steps, 7 bodies)``,
            rounded by ``to_micrometres``.
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
        with np.errstate(over="ignore", invalid="ignore"):  # unobserved or extreme values
            relative = _relative(poses[:, parents], poses[:, 1:])[..., _POSITION_XYZW]
        return to_micrometres(relative).reshape(len(position), 7 * len(parents))


def to_micrometres(values: FloatArray) -> FloatArray:
    """Returns numbers rounded to multiples of 2**-20: a micrometre, or a microradian.

    Rounding is for derived numbers, which are only displayed: constant values compress to almost
    nothing.
    """
    with np.errstate(over="ignore"):  # unobserved or extreme values
        rounded: FloatArray = np.rint(values * 2.0**20) / 2.0**20
    return rounded + 0.0  # 0 is 0, never -0


def to_body_frame(velocity: FloatArray, orientation: FloatArray) -> FloatArray:
    """Returns vectors in the frame of a body, as nav_msgs/Odometry requires for velocities.

    Args:
        velocity: Vectors in the world frame, ``(..., 3)``.
        orientation: Quaternion of the body, ``(..., 4)``, w x y z.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        scalar, axis = orientation[..., :1], -orientation[..., 1:]
        twice = 2 * np.cross(axis, velocity)
        rotated: FloatArray = velocity + scalar * twice + np.cross(axis, twice)
    return rotated


def _relative(parents: FloatArray, children: FloatArray) -> FloatArray:
    """Poses of children in the frames of their parents, ``(..., 7)`` each, w x y z last."""
    back = parents[..., 3:] * (1.0, -1.0, -1.0, -1.0)
    moved = to_body_frame(children[..., :3] - parents[..., :3], parents[..., 3:])
    return np.concatenate([moved, product(back, children[..., 3:])], axis=-1)
