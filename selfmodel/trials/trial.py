"""A trial: one logged run of the physical robot with one command source."""

import dataclasses
import hashlib
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import PurePath
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from selfmodel.arrays import FloatArray, data_frame
from selfmodel.controllers.controller import CommandSource
from selfmodel.controllers.playback import played_back
from selfmodel.errors import InputError, check_name, typed
from selfmodel.trials.signals import Signal
from selfmodel.trials.trajectory import (
    Described,
    Trajectory,
    columns_of,
    forward_displacement,
    trajectory_of_arrays,
)

Stage = Literal["before", "after", "recovery", "single"]
"""Stage of a recovery: ``before`` (healthy robot), ``after`` (failed robot, old controller),
``recovery`` (failed robot, compensating controller), or ``single`` (outside of a recovery). A
diagnosis explains all trials but those of the stage ``before``, which calibrate the self-model."""

STAGES: tuple[Stage, ...] = get_args(Stage)

MAX_SEED = 2**63 - 1
"""Largest seed of a trial: the largest integer of most other programs that read logs."""


@typed
@dataclass(frozen=True)
class TrialPlan:
    """The plan of a trial, known before it starts.

    Attributes:
        name: Name of the trial within its run and of its file: letters, digits, ``-``.
        stage: Stage of the recovery.
        controller: Command source of the robot.
        steps: Planned control steps.
        seed: Seed of all random numbers of the trial, from 0 to ``MAX_SEED``.

    Raises:
        InputError: The seed is out of range.
    """

    name: str
    stage: Stage
    controller: CommandSource
    steps: int
    seed: int

    def __post_init__(self) -> None:
        check_name("stage", self.stage, STAGES)
        if not 0 <= self.seed <= MAX_SEED:
            raise InputError(f"seed must be a whole number from 0 to {MAX_SEED}, got {self.seed}")


@typed
@dataclass(frozen=True, eq=False)
class Trial:
    """A trial that ran to its end, or until it was interrupted.

    Attributes:
        plan: The plan of the trial.
        robot: Name of the robot.
        trajectory: Observed signals: ``plan.steps`` steps, or fewer if the trial was interrupted;
            NaN for values that were not observed.
        path: Path of the log; for a trial without one, its name and the digest of its signals.
    """

    plan: TrialPlan
    robot: str
    trajectory: Trajectory
    path: str

    @cached_property
    def content(self) -> tuple[str, CommandSource]:
        """What was run and observed, for look-ups: trials of equal content are the same trial."""
        return _digest(self.trajectory), self.plan.controller

    @property
    def early_end(self) -> str:
        """Clause about an early end, such as ``, ended at step 55 of 150``; "" without one."""
        steps = self.trajectory.steps
        return "" if steps == self.plan.steps else f", ended at step {steps} of {self.plan.steps}"

    def __repr__(self) -> str:
        plan = self.plan
        return (
            f"<Trial {plan.name} of {self.robot}: stage {plan.stage}, "
            f"{self.trajectory.steps} of {plan.steps} steps"
            f"\n  {plan.controller.summary}"
            f"\n  {self.path}>"
        )

    @classmethod
    def from_arrays(
        cls,
        robot: Described,
        joint_positions: ArrayLike,
        commands: ArrayLike,
        *,
        time: ArrayLike | None = None,
        joint_names: Sequence[str] | None = None,
        motor_names: Sequence[str] | None = None,
        joint_velocities: ArrayLike | None = None,
        joint_efforts: ArrayLike | None = None,
        sensors: ArrayLike | None = None,
        base_position: ArrayLike | None = None,
        base_orientation: ArrayLike | None = None,
        base_linear_velocity: ArrayLike | None = None,
        base_angular_velocity: ArrayLike | None = None,
        controller: CommandSource | None = None,
        stage: Stage = "single",
        name: str = "arrays",
    ) -> "Trial":
        """Returns a trial of measured arrays, one row per control step.

        Numbers that were not measured are NaN; a signal that is left out is NaN as a whole. Columns
        are used in their order: the names of a data frame's columns are not read.

        Example:
            >>> import selfmodel
            >>> robot = selfmodel.load_robot("quadruped")
            >>> logged = selfmodel.read_log("after.mcap").trial.trajectory
            >>> selfmodel.Trial.from_arrays(
            ...     robot, logged["joint_positions"], logged["commands"], name="mine"
            ... ).trajectory.steps
            60

        Args:
            robot: Robot of the trial, such as ``selfmodel.load_robot("quadruped")``.
            joint_positions: Joint angles, ``(steps, hinges)`` rad.
            commands: Commands, ``(steps, motors)``, each in its motor's unit.
            time: Times of the rows, ``(steps,)`` s since any moment; each must be within half a
                control step of its own.
            joint_names: Hinges of the columns of the joints' arrays; None for the order of
                ``robot.anatomy.hinges``.
            motor_names: Motors of the columns of ``commands``; None for the order of
                ``robot.anatomy.motors``.
            joint_velocities: Joint velocities, ``(steps, hinges)`` rad/s.
            joint_efforts: Joint torques, ``(steps, hinges)`` N m.
            sensors: Readings of the controller's sensors, ``(steps, sensors)``; touch is 0 or 1.
            base_position: Position of the root body, ``(steps, 3)`` m, world frame.
            base_orientation: Unit quaternions of the root body, ``(steps, 4)``, w x y z.
            base_linear_velocity: Velocity of the root body, ``(steps, 3)`` m/s, world frame.
            base_angular_velocity: Angular velocity, ``(steps, 3)`` rad/s, in the root body's frame.
            controller: Controller that computed the commands; None to play the commands back.
            stage: Stage of the trial: ``before`` for a healthy robot.
            name: Name of the trial: letters, digits, ``-``.

        Raises:
            InputError: An array has another shape or type, an infinite number or a quaternion that
                is not of unit length, the rows are not control steps, the first commands are
                missing, or a name or the stage is unknown.
        """
        joints: tuple[Signal, ...] = ("joint_positions", "joint_velocities", "joint_efforts")
        arrays: dict[Signal, ArrayLike | None] = {
            "sensors": sensors,
            "commands": commands,
            "joint_positions": joint_positions,
            "joint_velocities": joint_velocities,
            "joint_efforts": joint_efforts,
            "base_position": base_position,
            "base_orientation": base_orientation,
            "base_linear_velocity": base_linear_velocity,
            "base_angular_velocity": base_angular_velocity,
        }
        orders = {**dict.fromkeys(joints, joint_names), "commands": motor_names}
        trajectory = trajectory_of_arrays(robot, arrays, time, orders)
        try:
            played = played_back(trajectory.names.motors, trajectory["commands"])
        except ValueError as error:
            raise InputError(
                f"{error}: begin the arrays at the first row with all commands"
            ) from error
        plan = TrialPlan(name, stage, controller or played, trajectory.steps, seed=0)
        return cls(plan, robot.name, trajectory, f"{name} ({_digest(trajectory)[:16]})")

    def to_pandas(self) -> Any:  # noqa: ANN401  # pandas has no types
        """Returns the signals as a ``pandas.DataFrame``, with the columns of ``logs export``.

        Example:
            >>> import selfmodel
            >>> selfmodel.read_log("after.mcap").trial.to_pandas()["base_position.x"].shape
            (60,)
        """
        return data_frame(columns_of(self.trajectory))

    @property
    def displacement(self) -> float:
        """Forward displacement, m."""
        return float(forward_displacement(self.trajectory))


def _digest(trajectory: Trajectory) -> str:
    """SHA-256 of the times, the late steps and the signals of a trajectory."""
    late = () if trajectory.late is None else (trajectory.late,)
    digest = hashlib.sha256()
    for values in (trajectory.time, *late, *trajectory.signals.values()):
        digest.update(values.tobytes())
    return digest.hexdigest()


@dataclass(frozen=True, eq=False)
class TrialPart:
    """A part of a trial: what lies between two times, s since its start, both inclusive."""

    trial: Trial
    begin: float = -math.inf
    end: float = math.inf

    @property
    def is_whole(self) -> bool:
        """Whether the part has no bounds."""
        return self.begin == -math.inf and self.end == math.inf

    @property
    def rows(self) -> Trial:
        """The trial with the rows of the part alone."""
        trajectory = self.trial.trajectory
        kept = (trajectory.time >= self.begin) & (trajectory.time <= self.end)
        return dataclasses.replace(self.trial, trajectory=trajectory.rows(kept))


def whole(trial: Trial | TrialPart) -> TrialPart:
    """Returns a trial as a part without bounds; a part is returned unchanged."""
    return trial if isinstance(trial, TrialPart) else TrialPart(trial)


def trial_names(trials: Iterable[Trial]) -> dict[str, str]:
    """Returns a name for each trial, by the trial's path.

    It is that of the log's file, without ``.mcap``: every imported trial has the plan ``imported``.
    Without a log it is that of the plan. Where several trials would have one name, each has its
    whole path.
    """
    files = {trial.path: (PurePath(trial.path), trial.plan.name) for trial in trials}
    names = {
        path: file.stem if file.suffix.lower() == ".mcap" else planned
        for path, (file, planned) in files.items()
    }
    counts = Counter(names.values())
    return {path: name if counts[name] == 1 else path for path, name in names.items()}


def by_stage(trials: Sequence[Trial]) -> tuple[tuple[Trial, ...], tuple[Trial, ...]]:
    """Returns the trials to explain, and those of the stage ``before`` unless all are."""
    failed = tuple(trial for trial in trials if trial.plan.stage != "before") or tuple(trials)
    return failed, tuple(trial for trial in trials if trial not in failed)


def observed_as(trial: Trial, others: Sequence[Trial]) -> Trial:
    """Returns a trial without the columns that were never observed in one of the others.

    An unknown joint makes the prediction of the others worse. So the loss of a healthy trial is a
    reference for a trial with a lost encoder only without the same encoder.
    """
    reduced: dict[Signal, FloatArray] = {}
    losable: tuple[Signal, ...] = ("joint_positions", "joint_velocities", "sensors")
    for signal in losable:  # with an encoder
        observed = [np.isfinite(own.trajectory[signal]).any(axis=0) for own in (trial, *others)]
        lost = observed[0] & ~np.logical_and.reduce(observed)
        if lost.any():
            reduced[signal] = np.where(lost, np.nan, trial.trajectory[signal])
    if not reduced:
        return trial
    return dataclasses.replace(trial, trajectory=trial.trajectory.with_signals(reduced))


MAX_VALUE = 1e8
"""Largest absolute value of a signal, in its SI unit. Coordinates of map projections reach 1e7 m;
at 1e8 m, a number still resolves 1e-8 m."""


def check_magnitudes(trial: Trial, signals: Iterable[Signal]) -> None:
    """Raises ``InputError`` if a value of some signals is infinite or above ``MAX_VALUE``."""
    for signal in signals:
        values = trial.trajectory[signal]
        wrong = np.argwhere(np.abs(values) > MAX_VALUE)
        if len(wrong):
            step, column = wrong[0].tolist()
            name = trial.trajectory.names.columns(signal)[column]
            raise InputError(
                f"{trial.path}: {signal} {name} is {values[step, column]:g} at step {step}, "
                f"expected at most {MAX_VALUE:g} in SI units, or NaN where nothing was observed: "
                f"check the units and the odometry of the log, or leave this log out"
            )


FASTEST = 0.95
"""Quantile of the speeds of commands that is compared: single jumps are no regime."""

MAX_DIFFERENCE = 0.4
"""Largest difference of the commands of one gait. Recordings of another generator: at most 0.26 for
the same gait, also of a network on a damaged robot, and at least 0.7 for different gaits."""


def have_one_gait(trials: Sequence[Trial], others: Sequence[Trial]) -> bool:
    """Returns whether for each trial one of the others has commands of the same gait."""
    return all(
        any(command_difference(one, other) <= MAX_DIFFERENCE for other in others) for one in trials
    )


def command_difference(one: Trial, other: Trial) -> float:
    """Returns the difference of the distributions of the commands of two trials.

    It is the mean over the motors of the differences of mean and standard deviation, relative to
    the root mean square of the other trial's standard deviations; infinite without known commands.
    The commands of a network differ in every step, and their distributions hardly.
    """
    commands = (one.trajectory["commands"], other.trajectory["commands"])
    first, second = (rows[np.isfinite(rows).all(axis=1)] for rows in commands)
    if not len(first) or not len(second):
        return math.inf
    scale = float(np.sqrt(np.mean(second.var(axis=0))))
    means = np.abs(first.mean(axis=0) - second.mean(axis=0))
    deviations = np.abs(first.std(axis=0) - second.std(axis=0))
    difference = float(np.mean(means + deviations))
    return difference / scale if scale > 0 else (math.inf if difference > 0 else 0.0)


def fastest_commands(parts: Sequence[TrialPart]) -> FloatArray:
    """Returns the speed of each motor's commands where any joint was measured, ``(motors,)``."""
    quantiles = []
    for speeds in (command_speeds(part.rows.trajectory) for part in parts):
        known = speeds[np.isfinite(speeds).all(axis=1)]
        nothing = np.zeros(speeds.shape[1])
        quantiles.append(np.quantile(known, FASTEST, axis=0) if len(known) else nothing)
    return np.asarray(np.max(quantiles, axis=0))


def command_speeds(trajectory: Trajectory) -> FloatArray:
    """Returns the speeds of the motors' commands, rad/s, ``(steps - 1, motors)``.

    They are NaN at steps without a measured joint, which say nothing about the robot.
    """
    changes = np.abs(np.diff(trajectory["commands"], axis=0))
    speeds = changes / np.diff(trajectory.time)[:, np.newaxis]
    unseen = np.isnan(trajectory["joint_positions"][1:]).all(axis=1, keepdims=True)
    return np.asarray(np.where(unseen, np.nan, speeds))
