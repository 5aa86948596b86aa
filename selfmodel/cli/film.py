"""A film: the poses of one robot in several motions at the times of the frames, drawn by MuJoCo."""

import copy
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.faults.build import build, detached_bodies, jammed_bodies
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.robot import motion
from selfmodel.robot.robot import Robot
from selfmodel.trials.trajectory import Trajectory

WIDTH, HEIGHT = 480, 360
"""Size of a motion's picture, pixels."""

ASIDE, ELEVATION = 65.0, -22.0
"""Azimuth of the camera from the robot's heading, and elevation, degrees: from the side, a little
from behind and above."""

CAMERA_DISTANCE = 2.7
"""Distance of the camera, in sizes of the robot."""

SMOOTHING = 0.5
"""Time over which the camera's path is averaged, s, so that it does not sway at each step."""

LIGHT_DIRECTION, LIGHT = (0.2, 0.3, -0.93), (0.15, 0.45, 0.1)
"""Light of a model without a directional one: unit vector; ambient, diffuse, specular intensity."""

GROUND, OPAQUE = (0.42, 0.51, 0.6, 1.0), (0.6, 0.6, 0.6, 1.0)
"""Colours of ground without a colour, and of a transparent geom that is the only one of a body."""

DETACHED, JAMMED = (1.0, 1.0, 1.0, 0.4), (0.85, 0.15, 0.15, 1.0)
"""Colours of a detached body, and of one at a jammed joint: red, green, blue, opacity."""

INK, ALARM, PAPER = (20, 24, 30), (190, 20, 20), (255, 255, 255, 150)
FONT_SIZE, LINE_LENGTH = 16, 54
"""Of captions: pixels, and most characters of a line."""


@dataclass(frozen=True, eq=False)
class Shot:
    """One motion of a film.

    Attributes:
        qpos: Positions of the model, ``(frames, nq)``.
        held: Frames that show the last observation of a missing one, ``(frames,)``.
        forward: Displacement of the base along the world's x axis, ``(frames,)``, m.
    """

    title: str
    qpos: FloatArray
    held: BoolArray
    forward: FloatArray


@dataclass(frozen=True, eq=False)
class Film:
    """Motions of one robot side by side.

    Attributes:
        root: Id of the body that the camera follows.
        detached: Ids of the detached bodies.
        jammed: Ids of the bodies at a jammed joint.
        time: Time since the start, ``(frames,)``, s.
        missing: Names of hinges and signals without any observation.
        normal: Unit normal of the ground, ``(3,)``.
    """

    model: mujoco.MjModel
    root: int
    detached: frozenset[int]
    jammed: frozenset[int]
    time: FloatArray
    shots: tuple[Shot, ...]
    missing: tuple[str, ...]
    normal: FloatArray

    def gaze(self, shot: Shot) -> FloatArray:
        """Returns the target of the camera, the smoothed root body, ``(frames, 3)``, m."""
        path = motion.body_poses(mujoco.MjData(self.model), shot.qpos)[:, self.root, :3]
        duration = self.time[-1] - self.time[0]
        share = SMOOTHING * (len(path) - 1) / duration if duration > 0 else 0.0
        reach = min(round(share / 2), len(path))
        padded = np.pad(path, ((reach, reach), (0, 0)), mode="edge")
        window = np.ones(2 * reach + 1) / (2 * reach + 1)
        return np.stack([np.convolve(axis, window, mode="valid") for axis in padded.T], axis=1)

    @property
    def own(self) -> BoolArray:
        """Whether each geom is of the robot, ``(ngeom,)``."""
        roots = self.model.body_rootid
        return np.asarray(roots[self.model.geom_bodyid] == roots[self.root])

    @property
    def size(self) -> float:
        """Radius of the robot around its root in the reference pose, m."""
        data = self._standing()
        distance = np.linalg.norm(data.geom_xpos[self.own] - data.xpos[self.root], axis=1)
        return float((distance + self.model.geom_rbound[self.own]).max(initial=0.1))

    @property
    def azimuth(self) -> float:
        """Heading of the camera, degrees from the world's x axis.

        The camera is on the side of the detached and jammed bodies; by default on the robot's
        right, with forward to the right.
        """
        data = self._standing()
        wrong = sorted(self.detached | self.jammed)
        left = float((data.xipos[wrong, 1] - data.xpos[self.root, 1]).sum())
        return -ASIDE if left > 0 else ASIDE

    @property
    def plane(self) -> FloatArray:
        """Projection from the world to right and up in a picture, ``(3, 2)``."""
        heading, elevation = np.radians(self.azimuth), np.radians(ELEVATION)
        right = np.array([np.sin(heading), -np.cos(heading), 0.0])
        ahead = np.array([np.cos(heading), np.sin(heading), 0.0]) * np.cos(elevation)
        ahead[2] = np.sin(elevation)
        return np.stack([right, np.cross(right, ahead)], axis=1)

    def caption(self, shot: Shot, frame: int) -> str:
        """Returns the time and the forward displacement of the base, as text."""
        forward = shot.forward[frame]
        moved = f"{forward:z.2f} m forward" if np.isfinite(forward) else "base not observed"
        return f"{self.time[frame]:.2f} s   {moved}"

    def _standing(self) -> mujoco.MjData:
        data = mujoco.MjData(self.model)
        mujoco.mj_kinematics(self.model, data)
        return data


def film_of(
    robot: Robot,
    hypothesis: Hypothesis,
    motions: Sequence[tuple[str, Trajectory]],
    moments: FloatArray,
) -> Film:
    """Returns the film of some motions by title, all with the same times.

    The detached and jammed bodies of the hypothesis are marked. The moments are times of frames,
    s; a frame shows the last step at or before its time.
    """
    variant = build(robot, hypothesis)
    model, time = variant.model, motions[0][1].time
    # 1e-9 s: a time that equals a step but for rounding shows that step.
    steps = np.searchsorted(time, moments + 1e-9, side="right") - 1
    shots: list[Shot] = []
    missing: list[str] = []
    for title, trajectory in motions:
        poses = motion.poses_of(robot, model, trajectory)
        known = poses.forward[np.isfinite(poses.forward)]
        forward = poses.forward - (known[0] if len(known) else np.nan)
        shots.append(Shot(title, poses.qpos[steps], poses.held[steps], forward[steps]))
        missing += poses.missing
    return Film(
        model=model,
        root=int(model.body(robot.root).id),
        detached=detached_bodies(robot.anatomy, model, hypothesis),
        jammed=jammed_bodies(robot.anatomy, model, hypothesis),
        time=time[steps],
        shots=tuple(shots),
        missing=tuple(missing),
        normal=variant.normal,
    )


def evenly(time: FloatArray, pictures: int) -> FloatArray:
    """Returns distinct times among those of the steps, from the first to the last."""
    return np.asarray(time[np.unique(np.linspace(0, len(time) - 1, pictures).astype(int))])


def filmed(film: Film) -> Iterator[NDArray[np.uint8]]:
    """Yields each frame as MuJoCo renders it, ``(height, width, 3)``: the motions side by side.

    The thread's OpenGL context is in use until the last frame.
    """
    model = painted(film)
    data = mujoco.MjData(model)
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation = film.azimuth, ELEVATION
    camera.distance = CAMERA_DISTANCE * film.size
    targets = [film.gaze(shot) for shot in film.shots]
    lacks_light = not np.any(model.light_type == mujoco.mjtLightType.mjLIGHT_DIRECTIONAL)
    with mujoco.Renderer(model, HEIGHT, WIDTH) as renderer:
        for frame in range(len(film.time)):
            pictures = []
            for shot, target in zip(film.shots, targets, strict=True):
                data.qpos = shot.qpos[frame]
                # The positions of bodies, camera and lights, without a step.
                mujoco.mj_kinematics(model, data)
                mujoco.mj_comPos(model, data)
                mujoco.mj_camlight(model, data)
                camera.lookat[:] = target[frame]
                renderer.update_scene(data, camera)
                if lacks_light:
                    _add_light(renderer.scene)
                pictures.append(_captioned(renderer.render(), film, shot, frame))
            yield np.concatenate(pictures, axis=1)


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
    shown = motion.visible_geoms(model)
    model.geom_group[:] = np.where(shown, 0, motion.VISUAL_GROUPS)
    plain = (model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE) & (model.geom_matid < 0)
    plain &= (model.geom_rgba == motion.DEFAULT_RGBA).all(axis=1)
    model.geom_rgba[plain] = GROUND
    unseen = shown & (motion.opacity(model) == 0)
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


def _captioned(picture: NDArray[np.uint8], film: Film, shot: Shot, frame: int) -> NDArray[np.uint8]:
    """Returns the picture of one motion with its title, the time and the displacement."""
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image, "RGBA")
    font = ImageFont.load_default(FONT_SIZE)
    texts = [
        (6, "\n".join(textwrap.wrap(shot.title, LINE_LENGTH)), INK),
        (image.height - FONT_SIZE - 10, film.caption(shot, frame), INK),
    ]
    if shot.held[frame]:
        top = image.height - 2 * FONT_SIZE - 18
        texts.append((top, "not observed: last known pose", ALARM))
    for y, text, colour in texts:
        left, upper, right, lower = draw.multiline_textbbox((8, y), text, font=font)
        draw.rectangle((left - 4, upper - 3, right + 4, lower + 3), fill=PAPER)
        draw.multiline_text((8, y), text, font=font, fill=colour)
    return np.asarray(image)
