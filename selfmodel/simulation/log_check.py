"""Check of healthy trials whose joints are predicted absurdly badly: signs, order, offset, delay.

A joint is suspicious if the calibrated model predicts its position over a tenth of a second worse
than no motion at all, or off to one side. Then the same model predicts the trials with the signs or
the order of the columns corrected, and the best correction names the joint.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.robot.anatomy import MAX_CONTROL_DELAY
from selfmodel.robot.robot import Robot
from selfmodel.simulation.model_factors import Parameters, joint_of_motor
from selfmodel.simulation.segments import ObservedSegments, SegmentErrors, is_better
from selfmodel.trials.estimation import JOINTS
from selfmodel.trials.signals import Signal

MAX_RATIO = 1.0
"""Largest root mean square error of a joint relative to that of the prediction of no motion."""

MIN_ERROR = 0.06
"""Smallest root mean square error of a suspicious joint, rad: the ratio of a joint that rests is
that of two noises."""

MAX_BIAS = 0.04
"""Largest absolute mean error of a joint, rad."""

MIN_Z = 3.0
"""Standard errors by which a correction must predict the segments better."""

WORST = 3
"""Joints with the largest ratios: an exchange of columns includes one of them."""


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


def suspicion(
    segments: SegmentErrors, parameters: Parameters, errors: FloatArray
) -> Suspicion | None:
    """Returns the probable error in the recording of healthy trials; None if there is none.

    The errors are those of the predictions with the calibrated parameters, ``(errors,)``.
    """
    hinges = segments.robot.anatomy.hinges
    predicted = segments.joint_errors(errors)
    sizes = _root_mean_square(predicted)
    ratios = sizes / np.maximum(_root_mean_square(_motion(segments.data)), 1e-9)
    ratios[sizes < MIN_ERROR] = 0.0
    biases = predicted.mean(axis=0)
    worst, leaning = int(np.argmax(ratios)), int(np.argmax(np.abs(biases)))
    if ratios[worst] > MAX_RATIO or abs(biases[leaning]) > MAX_BIAS:
        correction = _best_correction(segments, parameters, errors, np.argsort(-ratios)[:WORST])
        if correction is not None:
            return correction
    if ratios[worst] > MAX_RATIO and abs(biases[worst]) <= MAX_BIAS:
        times = f"its error is {ratios[worst]:.1f} times that of no motion"
        return Suspicion(hinges[worst], times)
    if abs(biases[leaning]) > MAX_BIAS:
        return Suspicion(
            hinges[leaning], f"its mean error is {biases[leaning]:.2f} rad: an offset?"
        )
    if parameters.delay >= MAX_CONTROL_DELAY > segments.robot.control_delay:
        limit = f"the control delay is {parameters.delay} steps, the largest that is fitted"
        return Suspicion(None, limit)
    return None


def _root_mean_square(errors: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt((errors**2).mean(axis=0)))


def _motion(data: Sequence[ObservedSegments]) -> FloatArray:
    """Returns the motion of the joints since the start of the segment, ``(steps, hinges)``, rad.

    The motion of an unknown hinge is 0.
    """
    name = JOINTS[0]
    motion = [
        (own.observed[name] - own.segments.states[name][:, np.newaxis])[own.valid] for own in data
    ]
    return np.asarray(np.nan_to_num(np.concatenate(motion)))


@dataclass(frozen=True, eq=False)
class _Columns:
    """The column that each column is to be read from, and its sign, ``(columns,)`` each."""

    order: IndexArray
    signs: FloatArray

    @classmethod
    def of(
        cls, count: int, *, flipped: IndexArray | int | None = None, swapped: Sequence[int] = ()
    ) -> "_Columns":
        order, signs = np.arange(count), np.ones(count)
        if flipped is not None:
            signs[flipped] = -1.0
        order[list(swapped)] = swapped[::-1]
        return cls(order, signs)

    def __call__(self, values: FloatArray) -> FloatArray:
        return np.asarray(values[..., self.order] * self.signs)


@dataclass(frozen=True, eq=False)
class _Correction:
    """A change of the columns of joints and motors, and the joint that it is about."""

    suspicion: Suspicion
    hinges: _Columns
    motors: _Columns

    def of(self, own: ObservedSegments) -> ObservedSegments:
        """Returns segments with the change."""

        def joints(signals: Mapping[Signal, FloatArray]) -> dict[Signal, FloatArray]:
            return {**signals, **{name: self.hinges(signals[name]) for name in JOINTS}}

        segments = own.segments
        changed = replace(
            segments, states=joints(segments.states), commands=self.motors(segments.commands)
        )
        return replace(own, segments=changed, observed=joints(own.observed))


def _best_correction(
    segments: SegmentErrors, parameters: Parameters, errors: FloatArray, worst: IndexArray
) -> Suspicion | None:
    """Returns the correction with the lowest loss; None if none is significantly better."""
    losses = segments.losses(errors)
    best, least = None, losses
    for each in _corrections(segments.robot, worst):
        changed = replace(segments, data=[each.of(own) for own in segments.data])
        own = changed.losses(changed.of([parameters])[:, 0])
        if own.mean() < least.mean() and is_better(own, losses, MIN_Z):
            best, least = each.suspicion, own
    return best


def _corrections(robot: Robot, worst: IndexArray) -> Iterator[_Correction]:
    """Yields a change of each sign, and exchanges with a joint of ``worst``."""
    hinges, joints, motors = robot.anatomy.hinges, len(robot.anatomy.hinges), robot.model.nu
    motors_of = [np.flatnonzero(joint_of_motor(robot) == number) for number in range(joints)]

    def correction(
        hinge: int, change: str, of_hinges: _Columns, of_motors: _Columns
    ) -> _Correction:
        cause = Suspicion(hinges[hinge], f"with {change} it is predicted better")
        return _Correction(cause, of_hinges, of_motors)

    same = _Columns.of(motors)
    for number in range(joints):
        flipped, sign = _Columns.of(joints, flipped=number), "the other sign of its angle"
        yield correction(number, sign, flipped, same)
        commands = _Columns.of(motors, flipped=motors_of[number])
        yield correction(number, f"{sign} and command", flipped, commands)
    for pair in combinations(range(joints), 2):
        if not set(pair) & set(worst.tolist()):
            continue
        first, second = pair if pair[0] in worst else pair[::-1]
        swapped = _Columns.of(joints, swapped=pair)
        yield correction(first, f"the angles of {hinges[second]}", swapped, same)
        driven = [motors_of[number] for number in pair]
        if all(len(own) == 1 for own in driven):
            commands = _Columns.of(motors, swapped=np.concatenate(driven).tolist())
            change = f"the angles and commands of {hinges[second]}"
            yield correction(first, change, swapped, commands)
