"""Data of a film: the poses of one robot in several motions, at the times of the frames."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.faults.build import build, detached_bodies, jammed_bodies
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import poses_of, with_known_base
from selfmodel.trials.behaviour import Behaviour


@dataclass(frozen=True, eq=False)
class Shot:
    """One motion of a film.

    Attributes:
        title: Title of the motion.
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
        model: Model of the hypothesis.
        root: Id of the body that the camera follows.
        detached: Ids of the detached bodies.
        jammed: Ids of the bodies at a jammed joint.
        time: Time since the start, ``(frames,)``, s.
        shots: The motions.
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


def film_of(
    robot: Robot,
    hypothesis: Hypothesis,
    motions: Sequence[tuple[str, Behaviour]],
    moments: FloatArray,
) -> Film:
    """Returns the film of some motions.

    Args:
        robot: The healthy robot.
        hypothesis: Hypothesis whose detached and jammed bodies are marked.
        motions: Title and behaviour of each motion, all with the same times.
        moments: Times of the frames, ``(frames,)``, s; a frame shows the last step at or before its
            time.
    """
    embodiment = build(robot, hypothesis)
    model = embodiment.model
    time = motions[0][1].time
    # 1e-9 s: a time that equals a step but for rounding shows that step.
    steps = np.searchsorted(time, moments + 1e-9, side="right") - 1
    shots: list[Shot] = []
    missing: list[str] = []
    for title, motion in motions:
        behaviour = with_known_base(robot, motion)
        poses = poses_of(robot, model, behaviour)
        x = behaviour["base_position"][:, 0]
        start = x[np.isfinite(x)][:1]
        forward = x - start if len(start) else np.full(len(x), np.nan)
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
        normal=embodiment.normal,
    )


def evenly(time: FloatArray, pictures: int) -> FloatArray:
    """Returns distinct times of a trial, evenly spaced from its first step to its last.

    Args:
        time: Times of the steps, ``(steps,)``, s.
        pictures: Number of times, at most the number of steps.
    """
    return np.asarray(time[np.unique(np.linspace(0, len(time) - 1, pictures).astype(int))])
