"""Check of healthy trials whose joints are predicted absurdly badly: signs, order, offset, delay.

A joint is suspicious if the calibrated model predicts its position over a tenth of a second worse
than no motion at all, or off to one side. Then the same model predicts the trials with the signs or
the order of the columns corrected, and the best correction names the joint.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.robot.anatomy import MAX_CONTROL_DELAY
from selfmodel.robot.robot import Robot
from selfmodel.simulation.fit import Fit
from selfmodel.simulation.model_factors import joint_of_motor
from selfmodel.simulation.segments import (
    POSITIONS,
    ObservedSegments,
    SegmentErrors,
    is_better,
    root_mean_square,
)
from selfmodel.trials.estimation import JOINTS

MAX_RATIO, MIN_ERROR = 1.0, 0.06
"""Largest root mean square error of a joint relative to that of the prediction of no motion; and
smallest one of a suspicious joint, rad: the ratio of a joint that rests is that of two noises."""

MAX_BIAS = 0.04
"""Largest absolute mean error of a joint, rad."""

MIN_Z, WORST, OTHERS = 3.0, 3, 3
"""Standard errors by which a correction must predict the segments better; joints with the largest
ratios, which a correction is about; and joints with the next ones, with which they may have been
exchanged: both of an exchange are predicted badly."""


@dataclass(frozen=True)
class Suspicion:
    """A probable error in the recording of healthy trials.

    Attributes:
        joint: The joint that is predicted worst; None for a delay of all commands.
        cause: The correction that helps, or the measured error.
    """

    joint: str | None
    cause: str

    def __str__(self) -> str:
        of = "" if self.joint is None else f" of {self.joint}"
        return (
            f"your healthy trials are predicted badly: check signs, order, delay{of} ({self.cause})"
        )

    def to_dict(self) -> dict[str, str | None]:
        """Returns the JSON values."""
        return {"joint": self.joint, "cause": self.cause, "message": str(self)}


def suspicion(segments: SegmentErrors, fit: Fit) -> Suspicion | None:
    """Returns the probable error in the recording of healthy trials; None if there is none."""
    hinges, delay = segments.robot.anatomy.hinges, fit.parameters.delay
    errors = segments.joint_errors(fit.errors)
    sizes, biases = root_mean_square(errors), errors.mean(axis=0)
    # The error of the prediction of no motion; the motion of an unknown hinge is 0.
    starts = [own.segments.states[POSITIONS][:, np.newaxis] for own in segments.data]
    motion = [
        (own.observed[POSITIONS] - start)[own.valid]
        for own, start in zip(segments.data, starts, strict=True)
    ]
    still = root_mean_square(np.nan_to_num(np.concatenate(motion)))
    ratios = np.where(sizes < MIN_ERROR, 0.0, sizes / np.maximum(still, 1e-9))
    worst, leaning = int(np.argmax(ratios)), int(np.argmax(np.abs(biases)))
    leans = abs(biases[leaning]) > MAX_BIAS
    if ratios[worst] > MAX_RATIO or leans:
        correction = _best_correction(segments, fit, np.argsort(-ratios))
        if correction is not None:
            return correction
    if ratios[worst] > MAX_RATIO and abs(biases[worst]) <= MAX_BIAS:
        cause = f"its error is {ratios[worst]:.1f} times that of no motion"
        return Suspicion(hinges[worst], cause)
    if leans:
        cause = f"its mean error is {biases[leaning]:.2f} rad: an offset?"
        return Suspicion(hinges[leaning], cause)
    if delay >= MAX_CONTROL_DELAY > segments.robot.control_delay:
        cause = f"the control delay is {delay} steps, the largest that is fitted"
        return Suspicion(None, cause)
    return None


def _corrected(own: ObservedSegments, joints: IndexArray, motors: IndexArray) -> ObservedSegments:
    """Returns segments with other columns: the number of each from 1, negative for its negative."""

    def read(values: FloatArray, columns: IndexArray) -> FloatArray:
        return np.asarray(values[..., np.abs(columns) - 1] * np.sign(columns))

    segments = own.segments
    states, observed = (
        {**signals, **{name: read(signals[name], joints) for name in JOINTS}}
        for signals in (segments.states, own.observed)
    )
    changed = replace(segments, states=states, commands=read(segments.commands, motors))
    return replace(own, segments=changed, observed=observed)


def _best_correction(segments: SegmentErrors, fit: Fit, worst: IndexArray) -> Suspicion | None:
    """Returns the correction with the lowest loss; None if none is significantly better."""
    losses = segments.losses(fit.errors)
    best, least = None, losses
    for cause, joints, motors in _corrections(segments.robot, worst):
        data = [_corrected(own, joints, motors) for own in segments.data]
        changed = replace(segments, data=data)
        own = changed.losses(changed.of([fit.parameters])[:, 0])
        if own.mean() < least.mean() and is_better(own, losses, MIN_Z):
            best, least = cause, own
    return best


def _corrections(
    robot: Robot, worst: IndexArray
) -> Iterator[tuple[Suspicion, IndexArray, IndexArray]]:
    """Yields changes of the signs of the worst joints, and exchanges with others.

    Each is the joint that it is about, and the columns of joints and of motors. The numbers of the
    joints begin with the worst.
    """
    names = robot.anatomy.hinges
    joints, motors = np.arange(len(names)) + 1, np.arange(robot.model.nu) + 1
    motors_of = [np.flatnonzero(joint_of_motor(robot) == number) for number in range(len(names))]

    def flipped(columns: IndexArray, places: IndexArray) -> IndexArray:
        return np.where(np.isin(columns - 1, places), -columns, columns)

    def swapped(columns: IndexArray, pair: IndexArray) -> IndexArray:
        exchanged = columns.copy()
        exchanged[pair] = columns[pair[::-1]]
        return exchanged

    def cause(joint: int, change: str) -> Suspicion:
        return Suspicion(names[joint], f"with {change} it is predicted better")

    suspects: list[int] = worst[: WORST + OTHERS].tolist()
    for number in suspects[:WORST]:
        angle, sign = flipped(joints, np.array([number])), "the other sign of its angle"
        yield cause(number, sign), angle, motors
        yield cause(number, f"{sign} and command"), angle, flipped(motors, motors_of[number])
    for first, second in combinations(suspects, 2):
        if first not in suspects[:WORST]:
            break
        pair = first, second
        angles, other = swapped(joints, np.array(pair)), names[second]
        yield cause(first, f"the angles of {other}"), angles, motors
        both = [motors_of[number] for number in pair]
        if all(len(own) == 1 for own in both):
            commands = swapped(motors, np.concatenate(both))
            yield cause(first, f"the angles and commands of {other}"), angles, commands
