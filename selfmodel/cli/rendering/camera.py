"""Frames rendered by MuJoCo: one picture per motion, side by side."""

import copy
from collections.abc import Iterator

import mujoco
import numpy as np
from numpy.typing import NDArray

from selfmodel.arrays import FloatArray
from selfmodel.cli.rendering.captions import captioned
from selfmodel.cli.rendering.film import Film
from selfmodel.cli.rendering.view import ELEVATION, azimuth, gaze, size
from selfmodel.robot.visible_geoms import DEFAULT_RGBA, VISUAL_GROUPS, opacity, visible_geoms

WIDTH, HEIGHT = 480, 360
"""Size of a motion's picture, pixels."""

CAMERA_DISTANCE = 2.7
"""Distance of the camera, in sizes of the robot."""

LIGHT_DIRECTION = (0.2, 0.3, -0.93)
"""Direction of the light of a model without directional lights, a unit vector."""

LIGHT = (0.15, 0.45, 0.1)
"""Ambient, diffuse and specular intensity of that light."""

HIDDEN_GROUP = VISUAL_GROUPS
"""Group of the geoms that are not drawn."""

GROUND = (0.42, 0.51, 0.6, 1.0)
"""Colour of ground without a colour, from which a grey robot differs."""

OPAQUE = (0.6, 0.6, 0.6, 1.0)
"""Colour of a transparent geom that is the only one of its body."""

DETACHED = (1.0, 1.0, 1.0, 0.4)
"""Colour of a detached body: red, green, blue, opacity."""

JAMMED = (0.85, 0.15, 0.15, 1.0)
"""Colour of a body at a jammed joint: red, green, blue, opacity."""


def filmed(film: Film) -> Iterator[NDArray[np.uint8]]:
    """Yields each frame, ``(height, width, 3)``.

    The thread's OpenGL context is in use until the last frame.
    """
    model = painted(film)
    data = mujoco.MjData(model)
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation = azimuth(film), ELEVATION
    camera.distance = CAMERA_DISTANCE * size(film)
    targets = [gaze(film, shot) for shot in film.shots]
    lacks_light = not np.any(model.light_type == mujoco.mjtLightType.mjLIGHT_DIRECTIONAL)
    with mujoco.Renderer(model, HEIGHT, WIDTH) as renderer:
        for frame in range(len(film.time)):
            pictures = []
            for shot, target in zip(film.shots, targets, strict=True):
                _set_pose(model, data, shot.qpos[frame])
                camera.lookat[:] = target[frame]
                renderer.update_scene(data, camera)
                if lacks_light:
                    _add_light(renderer.scene)
                pictures.append(captioned(renderer.render(), film, shot, frame))
            yield np.concatenate(pictures, axis=1)


def _set_pose(model: mujoco.MjModel, data: mujoco.MjData, qpos: FloatArray) -> None:
    """Sets a pose and computes the positions of bodies, camera and lights, without a step."""
    data.qpos = qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_camlight(model, data)


def _add_light(scene: mujoco.MjvScene) -> None:
    """Adds light from above to a scene with the light of the camera and spotlights only."""
    light = scene.lights[scene.nlight]
    light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    light.dir[:] = LIGHT_DIRECTION
    light.ambient[:], light.diffuse[:], light.specular[:] = LIGHT
    light.castshadow, light.headlight = 0, 0
    scene.nlight += 1


def painted(film: Film) -> mujoco.MjModel:
    """Returns a copy of the model in which the robot is seen, with its faulty bodies coloured."""
    model = copy.copy(film.model)
    shown = visible_geoms(model)
    model.geom_group[:] = np.where(shown, 0, HIDDEN_GROUP)
    plain = (model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE) & (model.geom_matid < 0)
    plain &= (model.geom_rgba == DEFAULT_RGBA).all(axis=1)
    model.geom_rgba[plain] = GROUND
    unseen = shown & (opacity(model) == 0)
    model.geom_rgba[unseen], model.geom_matid[unseen] = OPAQUE, -1
    # On wide ground, shadows are grainy at any affordable size of the shadow map.
    model.light_castshadow[:] = 0
    model.vis.global_.offwidth = max(model.vis.global_.offwidth, WIDTH)
    model.vis.global_.offheight = max(model.vis.global_.offheight, HEIGHT)
    for bodies, colour in ((film.jammed, JAMMED), (film.detached, DETACHED)):
        geoms = np.isin(model.geom_bodyid, list(bodies))
        sites = np.isin(model.site_bodyid, list(bodies))
        model.geom_rgba[geoms], model.geom_matid[geoms] = colour, -1
        model.site_rgba[sites], model.site_matid[sites] = colour, -1
    return model
