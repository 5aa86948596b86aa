"""Scores of rollouts and trials: the fitness of a repair.

A further one is a ``Score`` with its function, its row in ``SCORES``, and its name on the help
page, ``cli/options.toml``; ``upright_within`` limits and ``tracking`` take an argument, and the sum
of a task's rewards is in ``selfmodel.tasks``. Any other ``Score`` works as well. One that cannot be
measured on a physical robot is refused before the first trial (``check_measurable``).
"""

import dataclasses
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, held
from selfmodel.errors import InputError, typed
from selfmodel.faults.build import build, detached_bodies
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.physical.interface import ObservedRobot, PhysicalRobot
from selfmodel.recovery.falls import falls_of, first_lasting, steps_in
from selfmodel.robot.contacts import penetration_depths
from selfmodel.robot.robot import Robot
from selfmodel.rotation import headings
from selfmodel.simulation.rollout import SimulationResult
from selfmodel.trials.signals import SIGNALS, Signal
from selfmodel.trials.trajectory import NotRecordedError, Trajectory, forward_displacement
from selfmodel.trials.trial import Trial

TRACKING = "tracking"
"""Name of the score of following a joint trajectory (``recovery.tracking``)."""

VELOCITY = "velocity"
"""Name of the score of following the commanded velocity of a policy (``recovery.tracking``)."""

COLLISION_TIME = 0.05
"""Time over which a self-collision is judged, s: two bodies are too deep in each other in more than
half of the measurements. Wrong measurements of single steps are shorter; legs that pass through
each other at the pace of a walk are longer."""

STEP_TIME, STANDS, SWINGS = 0.1, 0.75, 0.25
"""Time over which a foot's contact is averaged, s, and the shares of it above which the foot stands
and below which it swings; in between it goes on as before. A bounce, a tremor and a wrong reading
are no step."""

WORK_WEIGHT = 0.1
"""Metres that a work of the robot's weight times a metre costs: a gait with a cost of transport of
3, that of a fast legged robot, keeps 70 % of its displacement."""

LARGEST = 1e10
"""Magnitude above which MuJoCo takes a simulation as diverged."""


@typed
@dataclass(frozen=True)
class Score:
    """A fitness function of rollouts, to be maximised.

    Attributes:
        name: Name of the score.
        record: Signals that the score is computed from.
        of: Function of a healthy robot, a hypothesis and the trajectory of a batch of rollouts,
            ``(n, steps, width)`` per signal, that returns the scores, ``(n,)``. The score of a
            rollout does not depend on the other rollouts of the batch.
        unit: Unit of the score; "" for none.
        grows_with_time: Whether rollouts of half the steps rank controllers approximately as whole
            ones do, so that a search may begin with them.
        needs_free_base: Whether only a robot that moves its base has the score, such as a
            displacement.
        needs_touch: Whether only a robot with touch sensors has the score.
        optional: Signals of ``record`` without which a trial has a score all the same.
        ends_at_fall: Whether nothing counts from a fall on, so that a rollout may end there.
        episode: Rewards in an episode of the dm_control task of which the score is the return, of 1
            at most each; None for any other score.
    """

    name: str
    record: tuple[Signal, ...]
    of: Callable[[Robot, Hypothesis, Trajectory], FloatArray]
    unit: str = ""
    grows_with_time: bool = False
    needs_free_base: bool = False
    needs_touch: bool = False
    optional: tuple[Signal, ...] = ()
    ends_at_fall: bool = False
    episode: int | None = None

    def most(self, steps: int) -> int | None:
        """Returns the largest return of a trial of some control steps; None for other scores."""
        return None if self.episode is None else steps - 1  # the last command has no reward

    def of_trial(self, robot: Robot, hypothesis: Hypothesis, trial: Trial) -> float:
        """Returns the score of a trial of a robot with faults; NaN if it was not observed."""
        logged = trial.trajectory
        signals = {signal: logged[signal][np.newaxis] for signal in self.record}
        batch = Trajectory(logged.names, logged.time, signals)
        return float(self.of(robot, hypothesis, batch)[0])


def value_text(value: float | None, unit: str, most: float | None = None) -> str:
    """Returns the value of a score as text, a return with the most that was possible.

    Examples:
        >>> value_text(46.2, "", 199)
        '46.200 of 199'
    """
    known = math.nan if value is None else value
    return f"{known:.3f}{'' if most is None else f' of {most:,}'} {unit}".rstrip()


def score_label(name: str, unit: str, most: float | None = None) -> str:
    """Returns a score as the label of an axis or a column, a return with the most possible.

    Examples:
        >>> score_label("return", "", 199), score_label("upright", "m")
        ('return (of 199)', 'upright, m')
    """
    bound = "" if most is None else f" (of {most:,})"
    return f"{name}{bound}, {unit}".removesuffix(", ")


def scores_of(
    score: Score, robot: Robot, hypotheses: Sequence[Hypothesis], outcome: SimulationResult
) -> FloatArray:
    """Returns the scores of rollouts, ``(n, hypotheses)``; negative infinity for a diverged one.

    Each column of the rollouts is of the healthy robot with the faults of a hypothesis.
    """
    scores, simulated = np.full(outcome.diverged.shape, -np.inf), outcome.trajectory
    for column, hypothesis in enumerate(hypotheses):
        rows = ~outcome.diverged[:, column]
        if rows.any():
            signals = {name: values[rows, column] for name, values in simulated.signals.items()}
            finite = Trajectory(simulated.names, simulated.time, signals)
            scores[rows, column] = score.of(robot, hypothesis, finite)
    return scores


def _displacement(_robot: Robot, _hypothesis: Hypothesis, trajectory: Trajectory) -> FloatArray:
    return forward_displacement(trajectory)


def _upright(robot: Robot, hypothesis: Hypothesis, trajectory: Trajectory) -> FloatArray:
    x = trajectory["base_position"][..., 0]
    return np.asarray(_before_fall(x, robot, hypothesis, trajectory) - x[..., 0])


def _before_fall(
    values: FloatArray, robot: Robot, hypothesis: Hypothesis, trajectory: Trajectory
) -> FloatArray:
    """Returns values, ``(..., steps)``, at the last step before the robot falls, ``(...)``."""
    last = np.maximum(falls_of(robot, hypothesis, trajectory) - 1, 0)
    return np.take_along_axis(values, last[..., np.newaxis], axis=-1)[..., 0]


def _straight(robot: Robot, hypothesis: Hypothesis, trajectory: Trajectory) -> FloatArray:
    known = held(headings(trajectory["base_orientation"]), axis=-1)
    turns = np.abs(np.unwrap(np.nan_to_num(known), axis=-1))  # unknown at first: forward
    share = np.minimum(_before_fall(turns, robot, hypothesis, trajectory) / np.pi, 1.0)
    distance = _upright(robot, hypothesis, trajectory)
    return np.asarray(distance - share * np.abs(distance))


def _upright_less_work(robot: Robot, hypothesis: Hypothesis, trajectory: Trajectory) -> FloatArray:
    model = build(robot, hypothesis).model
    weight = float(model.body_mass.sum() * np.linalg.norm(model.opt.gravity))
    cost = joint_work(robot, trajectory) / weight if weight else 0.0
    return np.asarray(_upright(robot, hypothesis, trajectory) - WORK_WEIGHT * cost)


def _steps(robot: Robot, hypothesis: Hypothesis, trajectory: Trajectory) -> FloatArray:
    feet = [k for k, one in enumerate(robot.anatomy.sensors) if one.kind == "touch"]
    touch = held(trajectory["sensors"][..., feet].swapaxes(-1, -2), axis=-1)
    window = steps_in(STEP_TIME, trajectory)
    total = np.cumsum(np.nan_to_num(touch), axis=-1)
    share = (total[..., window:] - total[..., :-window]) / window
    stands = held(np.where(share > STANDS, 1.0, np.where(share < SWINGS, 0.0, np.nan)), axis=-1)
    landings = np.count_nonzero((stands[..., 1:] == 1) & (stands[..., :-1] == 0), axis=-2)
    end = falls_of(robot, hypothesis, trajectory)
    before = np.arange(landings.shape[-1]) + window + 1 < end[..., np.newaxis]
    steps = np.where(before, landings, 0.0).sum(axis=-1)
    return np.where(np.isfinite(touch).any(axis=(-2, -1)), steps, np.nan)


def joint_work(robot: Robot, trajectory: Trajectory) -> FloatArray:
    """Returns the mechanical work of the joints, J, ``(...)``: work on a motor counts as spent.

    Single NaN count as 0, and the work of a run without any number is NaN.
    """
    power = np.abs(trajectory["joint_efforts"] * trajectory["joint_velocities"])
    observed = np.isfinite(power).any(axis=(-2, -1))
    work = np.nansum(power, axis=(-2, -1)) * robot.control_timestep
    return np.asarray(np.where(observed, work, np.nan))


_metres = partial(Score, unit="m", grows_with_time=True, needs_free_base=True)

DISPLACEMENT = _metres(
    "displacement",
    ("base_position",),
    _displacement,
)
"""Forward displacement, m. Source: the paper, section III."""

UPRIGHT = _metres(
    "upright",
    ("base_position", "base_orientation"),
    _upright,
    optional=("base_orientation",),
    ends_at_fall=True,
)
"""Forward displacement up to the last step before the robot falls, m.

A robot has fallen at the first step from which its base is, for most of ``FALLEN_TIME`` (near the
end, of the last ``FALLEN_TIME`` of the run), tilted by more than ``FALLEN_TILT`` from its initial
orientation, or lower than ``FALLEN_HEIGHT`` of its standing height. What follows a fall counts
nothing: a controller that tips the robot over and crawls on its back earns what it walked before.
"""

STRAIGHT = _metres("straight", UPRIGHT.record, _straight, ends_at_fall=True)
"""Displacement up to the first fall, m, less a share of it: the last turn relative to 180 degrees.

The turn is that of the base from the forward direction, in which a robot stands at first. One that
costs little displacement, such as 15 degrees in simulation, is larger on a physical robot.
"""

ENERGY = _metres(
    "energy",
    (*UPRIGHT.record, "joint_efforts", "joint_velocities"),
    _upright_less_work,
    grows_with_time=False,
    optional=UPRIGHT.optional,
)
"""Displacement up to the first fall, m, less ``WORK_WEIGHT`` times the work over the weight, m.

The work over the weight and the distance is the cost of transport (Gabrielli and von Karman, *What
price speed?*, 1950).
"""

STEPS = Score(
    "steps",
    ("sensors", *UPRIGHT.record),
    _steps,
    unit="steps",
    grows_with_time=True,
    needs_free_base=True,
    needs_touch=True,
    optional=UPRIGHT.record,
    ends_at_fall=True,
)
"""Number of times that feet come down before the robot falls, for a robot without odometry.

A foot comes down when it stands after it swung; see ``STEP_TIME``. Steps on the spot count as well.
"""

SCORES: Mapping[str, Score] = MappingProxyType(
    {score.name: score for score in (DISPLACEMENT, UPRIGHT, STRAIGHT, ENERGY, STEPS)}
)
"""Scores by name."""


@typed
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
        InputError: The limit of speed or torque is not above 0, or that of the depth is below 0.
    """
    if not (max_speed > 0 and max_torque > 0 and max_self_collision >= 0):
        raise InputError(
            f"expected limits above 0, and a depth of 0 or above, got {max_speed}, {max_torque} "
            f"and {max_self_collision}: leave out what has no limit"
        )
    compares_bodies = math.isfinite(max_self_collision)

    def of(robot: Robot, hypothesis: Hypothesis, trajectory: Trajectory) -> FloatArray:
        moved = np.diff(held(trajectory["base_position"][..., 0], axis=-1), axis=-1)
        # A joint that has come off lies on the ground, and is not the robot's.
        detached = build(robot, hypothesis).detached
        attached = [j for j, name in enumerate(robot.anatomy.hinges) if name not in detached]
        # NaN is not over a limit.
        speeding = np.abs(trajectory["joint_velocities"][..., attached]) > max_speed
        straining = np.abs(trajectory["joint_efforts"][..., attached]) > max_torque
        over: BoolArray = np.any(speeding | straining, axis=-1)
        counted = np.where(over[..., 1:], np.minimum(moved, 0.0), moved)
        end = falls_of(robot, hypothesis, trajectory)
        if compares_bodies:
            deep = _depths(robot, hypothesis, trajectory) > max_self_collision
            steps = steps_in(COLLISION_TIME, trajectory)
            end = np.minimum(end, first_lasting(deep, ~deep, steps))
        before = np.arange(1, trajectory.steps) < end[..., np.newaxis]
        return np.asarray(np.where(before, counted, 0.0).sum(axis=-1))

    limits = {"rad/s": max_speed, "N m": max_torque, "m of self-collision": max_self_collision}
    texts = [f"{limit:g} {unit}" for unit, limit in limits.items() if math.isfinite(limit)]
    name = f"{UPRIGHT.name} within {' and '.join(texts)}" if texts else UPRIGHT.name
    record = (*UPRIGHT.record, "joint_velocities", "joint_efforts")
    signals = (*record, "joint_positions") if compares_bodies else record
    return _metres(name, signals, of, optional=signals[1:], ends_at_fall=True)


def _depths(robot: Robot, hypothesis: Hypothesis, trajectory: Trajectory) -> FloatArray:
    """Returns the depth of self-collision at each step, m, ``(..., steps)``.

    A joint without a measurement is where it was last measured, or else in the initial pose.
    Detached bodies do not count, and encoders have the offsets of the hypothesis.
    """
    logged = held(trajectory["joint_positions"], axis=-2)
    angles = logged - build(robot, hypothesis).encoder_offset
    initial = [float(robot.model.joint(name).qpos0[0]) for name in robot.anatomy.hinges]
    poses = np.where(np.isfinite(angles), angles, initial)
    lost = detached_bodies(robot.anatomy, robot.model, hypothesis)
    depths = penetration_depths(robot, poses.reshape(-1, len(initial)), lost)
    return depths.reshape(poses.shape[:-1])


def checked(score: Score, name: str) -> Score:
    """Returns the score of a plug-in, named in the messages, with checks of signals and values.

    Raises:
        InputError: ``record`` is no tuple of known signals. A call of the new score raises it if
            the function reads another signal, or returns other than one number per run.
    """
    record: object = score.record
    if not isinstance(record, tuple) or not record or any(one not in SIGNALS for one in record):
        raise InputError(
            f"the score {name!r} has record={record!r}: expected a tuple of one or more of "
            f"{', '.join(SIGNALS)}; correct `record` of the score"
        )
    return dataclasses.replace(score, of=partial(_checked, score, name))


def _checked(
    score: Score, name: str, robot: Robot, hypothesis: Hypothesis, trajectory: Trajectory
) -> FloatArray:
    runs = len(trajectory[score.record[0]])
    expected = f"the score {name!r}: expected one number for each of {runs} runs"
    try:
        result: object = score.of(robot, hypothesis, trajectory)
    except NotRecordedError as error:
        raise InputError(
            f"the score {name!r} reads a signal that it does not name: {error}; add the signal to "
            f"`record` of the score"
        ) from error
    try:
        values = np.asarray(result, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{expected}, got {type(result).__name__} ({error}); return an array of numbers from "
            f"`of` of the score"
        ) from error
    if values.shape != (runs,):
        raise InputError(
            f"{expected}, an array of shape ({runs},), got shape {values.shape}; `of` of the score "
            f"gets signals of shape (runs, steps, width): sum over the steps, not over the runs"
        )
    # A run that was not observed whole, or diverged, may have no number.
    known = [np.abs(trajectory[signal]) <= LARGEST for signal in score.record]
    whole = np.all([signal.all(axis=(1, 2)) for signal in known], axis=0)
    wrong = whole & (np.isnan(values) | np.isposinf(values))
    if wrong.any():
        raise InputError(
            f"{expected}, got {values[wrong][0]:g} for {wrong.sum()} of them, whose signals are "
            f"all finite; return a number, the lowest for the worst run, from `of` of the score"
        )
    return values


def observed_of(*robots: PhysicalRobot) -> frozenset[Signal]:
    """Returns the signals that all of some physical robots observe, as far as they declare it."""
    declared = [robot.signals for robot in robots if isinstance(robot, ObservedRobot)]
    return frozenset(SIGNALS).intersection(*declared)


def observed_in(trial: Trial) -> frozenset[Signal]:
    """Returns the signals of which a trial has some number, and those without a column."""
    signals = trial.trajectory.signals
    return frozenset(
        one for one in SIGNALS if np.isfinite(signals[one]).any() or not signals[one].size
    )


def check_measurable(
    score: Score, robot: Robot, observed: Collection[Signal] = frozenset(SIGNALS)
) -> None:
    """Raises ``InputError``, which names other scores, if a score cannot be measured on a robot."""
    if reason := _obstacle(score, robot, observed):
        others = [name for name, one in SCORES.items() if not _obstacle(one, robot, observed)]
        if "joint_positions" in observed:
            others.append(f"{TRACKING} (with --reference FILE, or --controller cpg)")
        raise InputError(f"{reason}: give --score {' or '.join(others) or 'package.module:object'}")


def _obstacle(score: Score, robot: Robot, observed: Collection[Signal]) -> str:
    """Returns why a score cannot be measured on a robot; "" if it can."""
    if score.needs_free_base and robot.has_fixed_base:
        return f"the base of {robot.name} is fixed, and the score {score.name} needs one that moves"
    if score.needs_touch and all(one.kind != "touch" for one in robot.anatomy.sensors):
        return f"{robot.name} has no touch sensors, and the score {score.name} needs some"
    lacking = [one for one in score.record if one not in (*observed, *score.optional)]
    if not lacking:
        return ""
    return f"{robot.name} does not observe {', '.join(lacking)}, which the score {score.name} needs"
