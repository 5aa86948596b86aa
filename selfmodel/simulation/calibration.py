"""Calibration of the self-model: fits its continuous parameters to trials of the healthy robot.

``Refit`` fits them again, to these and to trials with known faults. See ``fit`` for the sets of
parameters, their fit and its test.
"""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from selfmodel.arrays import FloatArray, data_frame
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.progress import Observer, Progress, ignore
from selfmodel.robot.robot import Robot
from selfmodel.simulation import model_factors
from selfmodel.simulation.fit import (
    EXACT_ERROR,
    Fit,
    expected_models,
    expected_refit_models,
    is_determined,
    nested_fits,
    refitted,
)
from selfmodel.simulation.log_check import Suspicion, suspicion
from selfmodel.simulation.model_factors import Parameters, nominal
from selfmodel.simulation.requests import MAX_CHAIN
from selfmodel.simulation.segments import (
    MAX_FOLLOWING,
    ObservedSegments,
    SegmentErrors,
    observed_segments,
    root_mean_square,
)
from selfmodel.trials.trial import Trial

Known = dict[Hashable, ObservedSegments]
"""Segments of trials with the errors of their predictions, by the trial, time and faults."""

STAGE = "calibration"
"""Name of the calibration in its progress."""

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
        joints: JSON values of the fit of a robot with a fixed base: its set, delay and errors, the
            hinge with the largest error (rad), and ``parameters``: of the gain and any fitted force
            limit of each motor (factors) and the damping, dry friction and armature of each hinge
            (N m s/rad, N m, kg m^2), the value in the model, the fitted value, the standard
            deviation of its logarithm, and whether the trials determine it. None for other robots.
        chosen: The chosen set of parameters: ``nominal`` (none), ``delay``, ``contacts`` or
            ``factors``; of a robot with a fixed base, ``nominal``, ``delay``, ``shared``, ``kinds``
            or ``joints``.
        determined: Whether the trials determine each factor; empty if none was fitted.
        held_out_gain: Relative reduction of the loss in segments that were left out of the fit.
        suspicion: Probable error in the recording of the trials; None without one.
    """

    robot: Robot
    parameters: Parameters
    deviations: FloatArray
    error_before: float
    error: float
    joints: dict[str, Any] | None = None
    chosen: str = model_factors.FACTORS
    determined: tuple[bool, ...] = ()
    held_out_gain: float = 0.0
    suspicion: Suspicion | None = None

    def __repr__(self) -> str:
        factors = [
            f"{row['factor']:6.3f} (log deviation {row['deviation']:.3f})  {row['name']}"
            + ("" if row["determined"] else f", {UNDETERMINED}")
            for row in self.rows()
        ]
        lines = (
            f"<Calibration of {self.robot.name}: control delay {self.parameters.delay}",
            f"error {self.error_before:.3g} before, {self.error:.3g} after",
            *(*self.contacts, *factors, *([self.suspicion] if self.suspicion else ())),
        )
        return "\n  ".join(map(str, lines)) + ">"

    def to_dict(self) -> dict[str, Any]:
        """Returns the JSON values: factors, control delay, deviations and errors."""
        joints = (model_factors.FORCE_LIMITS, *model_factors.JOINT_FIELDS)
        parts = (*joints, "body_mass", "body_inertia")
        factors = {key: own for key, own in asdict(self.parameters).items() if key not in parts}
        return {
            **({} if self.joints is None else {"joints": self.joints}),
            **factors,
            "deviations": self.deviations.tolist(),
            "error_before": self.error_before,
            "error": self.error,
            "set": self.chosen,
            "determined": [row["determined"] for row in self.rows()],
            "held_out_gain": self.held_out_gain,
            "suspicion": None if self.suspicion is None else self.suspicion.to_dict(),
        }

    def to_pandas(self) -> Any:  # noqa: ANN401  # pandas has no types
        """Returns the factors as a ``pandas.DataFrame``: name, factor, deviation, determined."""
        return data_frame(self.rows())

    def plot(self) -> Any:  # noqa: ANN401  # matplotlib is slow to import
        """Returns the factors with intervals of two deviations as a ``matplotlib`` figure."""
        from selfmodel.style import values_by_name  # noqa: PLC0415  # matplotlib is slow to import

        rows, title = self.rows(), f"calibration of {self.robot.name}"
        factors, spread = self.parameters.factors, np.exp(2 * self.deviations)
        ends = list(zip(factors / spread, factors * spread, strict=True))
        names = [row["name"] if row["determined"] else f"({row['name']})" for row in rows]
        label = "factor (in brackets: not determined)"
        return values_by_name(title, label, names, list(factors), ends=ends, reference=1.0)

    @property
    def contacts(self) -> tuple[str, ...]:
        """A line on the contacts, if the fit changed them."""
        stiffness, damping = self.parameters.contacts
        if (stiffness, damping) == (1.0, 1.0):
            return ()
        return (f"contacts: stiffness x {stiffness:g}, damping x {damping:g}",)

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Names of the fitted factors that the trials do not determine; none without a fit."""
        rows = self.rows() if self.determined else []
        return tuple(row["name"] for row in rows if not row["determined"])

    def rows(self) -> list[dict[str, Any]]:
        """Returns name, factor, deviation and whether the trials determine it, of each factor."""
        names = model_factors.factor_names(self.robot)
        columns = (
            *(names, self.parameters.factors.tolist(), self.deviations.tolist()),
            self.determined or (False,) * len(names),
        )
        keys = ("name", "factor", "deviation", "determined")
        return [dict(zip(keys, row, strict=True)) for row in zip(*columns, strict=True)]


def calibrate(
    robot: Robot,
    trials: Sequence[Trial],
    threads: int,
    observer: Observer = ignore,
) -> Calibration:
    """Fits the continuous parameters of a robot to trials of the healthy robot.

    The result does not depend on the number of threads. A set of parameters is kept only if it
    predicts segments that were left out of the fit significantly better. A model that none
    improves, or that predicts the trials exactly, is returned unchanged, to the bit.

    If the base's position and linear velocity were rarely observed together in a trial, the trial
    is assumed to begin in the model's initial pose, and the state of the base is predicted from
    there on. After a late step, an unknown command, or an unknown state at the beginning of a
    segment (every tenth step), the rest of such a trial is not used.

    With a fixed base, gain, damping, dry friction and armature are fitted to joint positions, and
    force limits that the trials reach.

    The ``observer`` is called with the progress of the fit.

    Raises:
        InputError: There are no trials, too little of a trial was observed, or every simulation
            diverged.
    """
    if not trials:
        raise InputError("expected at least one trial of the healthy robot, got none")
    with threadpool_limits(1, "blas"):  # several round sums differently
        most = expected_models(robot)
        segments = _segment_errors(
            robot,
            [(trial, INTACT) for trial in trials],
            threads,
            {},
            lambda done: observer(Progress(STAGE, min(done, most), most)),
        )
        first, *others = nested_fits(segments)
        best, prior = others[-1] if others else first, first.deviations
        is_exact = root_mean_square(first.errors) < EXACT_ERROR
        if 0 < segments.stats.runs == segments.stats.diverged:
            raise InputError(
                f"{', '.join(trial.path for trial in trials)}: no simulation of the healthy robot "
                f"remained finite, before and after the fit: check the model and the units of the "
                f"log"
            )
        deviations, prior_of_factors = (
            np.concatenate([own[quantity] for quantity in (*model_factors.SHARED, "motor_gains")])
            for own in (best.deviations, prior)
        )
        observer(Progress(STAGE, most, most))
        loss, loss_before = (segments.losses(own.held_out).mean() for own in (best, first))
        is_fixed, parameters = robot.has_fixed_base, best.parameters
        return Calibration(
            robot=robot if best is first else model_factors.with_parameters(robot, parameters),
            parameters=parameters,
            deviations=deviations,
            error_before=float(root_mean_square(first.errors)),
            error=float(root_mean_square(best.errors)),
            joints=_joints(segments, first, best) if is_fixed else None,
            chosen=best.name,
            determined=tuple(is_determined(deviations, prior_of_factors).tolist())
            if best.is_fitted
            else (),
            held_out_gain=0.0 if is_exact else float(1 - loss / loss_before),
            suspicion=None if is_exact or is_fixed else suspicion(segments, best),
        )


@dataclass(frozen=True, eq=False)
class Refit:
    """Fits a self-model again, to trials of the healthy robot and others in which it has faults.

    It starts from a calibration, and is taken as it is, without a held-out test: see
    ``fit.refitted``.

    Attributes:
        robot: The nominal robot, as before the calibration.
        calibration: Its fit to the healthy trials.
        threads: Threads of the simulations.
        observer: Called with the progress of each fit.
    """

    robot: Robot
    calibration: Calibration
    threads: int
    observer: Observer = ignore
    _known: Known = field(default_factory=dict, init=False)

    def __call__(self, trials: Sequence[Trial], hypotheses: Sequence[Hypothesis]) -> Robot:
        """Returns the fitted robot, given its faults in each trial.

        Raises:
            InputError: Too little of a trial was observed.
        """
        given, most = list(zip(trials, hypotheses, strict=True)), expected_refit_models(self.robot)

        def on_models(done: int) -> None:
            self.observer(Progress(STAGE, min(done, most), most))

        with threadpool_limits(1, "blas"):  # as in ``calibrate``
            segments = _segment_errors(self.robot, given, self.threads, self._known, on_models)
            found = refitted(segments, self.calibration.parameters)
        on_models(most)
        return model_factors.with_parameters(self.robot, found)


def prediction_error(robot: Robot, trials: Sequence[Trial], threads: int) -> float:
    """Returns the prediction error of a self-model on trials, as for ``calibrate``.

    It is the root mean square error over all columns after all valid steps, in units of
    ``CALIBRATION_ERROR_SCALES``.

    Raises:
        InputError: Too little of a trial was observed.
    """
    errors = _segment_errors(robot, [(one, INTACT) for one in trials], threads, {}).of(
        [nominal(robot)]
    )[:, 0]
    return float(root_mean_square(errors))


def sensitivity(robot: Robot, trial: Trial, hypothesis: Hypothesis, threads: int) -> float:
    """Returns the mean loss of a trial's predictions, with faults, from states with small errors.

    See ``SegmentErrors.sensitivity``; the errors are the same in each call.

    Raises:
        InputError: Too little of the trial was observed.
    """
    segments = _segment_errors(robot, [(trial, hypothesis)], threads, {})
    return segments.sensitivity(nominal(robot), np.random.default_rng(0))


def _segment_errors(
    robot: Robot,
    trials: Sequence[tuple[Trial, Hypothesis]],
    threads: int,
    known: Known,
    on_models: Callable[[int], None] = lambda _: None,
) -> SegmentErrors:
    # Long trials share the time that is simulated of one.
    lengths = [float(np.ptp(trial.trajectory.time)) for trial, _ in trials]
    share = MAX_FOLLOWING / max(sum(length > MAX_CHAIN for length in lengths), 1)
    data = []
    for (trial, hypothesis), length in zip(trials, lengths, strict=True):
        following = share if length > MAX_CHAIN else MAX_FOLLOWING
        key = (trial.content, following, hypothesis)
        if key not in known:
            segments = observed_segments(robot, trial, following)
            known[key] = replace(segments, hypothesis=hypothesis)
        data.append(known[key])
    return SegmentErrors(robot, data, threads, on_models)


def _joints(segments: SegmentErrors, first: Fit, best: Fit) -> dict[str, Any]:
    robot, rows = segments.robot, list[dict[str, Any]]()
    quantities = {
        "gain": "motor_gains",
        "damping": "joint_damping",
        "dry friction": "dry_friction",
        "armature": "armature",
    }
    of_motors = ("motor_gains", model_factors.FORCE_LIMITS)
    if best.parameters.force_limits:
        quantities["force limit"] = model_factors.FORCE_LIMITS
    for name, quantity in quantities.items():
        is_of_motor = quantity in of_motors
        before, values = (
            np.array(getattr(own.parameters, quantity) or (1.0,) * robot.model.nu)
            if is_of_motor
            else model_factors.joint_values(robot, own.parameters, quantity)
            for own in (first, best)
        )
        deviations = best.deviations[quantity]
        known = best.is_fitted & is_determined(deviations, first.deviations[quantity])
        rows += [
            {
                "name": part,
                "quantity": name,
                "before": float(before[k]),
                "value": float(values[k]),
                "deviation": float(deviations[k]),
                "determined": bool(known[k]),
            }
            for k, part in enumerate(robot.anatomy.motors if is_of_motor else robot.anatomy.hinges)
        ]
    sizes = root_mean_square(segments.joint_errors(best.errors))
    worst = int(np.argmax(sizes))
    return {
        "set": best.name,
        "delay": best.parameters.delay,
        "error_before": float(root_mean_square(first.errors)),
        "error": float(root_mean_square(best.errors)),
        "held_out_error_before": float(root_mean_square(first.held_out)),
        "held_out_error": float(root_mean_square(best.held_out)),
        "worst_joint": robot.anatomy.hinges[worst],
        "worst_joint_error": float(sizes[worst]),
        "parameters": rows,
    }
