"""Calibration of the self-model: its continuous parameters, fitted to trials of the intact robot.

The parameters are found by a box-constrained least squares over short predictions from logged
states (``mujoco.minimize``), with a prior that keeps what the trials do not show near nominal. The
delay, which is a whole number, is tried out.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import mujoco.minimize
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError
from selfmodel.faults.build import apply_faults
from selfmodel.faults.hypothesis import INTACT
from selfmodel.robot.control_delay import MAX_CONTROL_DELAY
from selfmodel.robot.parameters import (
    Parameters,
    edited_model,
    from_factors,
    nominal,
    with_parameters,
)
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration_segments import (
    CalibrationSegments,
    calibration_segments_of,
)
from selfmodel.simulation.outcome import SimulationStats
from selfmodel.simulation.prediction import predict
from selfmodel.simulation.requests import Segments
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.signal_difference import difference
from selfmodel.trials.signal_scales import CALIBRATION_ERROR_SCALES
from selfmodel.trials.state_estimation import BASE
from selfmodel.trials.trial import Trial

PRIOR = 0.15
"""How far a parameter may be expected from nominal, as a deviation of its logarithm."""

SHARE = 0.05
"""The weight of the prior beside the data: all errors together count as 1 / SHARE**2 independent
ones, however many there are, because those of neighbouring steps and columns say the same thing
again and again."""

BOUND = 1.2
"""How far the logarithm of a parameter may be from nominal: a factor of 0.3 to 3.3."""

STEP = 0.1
"""The finite difference of a logarithm. Contact makes a small one meaningless: a parameter moves
when a foot comes down, and that shows as noise between near values."""

DELAYS = range(MAX_CONTROL_DELAY + 1)
"""Control delays that are tried."""

ITERATIONS = 3

EXACT = 0.01
"""The root mean square error, in ``CALIBRATION_ERROR_SCALES``, below which the model is taken to be
the robot."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """A self-model fitted to trials.

    Attributes:
        robot: The robot whose MJCF says the fitted parameters.
        parameters: The fitted parameters.
        deviations: The standard deviation of each factor's logarithm, ``(factors,)`` in the order
            of ``Parameters.factors``: that of the prior where the trials show nothing, less where
            they show something.
        error_before: Root mean square error of the predictions with the nominal parameters, in
            units of ``CALIBRATION_ERROR_SCALES``.
        error: The same with the fitted ones.
    """

    robot: Robot
    parameters: Parameters
    deviations: FloatArray
    error_before: float
    error: float


def calibrate(robot: Robot, trials: Sequence[Trial], threads: int) -> Calibration:
    """Fits the continuous parameters of a robot to trials in which nothing was wrong with it.

    The result does not depend on the number of threads. A model that predicts the trials exactly
    is left as it is, to the bit.

    A trial in which the base's position and linear velocity were hardly ever observed together is
    taken to begin in the model's start pose, and the base is carried on from there. A step that
    was late, a command that is not known, or a state that is not where a stretch begins (at every
    tenth step) leaves it off for the rest of that trial.

    Args:
        robot: The robot as its model describes it.
        trials: At least one, each with the commands and the state; the base's position and linear
            velocity may be NaN.
        threads: Threads for the physics.

    Raises:
        InputError: There are no trials, or one was not observed well enough.
    """
    if not trials:
        raise InputError("expected at least one trial of the intact robot, got none")
    data = [calibration_segments_of(trial) for trial in trials]
    start = nominal(robot)
    before = _error(robot, start, data, threads)
    deviations = np.full(len(start.factors), PRIOR)
    if before < EXACT:
        return Calibration(robot, start, deviations, before, before)
    zero = np.zeros((len(start.factors), 1))

    def residuals_at(delay: int, of: Sequence[CalibrationSegments]) -> Residual:
        return partial(_residuals, robot, of, delay, threads)

    delay = min(DELAYS, key=lambda steps: float(np.sum(residuals_at(steps, data)(zero) ** 2)))
    residual = residuals_at(delay, data)
    fitted, _ = mujoco.minimize.least_squares(
        zero,
        residual,
        bounds=[np.full_like(zero, -BOUND), np.full_like(zero, BOUND)],
        jacobian=lambda x, _residual: _slopes(residual, x),
        max_iter=ITERATIONS,
        xtol=1e-3,
        verbose=mujoco.minimize.Verbosity.SILENT,
    )
    found = from_factors(np.exp(fitted.ravel()), delay)
    # What a factor does to the whole of a long simulation is mostly chaos, and tells nothing of it.
    slopes = _slopes(residuals_at(delay, _placed(robot, found, data, threads)), fitted)
    count = len(slopes) - len(zero)  # of the errors: the rest is the prior, at its weight
    spread = np.linalg.inv(slopes.T @ slopes) * count * SHARE**2
    return Calibration(
        robot=with_parameters(robot, found),
        parameters=found,
        deviations=np.sqrt(np.diag(spread)),
        error_before=before,
        error=_error(robot, found, data, threads),
    )


def prediction_error(robot: Robot, trials: Sequence[Trial], threads: int) -> float:
    """Returns how badly a self-model predicts the motion in trials.

    Args:
        robot: The self-model.
        trials: As for ``calibrate``.
        threads: Threads for the physics.

    Returns:
        The root mean square error over all columns after all steps that are judged, in units of
        ``CALIBRATION_ERROR_SCALES``.

    Raises:
        InputError: A trial was not observed well enough.
    """
    data = [calibration_segments_of(trial) for trial in trials]
    return _error(robot, nominal(robot), data, threads)


Residual = Callable[[FloatArray], FloatArray]
"""From logarithms of factors, ``(factors, m)``, to residuals, ``(residuals, m)``."""


def _slopes(residual: Residual, x: FloatArray) -> FloatArray:
    """The derivative of the residuals, ``(residuals, factors)``."""
    steps = STEP * np.eye(len(x))
    ahead, behind = residual(x + steps), residual(x - steps)
    return np.asarray((ahead - behind) / (2 * STEP))


def _residuals(
    robot: Robot,
    data: Sequence[CalibrationSegments],
    delay: int,
    threads: int,
    logarithms: FloatArray,
) -> FloatArray:
    """See ``Residual``; the prior's are among them."""
    logarithms = np.reshape(logarithms, (len(logarithms), -1))
    models = [from_factors(np.exp(row), delay) for row in logarithms.T]
    errors = _errors(robot, models, data, threads)
    weight = np.sqrt(len(errors)) * SHARE / PRIOR
    return np.concatenate([_damped(errors), weight * logarithms])


def _error(
    robot: Robot, parameters: Parameters, data: Sequence[CalibrationSegments], threads: int
) -> float:
    return float(np.sqrt(np.mean(_errors(robot, [parameters], data, threads) ** 2)))


def _placed(
    robot: Robot, found: Parameters, data: Sequence[CalibrationSegments], threads: int
) -> list[CalibrationSegments]:
    """The same stretches, each beginning by itself: with the base where a model has it by then."""
    predicted = _predictor(robot, [found], threads)

    def placed(stretches: CalibrationSegments) -> CalibrationSegments:
        segments = stretches.segments
        if "base_position" in segments.states:
            return stretches
        made = predicted(replace(segments, record=BASE))
        states = {**segments.states, **{signal: made[signal][0, :, 0] for signal in BASE}}
        return replace(stretches, segments=replace(segments, states=states))

    return [placed(stretches) for stretches in data]


def _errors(
    robot: Robot, models: Sequence[Parameters], data: Sequence[CalibrationSegments], threads: int
) -> FloatArray:
    """The errors of the predictions in units of the scales, ``(errors, models)``."""
    predicted = _predictor(robot, models, threads)
    rows = []
    for stretches in data:
        made = predicted(stretches.segments)
        for signal, scale in CALIBRATION_ERROR_SCALES.items():
            if signal in stretches.observed:
                observed = stretches.observed[signal]
                error = difference(signal, made[signal][:, :, 1:], observed) / scale
                rows.append(error[:, stretches.judged].reshape(len(models), -1))
    return np.concatenate(rows, axis=1).T


def _predictor(
    robot: Robot, models: Sequence[Parameters], threads: int
) -> Callable[[Segments], Behaviour]:
    """Predicts with models that have one delay: ``(models, segments, horizon + 1, width)``."""
    delay = models[0].delay
    embodiments = [
        apply_faults(edited_model(robot, parameters), robot.anatomy, INTACT)
        for parameters in models
    ]

    def predicted(segments: Segments) -> Behaviour:
        outcome = predict(
            robot, embodiments, segments, threads=threads, stats=SimulationStats(), delay=delay
        )
        return outcome.behaviour

    return predicted


def _damped(errors: FloatArray) -> FloatArray:
    """Residuals whose squares grow as errors do, once these exceed 1 (pseudo-Huber)."""
    return np.asarray(np.sign(errors) * np.sqrt(2 * (np.sqrt(1 + errors**2) - 1)))
