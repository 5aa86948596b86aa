"""Calibration of the self-model: fits its continuous parameters to trials of the healthy robot.

The fit is a box-constrained nonlinear least squares over short predictions from logged states
(``mujoco.minimize``), with a Gaussian prior for parameters that the trials do not determine. The
control delay, an integer, is found by exhaustive search.

The joints of a robot with a fixed base are fitted one by one; see ``joint_calibration``.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

import mujoco.minimize
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError
from selfmodel.faults.build import apply_faults
from selfmodel.faults.hypothesis import INTACT
from selfmodel.robot.base.known_base import trial_with_known_base
from selfmodel.robot.control_delay import MAX_CONTROL_DELAY
from selfmodel.robot.parameters import (
    Parameters,
    factor_names,
    from_factors,
    model_with_parameters,
    nominal,
    with_parameters,
)
from selfmodel.robot.robot import Robot
from selfmodel.sandbox.budget import DEFAULT_BUDGET
from selfmodel.simulation.batch_memory import hypothesis_bytes
from selfmodel.simulation.calibration_segments import (
    CalibrationSegments,
    calibration_segments_of,
)
from selfmodel.simulation.joints.calibration import (
    JointCalibration,
    calibrated_joints,
    nominal_error,
    simulated_joint_steps,
)
from selfmodel.simulation.joints.segments import JointSegments, joint_segments_of
from selfmodel.simulation.outcome import SimulationStats
from selfmodel.simulation.prediction import predict
from selfmodel.simulation.requests import Segments
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.data_frame import data_frame
from selfmodel.trials.signal_difference import difference
from selfmodel.trials.signal_scales import CALIBRATION_ERROR_SCALES
from selfmodel.trials.state_estimation import BASE, JOINTS
from selfmodel.trials.trial import Trial

PRIOR_DEVIATION = 0.15
"""Standard deviation of the prior on the logarithm of each parameter's factor."""

PRIOR_WEIGHT = 0.05
"""Weight of the prior relative to the data. All errors together count as 1 / PRIOR_WEIGHT**2
independent errors, whatever their number: errors of neighbouring steps and columns are strongly
correlated."""

MAX_LOG_FACTOR = 1.2
"""Bound on the absolute logarithm of a parameter's factor: factors of 0.3 to 3.3."""

DIFFERENCE_STEP = 0.1
"""Step of the finite differences of a logarithm. Smaller steps are dominated by noise: a parameter
changes the time at which a foot makes contact."""

CANDIDATE_DELAYS = range(MAX_CONTROL_DELAY + 1)
"""Control delays of the exhaustive search, control steps."""

MAX_ERROR = 1e6
"""Bound on the absolute error of a prediction, in ``CALIBRATION_ERROR_SCALES``: the error of a
simulation that is no longer finite. The solver does not end on numbers that are not finite."""

MAX_ITERATIONS = 3
"""Largest number of iterations of the least-squares solver."""

EXACT_ERROR = 0.01
"""Root mean square error, in ``CALIBRATION_ERROR_SCALES``, below which the model counts as
exact."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """Result of a calibration.

    Attributes:
        robot: The robot with the fitted parameters in its MJCF.
        parameters: The fitted parameters.
        deviations: Posterior standard deviation of each factor's logarithm, ``(factors,)`` in the
            order of ``Parameters.factors``; ``PRIOR_DEVIATION`` for a factor without influence on
            the trials.
        error_before: Root mean square error of the predictions with the nominal parameters, in
            units of ``CALIBRATION_ERROR_SCALES``.
        error: Root mean square error with the fitted parameters, in the same units.
        joints: Fit of the joints of a robot with a fixed base; None for other robots.
    """

    robot: Robot
    parameters: Parameters
    deviations: FloatArray
    error_before: float
    error: float
    joints: JointCalibration | None = None

    def __repr__(self) -> str:
        lines = [
            f"<Calibration of {self.robot.name}: control delay {self.parameters.delay}",
            f"  error {self.error_before:.3g} before, {self.error:.3g} after",
        ]
        lines += [
            f"  {row['factor']:6.3f} (log deviation {row['deviation']:.3f})  {row['name']}"
            for row in self._rows()
        ]
        return "\n".join(lines) + ">"

    def to_dict(self) -> dict[str, Any]:
        """Returns the JSON values: factors, control delay, deviations and errors."""
        return ({} if self.joints is None else {"joints": self.joints.to_dict()}) | {
            **asdict(self.parameters),
            "deviations": [float(deviation) for deviation in self.deviations],
            "error_before": self.error_before,
            "error": self.error,
        }

    def to_pandas(self) -> Any:  # noqa: ANN401  # pandas is optional
        """Returns the factors as a ``pandas.DataFrame``: name, factor and deviation.

        Raises:
            InputError: pandas is not installed.
        """
        return data_frame(self._rows())

    def _rows(self) -> list[dict[str, Any]]:
        names, factors = factor_names(self.robot), self.parameters.factors
        return [
            {"name": name, "factor": float(factor), "deviation": float(deviation)}
            for name, factor, deviation in zip(names, factors, self.deviations, strict=True)
        ]


def calibrate(robot: Robot, trials: Sequence[Trial], threads: int) -> Calibration:
    """Fits the continuous parameters of a robot to trials of the healthy robot.

    The result does not depend on the number of threads. A model that predicts the trials exactly
    is returned unchanged, to the bit.

    If the base's position and linear velocity were rarely observed together in a trial, the trial
    is assumed to begin in the model's initial pose, and the state of the base is predicted from
    there on. After a late step, an unknown command, or an unknown state at the beginning of a
    segment (every tenth step), the rest of such a trial is not used.

    With a fixed base, gain, damping, dry friction and armature are fitted to joint positions, and
    the model remains as it is, to the bit, unless the fit predicts segments that were left out of
    it significantly better; see ``joint_calibration``.

    Args:
        robot: The robot as its model describes it.
        trials: At least one trial with commands and state; the base's position and linear velocity
            may be NaN.
        threads: Threads of MuJoCo's steps.

    Raises:
        InputError: There are no trials, too little of a trial was observed, or every simulation
            diverged.
    """
    if not trials:
        raise InputError("expected at least one trial of the healthy robot, got none")
    if robot.has_fixed_base:
        return _with_fitted_joints(robot, trials, threads)
    data = [calibration_segments_of(trial) for trial in trials]
    start = nominal(robot)
    stats = SimulationStats()
    before = _error(robot, start, data, threads, stats)
    deviations = np.full(len(start.factors), PRIOR_DEVIATION)
    if before < EXACT_ERROR:
        return Calibration(robot, start, deviations, before, before)
    zero = np.zeros((len(start.factors), 1))

    def residuals_at(delay: int, cut: Sequence[CalibrationSegments]) -> Residual:
        return partial(_residuals, robot, cut, delay, threads)

    delay = min(
        CANDIDATE_DELAYS, key=lambda steps: float(np.sum(residuals_at(steps, data)(zero) ** 2))
    )
    residual = residuals_at(delay, data)
    fitted, _ = mujoco.minimize.least_squares(
        zero,
        residual,
        bounds=[np.full_like(zero, -MAX_LOG_FACTOR), np.full_like(zero, MAX_LOG_FACTOR)],
        jacobian=lambda x, _residual: _slopes(residual, x),
        max_iter=MAX_ITERATIONS,
        xtol=1e-3,
        verbose=mujoco.minimize.Verbosity.SILENT,
    )
    fitted_parameters = from_factors(np.exp(fitted.ravel()), delay)
    error = _error(robot, fitted_parameters, data, threads, stats)
    if stats.diverged == stats.runs:
        raise InputError(
            f"{', '.join(trial.path for trial in trials)}: no simulation of the healthy robot "
            f"remained finite, before and after the fit: check the model and the units of the log"
        )
    # Independent segments: long simulations are chaotic, so their derivatives are meaningless.
    independent = _with_estimated_states(robot, fitted_parameters, data, threads)
    slopes = _slopes(residuals_at(delay, independent), fitted)
    count = len(slopes) - len(zero)  # number of errors; the other rows are the prior
    spread = np.linalg.inv(slopes.T @ slopes) * count * PRIOR_WEIGHT**2
    return Calibration(
        robot=with_parameters(robot, fitted_parameters),
        parameters=fitted_parameters,
        deviations=np.sqrt(np.diag(spread)),
        error_before=before,
        error=error,
    )


def simulated_steps(robot: Robot, trials: Sequence[Trial]) -> int:
    """Returns the number of control steps that ``calibrate`` simulates at most, but for retries.

    A model that predicts the trials exactly takes one prediction of each.

    Args:
        robot: The robot as its model describes it.
        trials: The trials, as for ``calibrate``.

    Raises:
        InputError: Too little of a trial was observed.
    """
    if robot.has_fixed_base:
        return simulated_joint_steps(robot, _joint_segments(robot, trials))
    cut = [calibration_segments_of(trial).segments for trial in trials]
    slopes = 2 * len(nominal(robot).factors)
    # Errors before and after, each delay, then slopes and a new point per iteration.
    models = 3 + len(CANDIDATE_DELAYS) + MAX_ITERATIONS * (slopes + 1) + slopes
    return models * sum(len(segments.commands) * segments.horizon for segments in cut)


def prediction_error(robot: Robot, trials: Sequence[Trial], threads: int) -> float:
    """Returns the prediction error of a self-model on trials.

    Args:
        robot: The self-model.
        trials: The trials, as for ``calibrate``.
        threads: Threads of MuJoCo's steps.

    Returns:
        The root mean square error over all columns after all judged steps, in units of
        ``CALIBRATION_ERROR_SCALES``.

    Raises:
        InputError: Too little of a trial was observed.
    """
    if robot.has_fixed_base:
        return nominal_error(robot, _joint_segments(robot, trials), threads)
    data = [calibration_segments_of(trial) for trial in trials]
    return _error(robot, nominal(robot), data, threads, SimulationStats())


def _with_fitted_joints(robot: Robot, trials: Sequence[Trial], threads: int) -> Calibration:
    fit = calibrated_joints(robot, _joint_segments(robot, trials), threads)
    gains = tuple(map(float, fit.parameters.values["gain"]))
    return Calibration(
        robot=fit.robot,
        parameters=replace(nominal(robot), motor_gains=gains, delay=fit.best.delay),
        deviations=np.append(np.full(4, PRIOR_DEVIATION), fit.best.deviations["gain"]),
        error_before=fit.nominal.error,
        error=fit.best.error,
        joints=fit,
    )


def _joint_segments(robot: Robot, trials: Sequence[Trial]) -> list[JointSegments]:
    return [joint_segments_of(trial_with_known_base(robot, trial)) for trial in trials]


Residual = Callable[[FloatArray], FloatArray]
"""Function from logarithms of factors, ``(factors, m)``, to residuals, ``(residuals, m)``."""


def _slopes(residual: Residual, x: FloatArray) -> FloatArray:
    """Returns the Jacobian of the residuals by central differences, ``(residuals, factors)``."""
    steps = DIFFERENCE_STEP * np.eye(len(x))
    ahead, behind = residual(x + steps), residual(x - steps)
    return np.asarray((ahead - behind) / (2 * DIFFERENCE_STEP))


def _residuals(
    robot: Robot,
    data: Sequence[CalibrationSegments],
    delay: int,
    threads: int,
    logarithms: FloatArray,
) -> FloatArray:
    """Returns the residuals of the data, then those of the prior; see ``Residual``."""
    logarithms = np.reshape(logarithms, (len(logarithms), -1))
    models = [from_factors(np.exp(row), delay) for row in logarithms.T]
    errors = _errors(robot, models, data, threads, SimulationStats())
    weight = np.sqrt(len(errors)) * PRIOR_WEIGHT / PRIOR_DEVIATION
    return np.concatenate([_damped(errors), weight * logarithms])


def _error(
    robot: Robot,
    parameters: Parameters,
    data: Sequence[CalibrationSegments],
    threads: int,
    stats: SimulationStats,
) -> float:
    return float(np.sqrt(np.mean(_errors(robot, [parameters], data, threads, stats) ** 2)))


def _with_estimated_states(
    robot: Robot, fitted_parameters: Parameters, data: Sequence[CalibrationSegments], threads: int
) -> list[CalibrationSegments]:
    """Returns independent segments; an unknown state begins as predicted."""
    predict_with = _predictor(robot, [fitted_parameters], threads, SimulationStats())

    def independent(own: CalibrationSegments) -> CalibrationSegments:
        segments = own.segments
        if segments.independent:
            return own
        predicted = predict_with(replace(segments, record=(*BASE, *JOINTS)))
        states = dict(segments.states)
        for signal in predicted.signals:
            begin = predicted[signal][0, :, 0]
            known = states.get(signal, np.full_like(begin, np.nan))
            states[signal] = np.where(np.isnan(known), begin, known)
        return replace(own, segments=replace(segments, states=states))

    return [independent(own) for own in data]


def _errors(
    robot: Robot,
    models: Sequence[Parameters],
    data: Sequence[CalibrationSegments],
    threads: int,
    stats: SimulationStats,
) -> FloatArray:
    """Returns prediction errors divided by their scales, ``(errors, models)``, all finite.

    The models are predicted in batches, so that their memory is bounded.
    """
    needed = max(hypothesis_bytes(robot, own.segments, steps=0) for own in data)
    size = max(1, DEFAULT_BUDGET.models_bytes // needed)
    batches = [models[first : first + size] for first in range(0, len(models), size)]
    return np.concatenate(
        [_batch_errors(robot, batch, data, threads, stats) for batch in batches], axis=1
    )


def _batch_errors(
    robot: Robot,
    models: Sequence[Parameters],
    data: Sequence[CalibrationSegments],
    threads: int,
    stats: SimulationStats,
) -> FloatArray:
    predict_with = _predictor(robot, models, threads, stats)
    rows = []
    for own in data:
        predicted = predict_with(own.segments)
        for signal, scale in CALIBRATION_ERROR_SCALES.items():
            if signal in own.observed:
                with np.errstate(over="ignore", invalid="ignore"):  # bounded below
                    error = difference(signal, predicted[signal][:, :, 1:], own.observed[signal])
                    rows.append((error / scale)[:, own.compared(signal)])
    errors = np.nan_to_num(np.concatenate(rows, axis=1).T, nan=MAX_ERROR)
    return np.clip(errors, -MAX_ERROR, MAX_ERROR)


def _predictor(
    robot: Robot, models: Sequence[Parameters], threads: int, stats: SimulationStats
) -> Callable[[Segments], Behaviour]:
    """Returns a function that predicts segments with models of equal delay.

    The signals of its result are ``(models, segments, horizon + 1, width)``.
    """
    delay = models[0].delay
    embodiments = [
        apply_faults(model_with_parameters(robot, parameters), robot.anatomy, INTACT)
        for parameters in models
    ]

    def predict_with(segments: Segments) -> Behaviour:
        outcome = predict(robot, embodiments, segments, threads=threads, stats=stats, delay=delay)
        return outcome.behaviour

    return predict_with


def _damped(errors: FloatArray) -> FloatArray:
    """Returns pseudo-Huber residuals: their squares grow linearly with errors above 1."""
    return np.asarray(np.sign(errors) * np.sqrt(2 * (np.sqrt(1 + errors**2) - 1)))
