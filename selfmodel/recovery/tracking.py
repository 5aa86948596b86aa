"""Scores of following what is asked: a joint trajectory, or a commanded velocity."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from selfmodel.arrays import FloatArray, mean_of_known
from selfmodel.errors import InputError, typed
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.falls import falls_of
from selfmodel.recovery.scores import TRACKING, VELOCITY, Score
from selfmodel.robot.robot import Robot
from selfmodel.rotation import in_body_frame
from selfmodel.trials.trajectory import Trajectory

VELOCITY_WIDTH = 0.25
"""Squared error of a velocity, (m/s)^2 or (rad/s)^2, at which its reward is 1/e: that of legged_gym
and mujoco_playground."""

TURN_WEIGHT = 0.5
"""Weight of the turn beside that of the velocity forward and to the left: likewise."""


@typed
@dataclass(frozen=True, eq=False)
class Reference:
    """A joint trajectory to follow.

    Attributes:
        hinges: Names of the hinges, at least one.
        time: Seconds since the start of the run, ``(rows,)``, strictly increasing, at least two.
        positions: Joint positions, ``(rows, hinges)``, rad.

    Raises:
        InputError: A shape is inconsistent, a number is not finite, or time does not increase.
    """

    hinges: tuple[str, ...]
    time: FloatArray
    positions: FloatArray

    def __post_init__(self) -> None:
        expected = (len(self.time), len(self.hinges))
        if self.positions.shape != expected or len(self.time) < 2 or not self.hinges:
            raise InputError(
                f"a reference trajectory needs two rows or more, and a column per joint, got "
                f"{self.positions.shape} positions of {len(self.hinges)} joints"
            )
        if not (np.isfinite(self.time).all() and np.isfinite(self.positions).all()):
            raise InputError("a reference trajectory needs finite numbers, and has others")
        if not np.all(np.diff(self.time) > 0):
            raise InputError("the time of a reference trajectory must be strictly increasing")


@typed
def tracking(reference: Reference, robot: Robot) -> Score:
    """Returns the score of following a reference trajectory.

    The score is the negative root mean square error of the joint positions, rad, over the steps
    within the time of the reference and the joints of both the reference and the healthy robot; 0
    is perfect. Between its rows the reference is interpolated linearly. Joints of a limb that is
    detached under a hypothesis are left out, unless no joint would remain; positions that a
    physical robot did not observe are left out.

    Raises:
        InputError: The reference has no joint of the robot, or begins after the first step.
    """
    known = robot.anatomy.hinges
    hinges = tuple(name for name in reference.hinges if name in known)
    if not hinges:
        raise InputError(
            f"the reference trajectory has the joints {', '.join(reference.hinges)}, and "
            f"{robot.name} has {', '.join(known)}: name its columns as the joints"
        )
    if reference.time[0] > 0:
        raise InputError(
            f"the reference trajectory must begin at 0 s or before, got {reference.time[0]:g} s"
        )
    return Score(TRACKING, ("joint_positions",), partial(_tracked, reference, hinges), "rad")


def _tracked(
    reference: Reference,
    hinges: Sequence[str],
    robot: Robot,
    hypothesis: Hypothesis,
    trajectory: Trajectory,
) -> FloatArray:
    """Returns the scores of a batch of runs, ``(n,)``; NaN for a run without any observation."""
    detached = build(robot, hypothesis).detached
    compared = [name for name in hinges if name not in detached] or hinges
    steps = trajectory.time <= reference.time[-1]
    columns = dict(zip(reference.hinges, reference.positions.T, strict=True))
    now = trajectory.time[steps]
    desired = [np.interp(now, reference.time, columns[name]) for name in compared]
    joints = [robot.anatomy.hinges.index(name) for name in compared]
    positions = trajectory["joint_positions"][:, steps][..., joints]
    squares = np.square(positions - np.stack(desired, axis=-1))
    mean = mean_of_known(squares, axis=(1, 2), empty=np.nan)
    return np.asarray(0.0 - np.sqrt(mean))  # not -sqrt: a perfect score is 0, not -0


def following(velocity: Sequence[float]) -> Score:
    """Returns the score of following a commanded velocity, from 0 to 1.

    Each control step before the robot falls earns a reward, and the score is the sum of all over
    the number of steps: 1 is perfect, and a robot that stands still earns what its command leaves.
    The reward is that by which the policies of legged_gym and mujoco_playground are trained:
    ``exp(-e / 0.25)`` of the squared error ``e`` of the velocity forward and to the left, in the
    frame of the base, with the weight 1, and of the turn with 0.5. Steps without a measurement are
    left out.

    Source: Rudin et al., "Learning to walk in minutes using massively parallel deep reinforcement
    learning" (CoRL 2022).

    Args:
        velocity: Forward and to the left, m/s, and the turn to the left, rad/s, ``(3,)``.
    """
    return Score(
        name=VELOCITY,
        record=(
            *("base_linear_velocity", "base_angular_velocity"),
            *("base_orientation", "base_position"),
        ),
        of=partial(_followed, np.array(velocity, dtype=np.float64)),
        grows_with_time=True,
        needs_free_base=True,
        optional=("base_position",),
        ends_at_fall=True,
    )


def _followed(
    commanded: FloatArray, robot: Robot, hypothesis: Hypothesis, trajectory: Trajectory
) -> FloatArray:
    """Returns the scores of a batch of runs, ``(n,)``; NaN for a run without any measurement."""
    body = in_body_frame(trajectory["base_linear_velocity"], trajectory["base_orientation"])
    turn = trajectory["base_angular_velocity"][..., 2]
    error = np.square(body[..., :2] - commanded[:2]).sum(axis=-1)
    rewards = np.exp(-error / VELOCITY_WIDTH)
    rewards += TURN_WEIGHT * np.exp(-np.square(turn - commanded[2]) / VELOCITY_WIDTH)
    before = np.arange(trajectory.steps) < falls_of(robot, hypothesis, trajectory)[..., np.newaxis]
    earned = np.where(before | np.isnan(rewards), rewards, 0.0)
    return mean_of_known(earned / (1 + TURN_WEIGHT), axis=-1, empty=np.nan)
