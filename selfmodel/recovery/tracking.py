"""The score of following a joint trajectory."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from selfmodel.arrays import FloatArray, mean_of_known
from selfmodel.errors import InputError
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.scores import TRACKING, Score
from selfmodel.robot.robot import Robot
from selfmodel.trials.trajectory import Trajectory


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
