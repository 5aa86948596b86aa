"""Check of healthy trials whose joints are predicted absurdly badly: signs, order, offset, delay.

A joint is suspicious if the calibrated model predicts its position over a tenth of a second worse
than no motion at all, or off to one side. Then the same model predicts the trials with the signs or
the order of the columns corrected, and the best correction names the joint.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.robot.control_delay import MAX_CONTROL_DELAY
from selfmodel.robot.robot import Robot
from selfmodel.simulation.model_factors import Parameters, joint_of_motor
from selfmodel.simulation.segment_errors import SegmentErrors, is_better
from selfmodel.simulation.segments import ObservedSegments
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

    Args:
        segments: Errors of segments of the healthy trials.
        parameters: The calibrated parameters.
        errors: Errors of their predictions, ``(errors,)``.
    """
    hinges = segments.robot.anatomy.hinges
    predicted = segments.joint_errors(errors)
    sizes = _root_mean_square(predicted)
    ratios = sizes / np.maximum(_root_mean_square(_motion(segments.data)), 1e-9)
    ratios[sizes < MIN_ERROR] = 0.0
    biases = predicted.mean(axis=0)
    worst, leaning = int(np.argmax(ratios)), int(np.argmax(np.abs(biases)))
    if ratios[worst] > MAX_RATIO or abs(biases[leaning]) > MAX_BIAS:
        corrected = _best_correction(segments, parameters, errors, np.argsort(-ratios)[:WORST])
        if corrected is not None:
            return corrected
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
    name: Signal = "joint_positions"
    motion = [
        (own.observed[name] - own.segments.states[name][:, np.newaxis])[own.valid] for own in data
    ]
    return np.asarray(np.nan_to_num(np.concatenate(motion)))


@dataclass(frozen=True, eq=False)
class _Correction:
    """A change of the columns of joints and motors.

    Attributes:
        joint: The joint that it is about.
        cause: The change as text.
        order: Column that each hinge is read from, ``(hinges,)``.
        signs: Sign of each hinge, ``(hinges,)``.
        motor_order: Column that each motor is read from, ``(motors,)``.
        motor_signs: Sign of each motor, ``(motors,)``.
    """

    joint: str
    cause: str
    order: IndexArray
    signs: FloatArray
    motor_order: IndexArray
    motor_signs: FloatArray

    def of(self, own: ObservedSegments) -> ObservedSegments:
        """Returns segments with the change."""
        segments = own.segments

        def joints(signals: dict[Signal, FloatArray]) -> dict[Signal, FloatArray]:
            changed = {name: signals[name][..., self.order] * self.signs for name in JOINTS}
            return {**signals, **changed}

        def motors(commands: FloatArray) -> FloatArray:
            return np.asarray(commands[..., self.motor_order] * self.motor_signs)

        past = segments.past
        return replace(
            own,
            segments=replace(
                segments,
                states=joints(dict(segments.states)),
                commands=motors(segments.commands),
                past=past if past is None else replace(past, commands=motors(past.commands)),
            ),
            observed=joints(dict(own.observed)),
        )


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
            best, least = each, own
    return None if best is None else Suspicion(best.joint, best.cause)


def _corrections(robot: Robot, worst: IndexArray) -> Iterator[_Correction]:
    """Yields a change of each sign, and exchanges with a joint of ``worst``."""
    hinges, motors = robot.anatomy.hinges, np.arange(robot.model.nu)
    hinge_of_motor = joint_of_motor(robot)
    order, ahead = np.arange(len(hinges)), np.ones(len(motors))
    for number, hinge in enumerate(hinges):
        signs = np.where(order == number, -1.0, 1.0)
        cause = "with the other sign of its angle"
        yield _Correction(hinge, f"{cause} it is predicted better", order, signs, motors, ahead)
        commands = np.where(hinge_of_motor == number, -1.0, 1.0)
        cause += " and command"
        yield _Correction(hinge, f"{cause} it is predicted better", order, signs, motors, commands)
    for one, other in combinations(range(len(hinges)), 2):
        if one not in worst and other not in worst:
            continue
        first, second = (one, other) if one in worst else (other, one)
        exchanged, straight = order.copy(), np.ones(len(hinges))
        exchanged[[one, other]] = exchanged[[other, one]]
        cause = f"with the angles of {hinges[second]} it is predicted better"
        yield _Correction(hinges[first], cause, exchanged, straight, motors, ahead)
        owns = [np.flatnonzero(hinge_of_motor == number) for number in (one, other)]
        if all(len(own) == 1 for own in owns):
            both = motors.copy()
            both[np.concatenate(owns)] = both[np.concatenate(owns[::-1])]
            cause = f"with the angles and commands of {hinges[second]} it is predicted better"
            yield _Correction(hinges[first], cause, exchanged, straight, both, ahead)
