"""What is drawn of a trial: one body in two motions, at some moments."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.cli.rendering.poses import poses_of
from selfmodel.faults.broken import BROKEN
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.jammed import JAMMED, JAMMED_AT_ANGLE
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import Behaviour


@dataclass(frozen=True, eq=False)
class Shot:
    """One motion.

    Attributes:
        title: Whose it is.
        qpos: ``(frames, nq)`` positions of the model.
        held: ``(frames,)`` where the picture shows what was seen last.
        forward: ``(frames,)`` how far the base has come along the world's x axis, m.
    """

    title: str
    qpos: FloatArray
    held: BoolArray
    forward: FloatArray


@dataclass(frozen=True, eq=False)
class Film:
    """Motions of one body side by side.

    Attributes:
        model: The robot with what is taken to be wrong with it.
        root: The body that is followed.
        lost: The bodies that fell off.
        jammed: The bodies that a jammed joint holds.
        time: ``(frames,)`` seconds since the start.
        shots: The motions.
        missing: What was not observed at all.
        normal: Unit vector that stands on the ground, ``(3,)``.
    """

    model: mujoco.MjModel
    root: int
    lost: frozenset[int]
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
    """Returns what is to be drawn.

    Args:
        robot: The robot with nothing wrong.
        hypothesis: What is taken to be wrong: nothing in a log says so.
        motions: A title and the motion under it, all with the same times.
        moments: ``(frames,)`` seconds: of each, the last step that was not later is drawn.
    """
    embodiment = build(robot, hypothesis)
    model = embodiment.model
    time = motions[0][1].time
    # A moment that is a step but for rounding is that step.
    steps = np.searchsorted(time, moments + 1e-9, side="right") - 1
    shots: list[Shot] = []
    missing: list[str] = []
    for title, behaviour in motions:
        poses = poses_of(robot, model, behaviour)
        x = behaviour["base_position"][:, 0]
        start = x[np.isfinite(x)][:1]
        forward = x - start if len(start) else np.full(len(x), np.nan)
        shots.append(Shot(title, poses.qpos[steps], poses.held[steps], forward[steps]))
        missing += poses.missing
    return Film(
        model=model,
        root=int(model.body(robot.root).id),
        lost=_bodies(robot, model, hypothesis, lost=True),
        jammed=_bodies(robot, model, hypothesis, lost=False),
        time=time[steps],
        shots=tuple(shots),
        missing=tuple(missing),
        normal=embodiment.normal,
    )


def evenly(time: FloatArray, pictures: int) -> FloatArray:
    """Returns moments of a trial, evenly spread from its first step to its last, none twice.

    Args:
        time: ``(steps,)`` seconds.
        pictures: How many, where there are so many steps.
    """
    return np.asarray(time[np.unique(np.linspace(0, len(time) - 1, pictures).astype(int))])


def _bodies(
    robot: Robot, model: mujoco.MjModel, hypothesis: Hypothesis, *, lost: bool
) -> frozenset[int]:
    """The bodies that a hypothesis says are lost, or held by a joint that jammed."""
    found: set[int] = set()
    for fault in hypothesis.faults:
        if fault.kind is BROKEN and lost:
            found |= {int(model.body(name).id) for name in robot.anatomy.joint(fault.part).bodies}
        elif fault.kind in (JAMMED, JAMMED_AT_ANGLE) and not lost:
            hinges = robot.anatomy.joint(fault.part).hinges
            found |= {int(model.joint(hinge).bodyid[0]) for hinge in hinges}
    return frozenset(found)
