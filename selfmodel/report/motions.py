"""Motions of a robot in a page: the pose of every body over time, by forward kinematics."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.faults.build import build, detached_bodies, jammed_bodies
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.report.encoding import quantised
from selfmodel.report.scene import bodies_of
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import poses_of, with_known_base
from selfmodel.trials.behaviour import Behaviour

MAX_POSES = 400_000
"""Poses of single bodies in a report, over all motions and frames: 14 bytes each, before base64."""


@dataclass(frozen=True, eq=False)
class Motion:
    """One motion of the robot.

    Attributes:
        name: Name in the legend, such as ``measured``.
        hypothesis: Faults of the robot in this motion; of the measured robot, those of the best
            hypothesis.
        behaviour: The motion, with the signals of a pose.
    """

    name: str
    hypothesis: Hypothesis
    behaviour: Behaviour


@dataclass(frozen=True, eq=False)
class TrialMotions:
    """The motions of one trial.

    Attributes:
        name: Name of the trial.
        motions: The measured motion, then the simulated ones.
        mark: Time of a change of the robot, s; None without one.
    """

    name: str
    motions: tuple[Motion, ...]
    mark: float | None = None


def motions_as_json(robot: Robot, shots: Sequence[TrialMotions]) -> list[dict[str, Any]]:
    """Returns the motions of trials as JSON values.

    Steps are left out where a report would be too large; the first and the last remain.

    Args:
        robot: The robot, with the bodies of ``scene.geometry_of``.
        shots: The trials.
    """
    bodies = bodies_of(robot)
    poses = sum(shot.motions[0].behaviour.steps * len(shot.motions) for shot in shots) * len(bodies)
    stride = max(1, -(-poses // MAX_POSES))
    return [_shot(robot, bodies, shot, stride) for shot in shots]


def _shot(robot: Robot, bodies: IndexArray, shot: TrialMotions, stride: int) -> dict[str, Any]:
    time = shot.motions[0].behaviour.time
    steps = np.unique(np.append(np.arange(0, len(time), stride), len(time) - 1))
    return {
        "name": shot.name,
        "time": [float(one) for one in time[steps]],
        "mark": shot.mark,
        "motions": [_motion(robot, bodies, motion, steps) for motion in shot.motions],
    }


def _motion(robot: Robot, bodies: IndexArray, motion: Motion, steps: IndexArray) -> dict[str, Any]:
    model = build(robot, motion.hypothesis).model
    index = {int(body): i for i, body in enumerate(bodies)}
    behaviour = with_known_base(robot, motion.behaviour)
    # A welded hinge has its own rotation in the hypothesis's model; the geometry is the robot's.
    poses = poses_of(robot, robot.model, behaviour)
    qpos = poses.qpos[steps]
    position, rotation = _body_poses(robot.model, qpos, bodies)
    hinges = [int(robot.model.joint(name).qposadr[0]) for name in robot.anatomy.hinges]
    detached = detached_bodies(robot.anatomy, model, motion.hypothesis)
    jammed = jammed_bodies(robot.anatomy, model, motion.hypothesis)
    return {
        "name": motion.name,
        "hypothesis": str(motion.hypothesis),
        "position": quantised(position.reshape(len(steps) * len(bodies), 3)),
        "rotation": quantised(rotation.reshape(len(steps) * len(bodies), 4)),
        "angles": quantised(qpos[:, hinges]),
        "missing": list(poses.missing),
        "held": [int(one) for one in np.flatnonzero(poses.held[steps])],
        "detached": sorted(index[body] for body in detached),
        "jammed": sorted(index[body] for body in jammed),
        "travelled": [float(one) for one in behaviour["base_position"][steps, 0]],
    }


def _body_poses(
    model: mujoco.MjModel, qpos: FloatArray, bodies: IndexArray
) -> tuple[FloatArray, FloatArray]:
    """Returns positions, ``(frames, bodies, 3)`` m, and quaternions, ``(frames, bodies, 4)``."""
    data = mujoco.MjData(model)
    position = np.empty((len(qpos), len(bodies), 3))
    rotation = np.empty((len(qpos), len(bodies), 4))
    for frame, own in enumerate(qpos):
        data.qpos[:] = own
        mujoco.mj_kinematics(model, data)
        position[frame], rotation[frame] = data.xpos[bodies], data.xquat[bodies]
    return position, rotation
