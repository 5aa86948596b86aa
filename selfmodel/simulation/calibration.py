"""Calibration of the self-model: fits its continuous parameters to trials of the healthy robot.

The fit is a box-constrained nonlinear least squares over short predictions from logged states
(``mujoco.minimize``), with a Gaussian prior for parameters that the trials do not determine. The
control delay, an integer, and the stiffness and damping of contacts are found by exhaustive search.
Each is kept only if it predicts segments that were left out of the fit significantly better; see
``floating.fit``.

The joints of a robot with a fixed base are fitted one by one; see ``joints.calibration``.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from selfmodel.arrays import FloatArray, data_frame
from selfmodel.errors import InputError
from selfmodel.robot.parameters import Parameters, factor_names, nominal, with_parameters
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import trial_with_known_base
from selfmodel.simulation.calibration_segments import calibration_segments_of
from selfmodel.simulation.floating.fit import (
    FACTORS,
    NOMINAL,
    Fit,
    chosen_fit,
    prior_deviations,
    simulated_models,
)
from selfmodel.simulation.floating.log_check import Suspicion, suspicion
from selfmodel.simulation.floating.predictions import Predictions
from selfmodel.simulation.floating.uncertainty import determined
from selfmodel.simulation.joints.calibration import (
    JointCalibration,
    calibrated_joints,
    nominal_error,
    simulated_joint_steps,
)
from selfmodel.simulation.joints.segments import JointSegments, joint_segments_of
from selfmodel.simulation.losses import root_mean_square
from selfmodel.simulation.outcome import SimulationStats
from selfmodel.trials.trial import Trial

EXACT_ERROR = 0.01
"""Root mean square error, in ``CALIBRATION_ERROR_SCALES``, below which the model counts as
exact."""

UNDETERMINED = "not determined by these trials"
"""Mark of a factor whose deviation is not clearly below that of its prior."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """Result of a calibration.

    Attributes:
        robot: The robot with the fitted parameters in its MJCF.
        parameters: The fitted parameters.
        deviations: Posterior standard deviation of each factor's logarithm, ``(factors,)`` in the
            order of ``Parameters.factors``; that of the prior for a factor that was not fitted or
            is without influence on the trials.
        error_before: Root mean square error of the predictions with the nominal parameters, in
            units of ``CALIBRATION_ERROR_SCALES``.
        error: Root mean square error with the fitted parameters, in the same units.
        joints: Fit of the joints of a robot with a fixed base; None for other robots.
        chosen: The chosen set of parameters: ``nominal`` (none), ``delay``, ``contacts`` or
            ``factors``; of a robot with a fixed base, the name of its set.
        determined: Whether the trials determine each factor; empty if none was fitted.
        held_out_gain: Relative reduction of the loss in segments that were left out of the fit.
        suspicion: Probable error in the recording of the trials; None without one.
    """

    robot: Robot
    parameters: Parameters
    deviations: FloatArray
    error_before: float
    error: float
    joints: JointCalibration | None = None
    chosen: str = FACTORS
    determined: tuple[bool, ...] = ()
    held_out_gain: float = 0.0
    suspicion: Suspicion | None = None

    def __repr__(self) -> str:
        lines = [
            f"<Calibration of {self.robot.name}: control delay {self.parameters.delay}",
            f"  error {self.error_before:.3g} before, {self.error:.3g} after",
        ]
        lines += [f"  {line}" for line in self.contacts]
        lines += [
            f"  {row['factor']:6.3f} (log deviation {row['deviation']:.3f})  {row['name']}"
            + ("" if row["determined"] else f", {UNDETERMINED}")
            for row in self.rows()
        ]
        if self.suspicion is not None:
            lines.append(f"  {self.suspicion}")
        return "\n".join(lines) + ">"

    def to_dict(self) -> dict[str, Any]:
        """Returns the JSON values: factors, control delay, deviations and errors."""
        return ({} if self.joints is None else {"joints": self.joints.to_dict()}) | {
            **asdict(self.parameters),
            "deviations": [float(deviation) for deviation in self.deviations],
            "error_before": self.error_before,
            "error": self.error,
            "set": self.chosen,
            "determined": [row["determined"] for row in self.rows()],
            "held_out_gain": self.held_out_gain,
            "suspicion": None if self.suspicion is None else self.suspicion.to_dict(),
        }

    def to_pandas(self) -> Any:  # noqa: ANN401  # pandas is optional
        """Returns the factors as a ``pandas.DataFrame``: name, factor, deviation, determined.

        Raises:
            InputError: pandas is not installed.
        """
        return data_frame(self.rows())

    @property
    def contacts(self) -> tuple[str, ...]:
        """A line on the contacts, if the fit changed them."""
        if not self.parameters.has_other_contacts:
            return ()
        stiffness, damping = self.parameters.contact_stiffness, self.parameters.contact_damping
        return (f"contacts: stiffness x {stiffness:g}, damping x {damping:g}",)

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Names of the fitted factors that the trials do not determine; none without a fit."""
        if not self.determined:
            return ()
        return tuple(row["name"] for row in self.rows() if not row["determined"])

    def rows(self) -> list[dict[str, Any]]:
        """Returns name, factor, deviation and whether the trials determine it, of each factor."""
        names, factors = factor_names(self.robot), self.parameters.factors
        known = self.determined or (False,) * len(names)
        return [
            {
                "name": name,
                "factor": float(factor),
                "deviation": float(deviation),
                "determined": own,
            }
            for name, factor, deviation, own in zip(
                names, factors, self.deviations, known, strict=True
            )
        ]


def calibrate(robot: Robot, trials: Sequence[Trial], threads: int) -> Calibration:
    """Fits the continuous parameters of a robot to trials of the healthy robot.

    The result does not depend on the number of threads, of MuJoCo or of the linear algebra, which
    rounds sums over many errors differently with several threads. The factors, and the delay, are
    kept only if they predict segments that were left out of the fit significantly better. A model
    that neither improves, or that predicts the trials exactly, is returned unchanged, to the bit.

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
    with threadpool_limits(1, "blas"):
        if robot.has_fixed_base:
            return _with_fitted_joints(robot, trials, threads)
        return _with_fitted_parameters(robot, trials, threads)


def simulated_steps(robot: Robot, trials: Sequence[Trial]) -> int:
    """Returns the number of control steps that ``calibrate`` simulates at most, but for retries.

    A suspicious log takes up to as many again, to find its probable error. A model that predicts
    the trials exactly takes one prediction of each.

    Args:
        robot: The robot as its model describes it.
        trials: The trials, as for ``calibrate``.

    Raises:
        InputError: Too little of a trial was observed.
    """
    if robot.has_fixed_base:
        return simulated_joint_steps(robot, _joint_segments(robot, trials))
    cut = [calibration_segments_of(trial).segments for trial in trials]
    steps = sum(len(segments.commands) * segments.horizon for segments in cut)
    return simulated_models(len(factor_names(robot))) * steps


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
    predictions = _predictions(robot, trials, threads)
    return root_mean_square(predictions.errors([nominal(robot)]))


def _predictions(robot: Robot, trials: Sequence[Trial], threads: int) -> Predictions:
    known = [trial_with_known_base(robot, trial) for trial in trials]
    return Predictions(robot, [calibration_segments_of(trial) for trial in known], threads)


def _with_fitted_parameters(robot: Robot, trials: Sequence[Trial], threads: int) -> Calibration:
    predictions = _predictions(robot, trials, threads)
    stats = SimulationStats()
    before = predictions.errors([nominal(robot)], stats)[:, 0]
    error_before = root_mean_square(before)
    if error_before < EXACT_ERROR:
        deviations = prior_deviations(len(factor_names(robot)))
        return Calibration(
            robot, nominal(robot), deviations, error_before, error_before, chosen=NOMINAL
        )
    fit = chosen_fit(predictions, before, stats)
    if stats.diverged == stats.runs:
        raise InputError(
            f"{', '.join(trial.path for trial in trials)}: no simulation of the healthy robot "
            f"remained finite, before and after the fit: check the model and the units of the log"
        )
    return Calibration(
        robot=robot if fit.name == NOMINAL else with_parameters(robot, fit.parameters),
        parameters=fit.parameters,
        deviations=fit.deviations,
        error_before=error_before,
        error=root_mean_square(fit.errors),
        chosen=fit.name,
        determined=_determined(fit),
        held_out_gain=1 - fit.held_out_loss / fit.held_out_loss_before,
        suspicion=suspicion(predictions, fit.parameters, fit.errors),
    )


def _determined(fit: Fit) -> tuple[bool, ...]:
    if fit.name != FACTORS:
        return ()
    return determined(fit.deviations, prior_deviations(len(fit.deviations)))


def _with_fitted_joints(robot: Robot, trials: Sequence[Trial], threads: int) -> Calibration:
    fit = calibrated_joints(robot, _joint_segments(robot, trials), threads)
    gains = tuple(map(float, fit.parameters.values["gain"]))
    known = [row["determined"] for row in fit.rows() if row["quantity"] == "gain"]
    return Calibration(
        robot=fit.robot,
        parameters=replace(nominal(robot), motor_gains=gains, delay=fit.best.delay),
        deviations=np.append(prior_deviations(4), fit.best.deviations["gain"]),
        error_before=fit.nominal.error,
        error=fit.best.error,
        joints=fit,
        chosen=fit.best.name,
        determined=(False,) * 4 + tuple(known),
    )


def _joint_segments(robot: Robot, trials: Sequence[Trial]) -> list[JointSegments]:
    return [joint_segments_of(trial_with_known_base(robot, trial)) for trial in trials]
