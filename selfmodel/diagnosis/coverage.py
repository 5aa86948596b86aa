"""Coverage: whether the healthy trials move the joints as fast as the trials to explain do."""

from collections.abc import Collection, Sequence

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis.problem import Problem
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import TrialPart

COVERAGE = 1.25
"""Largest speed of a joint's commands, relative to that in the healthy trials, that they cover."""

MAX_LEFT_OUT, MAX_PARTS, MIN_PAUSE = 0.5, 3, 1.0
"""Largest share of a trial, and largest number of its parts, that it is advised to leave out; and
shortest time without fast commands between two parts, s."""

FASTEST = 0.95
"""Quantile of the speeds of commands that is compared: single jumps are no regime."""


def faster_joints(trials: Sequence[TrialPart], problem: Problem) -> dict[str, tuple[float, float]]:
    """Returns the joints that trials move faster than the healthy ones of a problem cover.

    The fastest relative to them is first. By the joint's name, the speed of its commands in the
    trials and in the healthy trials, rad/s.
    """
    anatomy = problem.space.anatomy
    speeds, covered = (_fastest(each) for each in (trials, problem.healthy_motions))
    joints = {}
    for joint in anatomy.joints:
        motors = [anatomy.motors.index(motor) for motor in joint.servos]
        beyond = [motor for motor in motors if speeds[motor] > COVERAGE * covered[motor]]
        if beyond:
            joints[joint.name] = float(speeds[beyond[0]]), float(covered[beyond[0]])
    return dict(sorted(joints.items(), key=lambda one: one[1][1] / one[1][0]))


def fast_parts(joints: Collection[str], problem: Problem) -> list[str]:
    """Returns what leaves out the parts of imported trials that healthy trials do not cover.

    In these, joints are faster. The result has an entry of the mapping for each trial with such
    parts, and is empty if they are many, or most of a trial.
    """
    anatomy, entries = problem.space.anatomy, []
    servos = [motor for joint in anatomy.joints if joint.name in joints for motor in joint.servos]
    motors = [anatomy.motors.index(motor) for motor in servos]
    covered = _fastest(problem.healthy_motions)[motors]
    for part in problem.trials:
        trajectory = part.rows.trajectory
        times, trial = trajectory.time, part.trial
        ends = 1 + np.flatnonzero(
            (command_speeds(trajectory)[:, motors] > COVERAGE * covered).any(axis=1)
        )
        groups = np.split(ends, 1 + np.flatnonzero(np.diff(times[ends]) > MIN_PAUSE))
        spans = [(times[group[0] - 1], times[group[-1]]) for group in groups if len(group)]
        most = MAX_LEFT_OUT * np.ptp(times) if trial.plan.name == "imported" else 0.0
        if len(spans) > MAX_PARTS or sum(end - begin for begin, end in spans) > most:
            return []
        listed = ", ".join(
            f"[{np.floor(10 * begin) / 10:.1f}, {np.ceil(10 * end) / 10:.1f}]"
            for begin, end in spans
        )
        log = problem.names[trial.path]
        entries += [f"leave_out = [{listed}] in the mapping file of '{log}'"] if spans else []
    return entries


def _fastest(parts: Sequence[TrialPart]) -> FloatArray:
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
