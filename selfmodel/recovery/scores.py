"""Scores of rollouts and trials: the fitness of a repair.

Built-in scores are ``DISPLACEMENT``, ``UPRIGHT``, ``ENERGY``, ``upright_within`` limits and
``tracking``; any other ``Score`` works as well.
"""

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.errors import InputError
from selfmodel.faults.build import build, detached_bodies
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.falls import falls_of, first_lasting, steps_of
from selfmodel.robot.robot import Robot
from selfmodel.robot.self_collision import penetration_depths
from selfmodel.simulation.rollout import SimulationResult
from selfmodel.trials.behaviour import Behaviour, forward_displacement
from selfmodel.trials.signals import SIGNALS, Signal
from selfmodel.trials.trial import Trial

WORK_WEIGHT = 0.1
"""Metres that a work of the robot's weight times a metre costs: a gait with a cost of transport of
3, that of a fast legged robot, keeps 70 % of its displacement."""

COLLISION_TIME = 0.05
"""Time over which a self-collision is judged, s: two bodies are too deep in each other in more than
half of the measurements. Wrong measurements of single steps are shorter; legs that pass through
each other at the pace of a walk are longer."""

TRACKING = "tracking"
"""Name of the score."""

LARGEST = 1e10
"""Magnitude above which MuJoCo takes a simulation as diverged."""


@dataclass(frozen=True)
class Score:
    """A fitness function of rollouts, to be maximised.

    Attributes:
        name: Name of the score.
        record: Signals that the score is computed from.
        of: Function of a healthy robot, a hypothesis and the behaviour of a batch of rollouts,
            ``(n, steps, width)`` per signal, that returns the scores, ``(n,)``. The score of a
            rollout does not depend on the other rollouts of the batch.
        unit: Unit of the score; "" for none.
        grows_with_time: Whether rollouts of half the steps rank controllers approximately as whole
            ones do, so that a search may begin with them.
        needs_free_base: Whether the score is a displacement of the base, which a fixed base does
            not have.
    """

    name: str
    record: tuple[Signal, ...]
    of: Callable[[Robot, Hypothesis, Behaviour], FloatArray]
    unit: str = ""
    grows_with_time: bool = False
    needs_free_base: bool = False

    def of_trial(self, robot: Robot, hypothesis: Hypothesis, trial: Trial) -> float:
        """Returns the score of a physical trial; NaN where its signals were not observed.

        Args:
            robot: The healthy robot.
            hypothesis: Faults of the physical robot.
            trial: The trial.
        """
        logged = trial.behaviour
        signals = {signal: logged[signal][np.newaxis] for signal in self.record}
        batch = Behaviour(logged.names, logged.time, signals)
        return float(self.of(robot, hypothesis, batch)[0])


def scores_of(
    score: Score,
    robot: Robot,
    hypothesis: Hypothesis,
    outcome: SimulationResult,
    column: int | None = None,
) -> FloatArray:
    """Returns the scores of simulated rollouts, ``(n,)``; negative infinity for a diverged one.

    Args:
        score: The score.
        robot: The healthy robot.
        hypothesis: Faults of the robot.
        outcome: The rollouts, ``(n,)`` or ``(n, columns)``.
        column: Column of the rollouts; None for those without columns.
    """
    diverged = outcome.diverged if column is None else outcome.diverged[:, column]
    scores, rows = np.full(len(diverged), -np.inf), ~diverged
    if rows.any():
        which = rows if column is None else (rows, column)
        simulated = outcome.behaviour
        signals = {name: values[which] for name, values in simulated.signals.items()}
        behaviour = Behaviour(simulated.names, simulated.time, signals)
        scores[rows] = score.of(robot, hypothesis, behaviour)
    return scores


def _displacement(_robot: Robot, _hypothesis: Hypothesis, behaviour: Behaviour) -> FloatArray:
    return forward_displacement(behaviour)


DISPLACEMENT = Score(
    "displacement",
    ("base_position",),
    _displacement,
    unit="m",
    grows_with_time=True,
    needs_free_base=True,
)
"""Forward displacement, m. Source: the paper, section III."""


def _displacement_until_a_fall(
    robot: Robot, hypothesis: Hypothesis, behaviour: Behaviour
) -> FloatArray:
    x = behaviour["base_position"][..., 0]
    last = np.maximum(falls_of(robot, hypothesis, behaviour) - 1, 0)
    end = np.take_along_axis(x, last[..., np.newaxis], axis=-1)[..., 0]
    return np.asarray(end - x[..., 0])


UPRIGHT = Score(
    "upright",
    ("base_position", "base_orientation"),
    _displacement_until_a_fall,
    unit="m",
    grows_with_time=True,
    needs_free_base=True,
)
"""Forward displacement up to the last step before the robot falls, m.

A robot has fallen at the first step from which its base is, for most of ``FALLEN_TIME`` (near the
end, of the last ``FALLEN_TIME`` of the run), tilted by more than ``FALLEN_TILT`` from its initial
orientation, or lower than ``FALLEN_HEIGHT`` of its standing height. What follows a fall counts
nothing: a controller that tips the robot over and crawls on its back earns what it walked before.
"""


def joint_work(robot: Robot, behaviour: Behaviour) -> FloatArray:
    """Returns the mechanical work of the joints, J, ``(...)``: work on a motor counts as spent.

    Args:
        robot: The robot, for its control time step.
        behaviour: Efforts and velocities of the joints, ``(..., steps, hinges)`` each; single NaN
            count as 0, and the work of a run without any number is NaN.
    """
    power = np.abs(behaviour["joint_efforts"] * behaviour["joint_velocities"])
    observed = np.isfinite(power).any(axis=(-2, -1))
    work = np.nansum(power, axis=(-2, -1)) * robot.control_timestep
    return np.asarray(np.where(observed, work, np.nan))


def _upright_less_work(robot: Robot, hypothesis: Hypothesis, behaviour: Behaviour) -> FloatArray:
    model = build(robot, hypothesis).model
    weight = float(model.body_mass.sum() * np.linalg.norm(model.opt.gravity))
    cost = joint_work(robot, behaviour) / weight if weight else 0.0
    return np.asarray(UPRIGHT.of(robot, hypothesis, behaviour) - WORK_WEIGHT * cost)


ENERGY = Score(
    "energy",
    ("base_position", "base_orientation", "joint_efforts", "joint_velocities"),
    _upright_less_work,
    unit="m",
    needs_free_base=True,
)
"""Displacement up to the first fall, m, less ``WORK_WEIGHT`` times the work over the weight, m.

The work over the weight and the distance is the cost of transport (Gabrielli and von Karman, *What
price speed?*, 1950).
"""


def upright_within(
    max_speed: float = math.inf,
    max_torque: float = math.inf,
    max_self_collision: float = math.inf,
) -> Score:
    """Returns the displacement up to the first fall or self-collision, in steps within limits.

    Forward displacement counts in the control steps in which all joints are within the limits,
    backward displacement in all. A gait that needs more than the motors of a robot are to give is
    worth what it walks without. From a self-collision on nothing counts, as from a fall on: a robot
    does not go on with a leg in the place of another.

    Args:
        max_speed: Largest speed of a joint, rad/s; m/s for a slide joint.
        max_torque: Largest torque of a joint, N m; N for a slide joint.
        max_self_collision: Largest depth to which two bodies of the robot penetrate each other, by
            its joint positions, m; see ``penetration_depths`` for the bodies that are compared. A
            self-collision is the first step from which, for most of ``COLLISION_TIME``, two are
            deeper in each other.

    Raises:
        ValueError: The limit of speed or torque is not above 0, or that of the depth is below 0.
    """
    if not (max_speed > 0 and max_torque > 0 and max_self_collision >= 0):
        raise ValueError(
            f"expected limits above 0, and a depth of 0 or above, got {max_speed}, {max_torque} "
            f"and {max_self_collision}"
        )
    compares_bodies = math.isfinite(max_self_collision)

    def of(robot: Robot, hypothesis: Hypothesis, behaviour: Behaviour) -> FloatArray:
        moved = np.diff(_held(behaviour["base_position"][..., 0]), axis=-1)
        # A joint that has come off lies on the ground, and is not the robot's.
        detached = build(robot, hypothesis).detached
        own = [j for j, name in enumerate(robot.anatomy.hinges) if name not in detached]
        over = _over(behaviour["joint_velocities"][..., own], max_speed)
        over |= _over(behaviour["joint_efforts"][..., own], max_torque)
        counted = np.where(over[..., 1:], np.minimum(moved, 0.0), moved)
        end = falls_of(robot, hypothesis, behaviour)
        if compares_bodies:
            deep = _depths(robot, hypothesis, behaviour) > max_self_collision
            steps = steps_of(COLLISION_TIME, behaviour)
            end = np.minimum(end, first_lasting(deep, ~deep, steps))
        before = np.arange(1, behaviour.steps) < end[..., np.newaxis]
        return np.asarray(np.where(before, counted, 0.0).sum(axis=-1))

    limits = [
        f"{limit:g} {unit}"
        for limit, unit in (
            (max_speed, "rad/s"),
            (max_torque, "N m"),
            (max_self_collision, "m of self-collision"),
        )
        if math.isfinite(limit)
    ]
    name = " ".join([UPRIGHT.name, *(["within", " and ".join(limits)] if limits else [])])
    record = (*UPRIGHT.record, "joint_velocities", "joint_efforts")
    signals = (*record, "joint_positions") if compares_bodies else record
    return Score(name, signals, of, unit="m", grows_with_time=True, needs_free_base=True)


def _depths(robot: Robot, hypothesis: Hypothesis, behaviour: Behaviour) -> FloatArray:
    """Returns the depth of self-collision at each step, m, ``(..., steps)``.

    A joint without a measurement is where it was last measured, or else in the initial pose.

    Args:
        robot: The healthy robot.
        hypothesis: Faults of the robot: detached bodies do not count, and encoders have offsets.
        behaviour: Joint positions, ``(..., steps, hinges)``.
    """
    logged = np.moveaxis(_held(np.moveaxis(behaviour["joint_positions"], -1, -2)), -2, -1)
    angles = logged - build(robot, hypothesis).encoder_offset
    initial = [float(robot.model.joint(name).qpos0[0]) for name in robot.anatomy.hinges]
    poses = np.where(np.isfinite(angles), angles, initial)
    lost = detached_bodies(robot.anatomy, robot.model, hypothesis)
    depths = penetration_depths(robot, poses.reshape(-1, len(initial)), lost)
    return depths.reshape(poses.shape[:-1])


def _held(values: FloatArray) -> FloatArray:
    """Returns values with those that are not known replaced by the last known one.

    Args:
        values: ``(..., steps)``; NaN where not known. It remains where none is known before.
    """
    steps = np.where(np.isfinite(values), np.arange(values.shape[-1]), 0)
    return np.take_along_axis(values, np.maximum.accumulate(steps, axis=-1), axis=-1)


def _over(values: FloatArray, limit: float) -> BoolArray:
    """Returns whether the value of a joint is over a limit, ``(..., steps)``; NaN is not."""
    return np.asarray((np.abs(values) > limit).any(axis=-1))


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
    within the time of the reference and the joints of both the reference and the robot; 0 is
    perfect. Between its rows the reference is interpolated linearly. Joints of a limb that is
    detached under a hypothesis are left out, unless no joint would remain; positions that a
    physical robot did not observe are left out.

    Args:
        reference: The trajectory.
        robot: The healthy robot.

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
    behaviour: Behaviour,
) -> FloatArray:
    """Returns the scores of a batch of runs, ``(n,)``; NaN for a run without any observation."""
    detached = build(robot, hypothesis).detached
    compared = [name for name in hinges if name not in detached] or hinges
    steps = behaviour.time <= reference.time[-1]
    wanted = np.stack(
        [
            np.interp(
                behaviour.time[steps],
                reference.time,
                reference.positions[:, reference.hinges.index(name)],
            )
            for name in compared
        ],
        axis=-1,
    )
    columns = [robot.anatomy.hinges.index(name) for name in compared]
    squares = np.square(behaviour["joint_positions"][:, steps][..., columns] - wanted)
    observed = np.isfinite(squares)
    count = observed.sum(axis=(1, 2))
    total = np.where(observed, squares, 0.0).sum(axis=(1, 2))
    mean = np.divide(total, count, out=np.full(len(total), np.nan), where=count > 0)
    return np.asarray(0.0 - np.sqrt(mean))  # not -sqrt: a perfect score is 0, not -0


def checked(score: Score, name: str) -> Score:
    """Returns a score whose signals and values are checked.

    Args:
        score: Score from a plug-in.
        name: Name of the plug-in, for the messages.

    Raises:
        InputError: ``record`` is no tuple of known signals. A call of the new score raises it if
            the function reads another signal, or returns other than one number per run.
    """
    record = score.record
    if not isinstance(record, tuple) or not record or any(one not in SIGNALS for one in record):
        raise InputError(
            f"the score {name!r} has record={record!r}: expected a tuple of one or more of "
            f"{', '.join(SIGNALS)}; correct `record` of the score"
        )
    return dataclasses.replace(score, of=partial(_checked, score, name))


def _checked(
    score: Score, name: str, robot: Robot, hypothesis: Hypothesis, behaviour: Behaviour
) -> FloatArray:
    runs = len(behaviour[score.record[0]])
    expected = f"the score {name!r}: expected one number for each of {runs} runs"
    try:
        found: object = score.of(robot, hypothesis, behaviour)
    except KeyError as error:
        if "was not recorded" not in str(error):
            raise
        raise InputError(
            f"the score {name!r} reads a signal that it does not name: {error.args[0]}; add the "
            f"signal to `record` of the score"
        ) from error
    try:
        values = np.asarray(found, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{expected}, got {type(found).__name__} ({error}); return an array of numbers from "
            f"`of` of the score"
        ) from error
    if values.shape != (runs,):
        raise InputError(
            f"{expected}, an array of shape ({runs},), got shape {values.shape}; `of` of the score "
            f"gets signals of shape (runs, steps, width): sum over the steps, not over the runs"
        )
    wrong = np.isnan(values) | np.isposinf(values)
    if wrong.any() and (wrong := wrong & _known(score, behaviour)).any():
        raise InputError(
            f"{expected}, got {values[wrong][0]:g} for {wrong.sum()} of them, whose signals are "
            f"all finite; return a number, the lowest for the worst run, from `of` of the score"
        )
    return values


def _known(score: Score, behaviour: Behaviour) -> BoolArray:
    """Returns the runs that were observed whole and did not diverge, ``(n,)``."""
    signals = [np.abs(behaviour[signal]) <= LARGEST for signal in score.record]
    return np.asarray(np.all([values.all(axis=(1, 2)) for values in signals], axis=0))
