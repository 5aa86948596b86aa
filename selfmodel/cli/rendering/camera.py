"""Frames drawn by MuJoCo: each motion in a picture of its own, side by side."""

import copy
from collections.abc import Iterator

import mujoco
import numpy as np
from numpy.typing import NDArray

from selfmodel.arrays import FloatArray
from selfmodel.cli.rendering.captions import captioned
from selfmodel.cli.rendering.film import Film
from selfmodel.cli.rendering.view import ELEVATION, azimuth, gaze, size

WIDTH, HEIGHT = 480, 360
"""Pixels of each motion's picture."""

FAR = 2.7
"""How far away the camera is, in sizes of the robot."""

GHOST = (1.0, 1.0, 1.0, 0.4)
"""What is left of the colour of a body that fell off: red, green, blue, opacity."""

JAMMED = (0.85, 0.15, 0.15, 1.0)
"""The colour of what a jammed joint holds."""


def filmed(film: Film) -> Iterator[NDArray[np.uint8]]:
    """Draws each frame, ``(height, width, 3)``.

    Nothing else may draw in this thread meanwhile.
    """
    model = painted(film)
    data = mujoco.MjData(model)
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation = azimuth(film), ELEVATION
    camera.distance = FAR * size(film)
    ways = [gaze(film, shot) for shot in film.shots]
    with mujoco.Renderer(model, HEIGHT, WIDTH) as renderer:
        for frame in range(len(film.time)):
            pictures = []
            for shot, way in zip(film.shots, ways, strict=True):
                _stand(model, data, shot.qpos[frame])
                camera.lookat[:] = way[frame]
                renderer.update_scene(data, camera)
                pictures.append(captioned(renderer.render(), film, shot, frame))
            yield np.concatenate(pictures, axis=1)


def _stand(model: mujoco.MjModel, data: mujoco.MjData, qpos: FloatArray) -> None:
    """Puts the robot there, as far as it is seen: nothing is simulated."""
    data.qpos = qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_camlight(model, data)


def painted(film: Film) -> mujoco.MjModel:
    """Returns a copy of the model in the colours of what is wrong with it."""
    model = copy.copy(film.model)
    # On wide ground, shadows are grainy at any size that a program that draws can afford.
    model.light_castshadow[:] = 0
    model.vis.global_.offwidth = max(model.vis.global_.offwidth, WIDTH)
    model.vis.global_.offheight = max(model.vis.global_.offheight, HEIGHT)
    for bodies, colour in ((film.jammed, JAMMED), (film.lost, GHOST)):
        geoms = np.isin(model.geom_bodyid, list(bodies))
        sites = np.isin(model.site_bodyid, list(bodies))
        model.geom_rgba[geoms], model.geom_matid[geoms] = colour, -1
        model.site_rgba[sites], model.site_matid[sites] = colour, -1
    return model
