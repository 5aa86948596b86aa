"""The camera of a film, the same for every kind of picture."""

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.cli.rendering.film import Film, Shot

ASIDE, ELEVATION = 65.0, -22.0
"""Azimuth of the camera from the robot's heading, and elevation, degrees: from the side, a little
from behind and above."""

SMOOTHING = 0.5
"""Time over which the camera's path is averaged, s, so that it does not sway at each step."""

MAX_SMOOTHED_FRAMES = 1000
"""Largest number of frames before and after a frame that its average includes: the frames of a
strip may be less than a nanosecond apart."""


def gaze(film: Film, shot: Shot) -> FloatArray:
    """Returns the target point of the camera in each frame, ``(frames, 3)``, m.

    The target is the smoothed position of the root body.
    """
    data = mujoco.MjData(film.model)
    path = np.empty((len(film.time), 3))
    for point, qpos in zip(path, shot.qpos, strict=True):
        data.qpos = qpos
        mujoco.mj_kinematics(film.model, data)
        point[:] = data.xpos[film.root]
    step = np.median(np.diff(film.time)) if len(film.time) > 1 else SMOOTHING
    reach = min(round(SMOOTHING / step / 2), MAX_SMOOTHED_FRAMES)
    padded = np.pad(path, ((reach, reach), (0, 0)), mode="edge")
    window = np.ones(2 * reach + 1) / (2 * reach + 1)
    smooth = [np.convolve(padded[:, axis], window, mode="valid") for axis in range(3)]
    return np.stack(smooth, axis=1)


def size(film: Film) -> float:
    """Returns the radius of the robot around its root in the reference pose, m."""
    model, data = film.model, mujoco.MjData(film.model)
    mujoco.mj_kinematics(model, data)
    own = model.body_rootid[model.geom_bodyid] == model.body_rootid[film.root]
    distance = np.linalg.norm(data.geom_xpos[own] - data.xpos[film.root], axis=1)
    return float((distance + model.geom_rbound[own]).max(initial=0.1))


def azimuth(film: Film) -> float:
    """Returns the heading of the camera, degrees from the world's x axis.

    The camera is on the side of the detached and jammed bodies; by default on the robot's right,
    with forward to the right.
    """
    model, data = film.model, mujoco.MjData(film.model)
    mujoco.mj_kinematics(model, data)
    wrong = sorted(film.detached | film.jammed)
    left = float((data.xipos[wrong, 1] - data.xpos[film.root, 1]).sum())
    return -ASIDE if left > 0 else ASIDE


def axes(film: Film) -> tuple[FloatArray, FloatArray]:
    """Returns the world directions right and up in a picture, ``(3,)`` each."""
    heading, elevation = np.radians(azimuth(film)), np.radians(ELEVATION)
    right = np.array([np.sin(heading), -np.cos(heading), 0.0])
    ahead = np.array([np.cos(heading), np.sin(heading), 0.0]) * np.cos(elevation)
    ahead[2] = np.sin(elevation)
    return right, np.cross(right, ahead)
