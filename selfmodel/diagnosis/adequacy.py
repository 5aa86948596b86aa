"""Adequacy: whether the self-model can carry an accusation, or the trials cannot be judged.

A loss above that of the healthy trials has two causes: a fault, or a motion that the model predicts
worse than those it was fitted to. A trial with a healthy trial of the same gait excludes the second
one. For another gait, the following is asked before a robot is called damaged, unless its loss is
too large for any error of a model that predicts the healthy trials:

1. **Recalibration.** The self-model is fitted to the healthy trials and to those to explain
   together, without a fault. What the healthy trials left open is then free to explain the others.
   A fault has to predict all trials significantly better than this model.
2. **Coverage.** A joint is accused only if the healthy trials move it about as fast. Commands are
   compared: no fault changes them in a gait that is played back.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis import significance
from selfmodel.diagnosis.diagnosis import Doubt, Fit
from selfmodel.diagnosis.losses import Problem
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import have_one_gait

COVERAGE = 1.25
"""Largest speed of a joint's commands, relative to that in the healthy trials, that they cover."""

MAX_LEFT = 0.5
"""Share of the loss beyond that of healthy trials with other gaits that a fault may leave. One that
leaves more is not the cause of the loss, and what causes it may cause the rest too."""

MAX_JOINTS = 3
"""Joints that are named, the fastest relative to the healthy trials first."""

FASTEST = 0.95
"""Quantile of the speeds of commands that is compared: single jumps are no regime."""


def doubt_of(accused: Hypothesis, fit: Fit, problem: Problem) -> Doubt | None:
    """Returns the reason for which an accusation cannot be made; None if it can.

    Args:
        accused: The hypothesis that is said to be true; if it is empty, no hypothesis explains the
            trials.
        fit: How well the best hypothesis predicts them.
        problem: The trials. Nothing is doubted without comparable healthy trials, without a
            calibration, or if each controller is that of a healthy trial.
    """
    healthy = problem.healthy_trials
    if problem.calibrate is None or problem.healthy([INTACT]) is None or _have_one_driver(problem):
        return None
    worst = max(problem.table.losses([INTACT], [one]).mean() for one in healthy)
    if not fit.intact_loss <= significance.LOSS_RATIO * worst + significance.LOSS_FLOOR:
        return None
    reason, faster = "", faster_joints(problem)
    joints = [*fit.joints, *(fault.part for fault in accused.faults if fault.kind.is_of_joint)]
    rows = ([part.rows for part in each] for each in (problem.trials, healthy))
    if uncovered := [joint for joint in joints if joint in faster]:
        reason = f"the healthy trials do not cover it: {_speeds_of(uncovered, faster)}"
    elif have_one_gait(*rows) and not faster:
        return None
    elif not accused:
        listed = _speeds_of(list(faster)[:MAX_JOINTS], faster)
        reason = (
            f"the mean loss is {fit.intact_loss / worst:.2g} times that of the healthy trials, "
            f"which have other gaits{f': {listed}' if listed else ''}"
        )
    elif fit.left is not None and fit.left > MAX_LEFT:
        reason = (
            f"{accused} leaves {fit.left:.0%} of the loss beyond that of the healthy trials, which "
            f"have other gaits"
        )
    elif is_explained_without(accused, problem):
        reason = (
            f"a self-model that is fitted to all trials predicts them about as well without "
            f"{accused}: the healthy trials, which have other gaits, leave this open"
        )
    return Doubt(reason, "record a trial of the healthy robot with this gait") if reason else None


def _have_one_driver(problem: Problem) -> bool:
    """Returns whether each trial has the controller, or the very commands, of a healthy one."""
    drivers = [part.trial.plan.controller for part in problem.healthy_trials]
    return all(part.trial.plan.controller in drivers for part in problem.trials)


def _speeds_of(joints: Sequence[str], faster: Mapping[str, tuple[float, float]]) -> str:
    """Returns the speeds of joints in the trials and in the healthy trials, as a clause."""
    return "; ".join(
        f"{joint} is commanded at up to {speed:.2g} rad/s, in the healthy trials {covered:.2g}"
        for joint, (speed, covered) in ((joint, faster[joint]) for joint in joints)
    )


def is_explained_without(accused: Hypothesis, problem: Problem) -> bool:
    """Returns whether a self-model fitted to all trials predicts them as well without a fault."""
    refit = problem.recalibrated
    trials, healthy = problem.trials, problem.healthy_trials
    known = problem.table
    with_fault = _joined(known.losses([accused], trials), known.losses([INTACT], healthy))
    without = _joined(refit.losses([INTACT], trials), refit.losses([INTACT], healthy))
    return not significance.is_better(with_fault, without)


def faster_joints(problem: Problem) -> dict[str, tuple[float, float]]:
    """Returns the joints that the trials move faster than the healthy ones cover.

    The fastest relative to them is first. By the joint's name, the speed of its commands in the
    trials and in the healthy trials, rad/s.
    """
    anatomy = problem.space.anatomy
    speeds, covered = (
        np.max([_speeds(part.rows.trajectory) for part in each], axis=0)
        for each in (problem.trials, problem.healthy_trials)
    )
    joints = {}
    for joint in anatomy.joints:
        motors = [anatomy.motors.index(motor) for motor in joint.servos]
        if motors and (speeds[motors] > COVERAGE * covered[motors]).any():
            joints[joint.name] = float(speeds[motors].max()), float(covered[motors].max())
    return dict(sorted(joints.items(), key=lambda one: one[1][1] / one[1][0]))


def _speeds(trajectory: Trajectory) -> FloatArray:
    """Returns the speed of each motor's commands, rad/s, ``(motors,)``; 0 without known ones."""
    changes = np.abs(np.diff(trajectory["commands"], axis=0))
    speeds = changes / np.diff(trajectory.time)[:, np.newaxis]
    known = speeds[np.isfinite(speeds).all(axis=1)]
    return np.quantile(known, FASTEST, axis=0) if len(known) else np.zeros(speeds.shape[1])


def _joined(*rows: FloatArray) -> FloatArray:
    return np.concatenate([one for (one,) in rows])
