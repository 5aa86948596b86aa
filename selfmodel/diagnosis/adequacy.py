"""Adequacy: whether the self-model can carry an accusation, or the trials cannot be judged.

A loss above that of the healthy trials has two causes: a fault, or a motion that the model predicts
worse than those it was fitted to. In a trial with the gait of a healthy one, only the first is
left, unless the loss is as small as theirs: then the third question below is asked. For other
trials, the following is asked before a robot is called damaged:

1. **Explanation.** Does the fault explain most of the loss? If not, or if there is no fault that
   does, the gait may be the cause, unless it is no faster than the healthy ones and the loss is too
   large for the error of a fitted model: more than ``LOSS_RATIO`` times that of the worst healthy
   trial, or its square if the healthy trials have one gait; without a fault, that which is expected
   in this gait, if it is larger. A fault that explains such a loss needs no more questions.
2. **Coverage.** Do the healthy trials move the accused joints about as fast, and do they have two
   gaits or more? With one, the error of the self-model in another gait is unknown. Speeds are those
   of the commands: no fault changes them in a gait that is played back. Of a fault that leaves
   almost nothing (``COMPLETE``), only the next question is asked.
3. **Recalibration.** Does the fault explain more than a self-model that is fitted to the healthy
   trials and to those to explain together, without a fault? And do the healthy trials exclude it?
   What they left open is free in the fit, but for its prior.

Of a fault beside others, only the third is asked, of a fit with the others (``supported``).

A comparator of whole trials, or with one distance per trial, judges only trials that a hypothesis
reproduces (``unreproduced``). Trials that contradict each other are not judged (``contradiction``).
"""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller
from selfmodel.diagnosis import search, significance
from selfmodel.diagnosis.diagnosis import Doubt, Fit
from selfmodel.diagnosis.direct_evidence import explains_standing
from selfmodel.diagnosis.joints import excesses, joints_of
from selfmodel.diagnosis.losses import by_total_loss
from selfmodel.diagnosis.problem import Problem
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.settings import EA
from selfmodel.trials.trial import TrialPart, command_speeds, fastest_commands, have_one_gait, whole

COVERAGE = 1.25
"""Largest speed of a joint's commands, relative to that in the healthy trials, that they cover."""

MAX_LEFT_OUT, MAX_PARTS, MIN_PAUSE = 0.5, 3, 1.0
"""Largest share of a trial, and largest number of its parts, that it is advised to leave out; and
shortest time without fast commands between two parts, s."""

MAX_LEFT = 0.5
"""Share of the loss beyond that of healthy trials with other gaits that a fault may leave. One that
leaves more is not the cause of the loss, and what causes it may cause the rest too."""

COMPLETE = 0.1
"""Share that a fault leaves if it is taken for the cause of a loss in any gait, unless a refit
explains it too. In 15 recordings of healthy robots that were not judged, in gaits that no healthy
trial has and that a refit did not explain, the nearest fault left 0.53 or more."""

MAX_JOINTS = 3
"""Joints that are named, the fastest relative to the healthy trials first."""

REMEDY = (
    "record this robot again, {}, and diagnose the new log in place of this one. Or send the "
    "commands of this robot to a healthy one of the same type, and repeat the diagnosis with its "
    "log as one more healthy one (--healthy FILE, beside the others)"
)
"""What decides on a doubt: trials that a user can have of a robot that is damaged now."""

LONGER = (
    "record this robot again, with the same movements for twice as long, and diagnose the new log"
)
"""What decides on a doubt about a gait that the healthy trials have: more of it."""

MOVING_LONGER = "record this robot again, so that it moves for longer, and diagnose the new log"
"""What decides on a doubt about a robot that soon lies or stands."""

LEFT_OUT = ". Or import again without the fast part (with {}), and repeat the diagnosis"
"""What decides too, if the healthy trials cover all but a few parts of the imported ones."""

MAX_SHARE = 0.1
"""Share of the loss that a fault explains beside others, up to which it has to beat a refit."""

WHOLE_TRIALS = (
    "no hypothesis reproduces the trials, and over a whole trial an error of the self-model grows "
    "as large as the effect of a fault"
)
"""The reason of ``unreproduced``. Across gaps of 0.05 to 0.2, comparators of whole trials were
right in 594 of 889 diagnoses that had no rival, and in no range of the loss in 95 %."""

SEGMENTS = (
    "repeat the diagnosis with --comparator segment-prediction, or without odometry "
    "segment-prediction-onboard: they compare short segments, and need the joint positions and the "
    "angular velocity of the base"
)
MIN_SEGMENTED = 49
"""Shortest trial that these comparators accept, control steps."""


def unreproduced(fit: Fit, problem: Problem) -> Doubt | None:
    """Returns the doubt about trials without comparable segments that are not reproduced, if any.

    Several losses of a trial are 0 but for ``LOSS_FLOOR``. One distance, in a unit of its own, is
    0: among a hundred hypotheses, one has a small distance by chance.
    """
    has_many = problem.losses([INTACT]).shape[1] > 1
    if has_many and problem.table.uses_segments([part.trial for part in problem.trials]):
        return None
    every = [part.trial.trajectory.steps for part in (*problem.healthy_trials, *problem.trials)]
    again = f"record trials of {MIN_SEGMENTED} control steps or more, and "
    limit = significance.LOSS_FLOOR if has_many else significance.NEGLIGIBLE_LOSS
    remedy = (again if min(every) < MIN_SEGMENTED else "") + SEGMENTS
    return Doubt(WHOLE_TRIALS, remedy) if fit.loss > limit else None


def contradiction(best: Hypothesis, problem: Problem) -> Doubt | None:
    """Returns the doubt about trials of which some are of a healthy robot, and others are not.

    One hypothesis predicts some trials better than the empty one does, by ``MIN_Z_OF_STEP``, and
    others as much worse; and the better of the two in each trial predicts all of them significantly
    better than the best hypothesis, by the surrogate. Of 56 pairs of trials of one robot, healthy
    or with one of six faults, at gaps of 0.05 and 0.1, the empty one led by at most 0.4 in a trial.
    """
    table, trials = problem.surrogate
    if problem.settings.diagnostic_search == EA:
        table, trials = problem.table, problem.trials
    if len(trials) < 2 or not table.uses_segments([whole(one).trial for one in trials]):
        return None
    known = [INTACT, *table.known(trials)]
    each = [table.losses(known, [one]) for one in trials]
    totals = [rows.sum(axis=1, keepdims=True) for rows in each]
    nearer = [np.where(t < t[0], rows, rows[0]) for rows, t in zip(each, totals, strict=True)]
    both = dict(zip(known, np.concatenate(nearer, axis=1), strict=True))
    faults = search.chosen_of(known, lambda some: np.array([both[one] for one in some]))
    pairs = [rows[[0, known.index(faults)]] for rows in each]
    healthy, failed = (
        [
            one
            for one, pair in zip(trials, pairs, strict=True)
            if pair.size and significance.lead(*pair[order]) >= significance.MIN_Z_OF_STEP
        ]
        for order in ([0, 1], [1, 0])
    )
    if not (healthy and failed):
        return None
    if not significance.is_better(both[faults], table.losses([best], trials)[0]):
        return None
    # Beside one fault, the empty hypothesis may be the better of two wrong ones.
    other = search.chosen_of(known, lambda some: table.losses(list(some), healthy))
    these, those = (
        " and ".join(f"'{problem.names[whole(one).trial.path]}'" for one in some)
        for some in (healthy, failed)
    )
    alone = f"diagnose {those} alone"
    return Doubt(
        f"the trials contradict each other: {other} predicts {these} better than {faults} does, "
        f"{faults} predicts {those} better, and no hypothesis predicts all of them",
        f"{alone}, and {these} alone"
        if other
        else f"if the robot was healthy in {these}, name that with --healthy FILE and diagnose the "
        f"rest; if not, {alone}",
        f"these logs contradict each other: "
        f"{f'in {these}, {other.words}' if other else f'no fault shows in {these}'}; in {those}, "
        f"{faults.words}",
    )


def doubt_of(accused: Hypothesis, fit: Fit, problem: Problem) -> Doubt | None:
    """Returns the reason for which an accusation cannot be made; None if it can.

    Args:
        accused: The hypothesis that is said to be true; if it is empty, no hypothesis explains the
            trials.
        fit: How well the best hypothesis predicts them.
        problem: The trials. Nothing is doubted without comparable healthy trials, or with a
            self-model that is not calibrated.
    """
    healthy, reference, reason = problem.healthy_trials, _reference(accused, fit, problem), ""
    is_comparable = problem.refit is not None and problem.healthy([INTACT]) is not None
    # In the same movement of a healthy robot, the error of the self-model is on both sides.
    is_told = problem.contrast(accused) >= significance.MIN_Z_ACROSS_TRIALS
    if not is_comparable or is_told:
        return None
    if known := sufficient_trials(accused, problem):
        intact = problem.table.losses([INTACT], known).mean()
        if accused and intact <= problem.hardest + significance.LOSS_FLOOR:
            reason = refit_reason(accused, problem)
        return Doubt(reason, LONGER) if reason else None
    loss = fit.intact_loss if accused else fit.loss
    has_one_gait = _have_one_gait(healthy)
    beyond, ratio = loss - significance.LOSS_FLOOR, significance.LOSS_RATIO
    is_small = beyond <= ratio ** (2 if has_one_gait else 1) * reference
    faster = faster_joints(problem.trials, problem)
    left = share_left(accused, fit, problem)
    if left > MAX_LEFT:
        if is_small or faster:
            whatever = f"{accused} explains less" if accused else "no hypothesis explains more"
            reason = (
                f"{whatever} than {1 - MAX_LEFT:.0%} of the loss beyond that of the healthy trials"
            )
    elif is_small:
        joints = {joint.name for joint in problem.space.anatomy.joints}
        parts = [*fit.joints, *(fault.part for fault in accused.faults if fault.part in joints)]
        if left <= COMPLETE and beyond > reference:
            reason = refit_reason(accused, problem)
        elif any(joint in faster for joint in parts):
            faster = {joint: speeds for joint, speeds in faster.items() if joint in parts}
            reason = f"the healthy trials do not cover {' and '.join(faster)}"
        elif has_one_gait:
            reason = (
                f"the healthy trials have one gait, which does not tell how large the error of the "
                f"self-model is in another, and {accused} explains no more than it may"
            )
        else:
            reason = refit_reason(accused, problem)
    return _doubt(reason, faster, problem) if reason else None


def _reference(accused: Hypothesis, fit: Fit, problem: Problem) -> float:
    """Returns the mean loss beside which a loss is small.

    Beside an accusation it is that of the healthy trials: a fault may make a motion as sensitive as
    the self-model without it says. Without one, it is what is expected of the best hypothesis.
    """
    return problem.hardest if accused else max(fit.healthy_loss or 0.0, problem.hardest)


def _have_one_gait(trials: Sequence[TrialPart]) -> bool:
    """Returns whether trials have one gait, and the velocity that is asked for in it is the same.

    A policy has much the same commands straight on and in a turn, and other motions.
    """
    drivers = [part.trial.plan.controller for part in trials]
    asked = {one.design.velocity for one in drivers if isinstance(one, Controller)}
    first = [trials[0].rows]
    return len(asked) <= 1 and all(have_one_gait([one.rows], first) for one in trials)


def _doubt(reason: str, faster: Mapping[str, tuple[float, float]], problem: Problem) -> Doubt:
    if not faster:
        return Doubt(reason, REMEDY.format("with the commands of a healthy log"))
    joint, (speed, covered) = next(iter(faster.items()))
    listed = "; ".join(
        f"{joint}: commands up to {speed:.2g} rad/s, healthy {covered:.2g}"
        for joint, (speed, covered) in list(faster.items())[:MAX_JOINTS]
    )
    return Doubt(
        f"{reason}, and these trials are faster than the healthy ones ({listed})",
        REMEDY.format(
            f"moving as the healthy robot did ({joint} commanded at {covered:.2g} rad/s at most, "
            f"not at {speed:.2g} rad/s as now)"
        )
        + (LEFT_OUT.format(" and ".join(parts)) if (parts := fast_parts(faster, problem)) else ""),
    )


def supported(best: Hypothesis, problem: Problem) -> tuple[Hypothesis, Problem]:
    """Returns a hypothesis without the faults that an error of the self-model explains as well.

    A fault beside others is doubted if it explains little of the loss, or if the others alone do
    not make the trials unexplained. It is left out if a self-model that is fitted to the healthy
    trials and to these, with the others in these, predicts all of them as well as one that is
    fitted with all the faults in them. The problem that is returned has the losses by that
    self-model, which has absorbed the faults left out.

    Nothing is left out of a hypothesis that does not explain the trials: a fault is missing.
    """
    rest, by_refit = best, problem
    if problem.refit is None or problem.healthy([INTACT]) is None or len(best) < 2:
        return best, problem
    if best.spec_part or is_too_high(fit_of(best, problem)):  # a fit has the compiled model
        return best, problem
    while fewer := [one for one in problem.space.with_one_less(rest) if 0 < len(one) < len(rest)]:
        for one in by_total_loss(fewer, problem.losses):
            if (found := _without_some(one, best, problem)) is not None:
                rest, by_refit = found
                break
        else:
            break
    return rest, by_refit


def _without_some(
    fewer: Hypothesis, best: Hypothesis, problem: Problem
) -> tuple[Hypothesis, Problem] | None:
    """Returns fewer faults and the problem of a refit with which they explain as much, if any."""
    others = best.lacking(fewer)
    if not others or not all(fault.kind.affects_dynamics for fault in others):
        return None  # the readings of a sensor are not fitted
    anatomy = problem.space.anatomy
    if all(explains_standing(fault, problem.standing, anatomy) for fault in others):
        return None  # no parameter of a self-model stops joints under commands
    rest = search.with_fitted_severities(fewer, problem.coarse, problem.space)
    losses = problem.losses([best, rest, INTACT])
    if len(rest) < len(fewer) or not np.isfinite(losses).all():
        return None
    loss, without, intact = losses.mean(axis=1)
    is_small = without - loss <= MAX_SHARE * (intact - loss)
    if not is_small and is_too_high(fit_of(rest, problem)):
        return None
    joints = joints_of(others, problem) if problem.has_joints else []
    if (by_some := problem.refitted(rest)) is None:
        return None
    with_some = _with_healthy(rest, by_some)

    def is_needed(by_all: Problem | None) -> bool:
        return (
            by_all is None
            or significance.is_better(_with_healthy(best, by_all), with_some)
            or any(
                significance.joint_is_better(
                    by_all.of_joint(joint, [best])[0], by_some.of_joint(joint, [rest])[0]
                )
                for joint in joints
            )
        )

    # A refit is most of the cost of a long trial, and one with all faults hardly predicts it worse.
    is_clear = problem.is_long and is_needed(problem)
    return None if is_clear or is_needed(problem.refitted(best)) else (rest, by_some)


def _with_healthy(hypothesis: Hypothesis, problem: Problem) -> FloatArray:
    """Returns the losses of a hypothesis on the trials, then those of the healthy trials."""
    healthy = problem.table.losses([INTACT], problem.healthy_trials)
    return np.concatenate([*problem.losses([hypothesis]), *healthy])


def fit_of(best: Hypothesis, problem: Problem) -> Fit:
    """Returns how well the best hypothesis predicts the trials.

    Trials with the gait of the healthy ones are compared with all of these. Others are compared
    with what is expected of a healthy robot in them (``Problem.expected``): gaits differ in how
    hard they are to predict, which the scatter of the pieces of all healthy trials does not
    contain. Joints are suspected only in the same gait: another one loads the joints otherwise, and
    16 of 24 healthy robots would be suspected.
    """
    losses, intact = problem.losses([best, INTACT])
    rows = ([part.rows for part in each] for each in (problem.trials, problem.healthy_trials))
    is_one_gait = have_one_gait(*rows)
    joints = excesses(INTACT, problem) if is_one_gait and not best else {}
    loss, intact_loss = float(losses.mean()), float(intact.mean())
    healthy_loss = excess = left = None
    reference = problem.reference if is_one_gait else problem.expected(best)
    if reference is not None:
        healthy_loss = float(reference.mean())
        excess = significance.excess_over_healthy(losses, reference)
        left = significance.share_left(loss, intact_loss, healthy_loss)
    return Fit(
        loss,
        intact_loss,
        healthy_loss,
        excess,
        threshold=significance.MIN_Z_OF_ONE_GAIT
        if is_one_gait
        else significance.MIN_Z_OF_OTHER_GAITS,
        has_faults=bool(best),
        left=left,
        joints={joint: z for joint, z in joints.items() if z >= significance.MIN_Z_OF_JOINT},
    )


def is_too_high(fit: Fit) -> bool:
    """Returns whether the loss is higher than expected, significantly and by much."""
    return unlikeness(fit) > 1.0


def unlikeness(fit: Fit) -> float:
    """Returns the loss of the best hypothesis over the largest that is expected of the right one.

    From 1 on, the best hypothesis does not explain the trials: its loss is higher than expected,
    significantly and by much, or that of a joint is. In the gait of the healthy trials, what is
    expected does not tell that faults make a motion harder to predict: a slipping foot, a body on
    the ground. So the loss of a hypothesis with faults has to exceed it by ``FAULTY_RATIO`` too. 0
    without healthy trials.
    """
    if fit.healthy_loss is None or fit.excess is None:
        return 0.0
    ratio, many = (
        fit.loss / (times * fit.healthy_loss + significance.LOSS_FLOOR)
        for times in (significance.FAULTY_RATIO, significance.LOSS_RATIO)
    )
    excess = fit.excess / fit.threshold
    return max(many, min(excess, ratio) if fit.has_faults else excess)


def sufficient_trials(accused: Hypothesis, problem: Problem) -> list[TrialPart]:
    """Returns the trials with the gait of a healthy one, if they suffice for an accusation.

    They do if each fault is required to predict them; without a fault, if there are no other
    trials. Otherwise the result is empty.
    """
    drivers = [part.trial.plan.controller for part in problem.healthy_trials]
    healthy = [part.rows for part in problem.healthy_motions]
    known = [
        part
        for part in problem.trials
        if part.trial.plan.controller in drivers
        or (have_one_gait([part.rows], healthy) and not faster_joints([part], problem))
    ]
    if not accused or not known:
        return known if len(known) == len(problem.trials) else []
    losses, *others = problem.table.losses([accused, *problem.space.with_one_less(accused)], known)
    return known if all(significance.is_better(losses, fewer) for fewer in others) else []


def share_left(accused: Hypothesis, fit: Fit, problem: Problem) -> float:
    """Returns the share of the loss beyond that of the healthy trials that a hypothesis leaves.

    An empty one leaves all. Without such a loss, nothing is left.
    """
    if not accused or fit.healthy_loss is None:
        return 1.0
    loss, intact = problem.losses([accused, INTACT]).mean(axis=1)
    healthy = min(fit.healthy_loss, problem.hardest)
    return significance.share_left(float(loss), float(intact), healthy) or 0.0


def refit_reason(accused: Hypothesis, problem: Problem) -> str:
    """Returns why a self-model that is fitted to all trials leaves a doubt; empty without.

    It leaves one if it predicts neither the trials significantly worse than the fault does, nor the
    healthy trials significantly worse than the self-model that is fitted to them alone. A fault of
    readings alone, which no fit changes, is compared by the same refit: errors of motion cancel.
    Any other one has to predict the healthy trials, or its joint in them, significantly worse than
    none: if not, it may be a parameter that they leave open, and that a prior kept the refit from.
    """
    is_of_motion = len(accused.dynamics_part) > 0
    if is_of_motion and not _exclude(accused, problem):
        return f"the healthy trials do not exclude {accused}, and the self-model may lack it"
    if (refit := problem.refitted(INTACT)) is None:
        return f"the trials are too short for a fit that could explain them without {accused}"
    known, fitted = problem.table.losses, refit.table.losses
    with_fault = known if is_of_motion else fitted
    is_needed = any(
        significance.is_better(by([fault], trials)[0], fitted([INTACT], trials)[0])
        for by, fault, trials in (
            (with_fault, accused, problem.trials),
            (known, INTACT, problem.healthy_trials),
        )
    )
    without = f"a self-model that is fitted to all trials predicts them as well without {accused}"
    return "" if is_needed else without


def _exclude(accused: Hypothesis, problem: Problem) -> bool:
    """Returns whether the healthy trials, or a joint in them, are predicted worse with faults."""
    pair = [INTACT, accused]
    return significance.is_better(*problem.table.losses(pair, problem.healthy_trials)) or any(
        significance.joint_is_better(*problem.of_joint(joint, pair, healthy=True))
        for joint in joints_of(accused.faults, problem)
    )


def faster_joints(trials: Sequence[TrialPart], problem: Problem) -> dict[str, tuple[float, float]]:
    """Returns the joints that trials move faster than the healthy ones of a problem cover.

    The fastest relative to them is first. By the joint's name, the speed of its commands in the
    trials and in the healthy trials, rad/s.
    """
    anatomy = problem.space.anatomy
    speeds, covered = (fastest_commands(each) for each in (trials, problem.healthy_motions))
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
    covered = fastest_commands(problem.healthy_motions)[motors]
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
