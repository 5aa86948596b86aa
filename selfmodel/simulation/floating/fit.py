"""Least-squares fit of the parameters of a robot with a floating base, and its test.

The sets of parameters are nested: none, the control delay, the stiffness and damping of contacts,
all factors. A set is chosen only if it predicts segments that were left out of its fit
significantly better than the set chosen before.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import product

import mujoco.minimize
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.robot.control_delay import MAX_CONTROL_DELAY
from selfmodel.robot.parameters import Parameters, from_factors, nominal
from selfmodel.simulation.floating.predictions import Predictions
from selfmodel.simulation.floating.uncertainty import consistent_information
from selfmodel.simulation.losses import damped, is_better, root_mean_square
from selfmodel.simulation.outcome import SimulationStats

NOMINAL, DELAY, CONTACTS, FACTORS = "nominal", "delay", "contacts", "factors"
"""Names of the nested sets of parameters."""

PRIOR_DEVIATION = 0.15
"""Standard deviation of the prior on the logarithm of the factor of a mass or a motor."""

GUESSED_PRIOR_DEVIATION = 0.3
"""Standard deviation of the prior on the logarithm of the factor of friction and of damping: models
often contain guesses of them."""

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

CANDIDATE_STIFFNESSES = (0.25, 0.5, 1.0, 2.0, 4.0)
CANDIDATE_DAMPINGS = (0.125, 0.25, 0.5, 1.0, 2.0)
"""Factors of the stiffness and the damping of contacts in the exhaustive search. Slopes are
dominated by noise, because both change the times of contacts."""

MAX_ITERATIONS = 3
"""Largest number of iterations of the least-squares solver."""

FOLDS = 4
"""Consecutive parts of each trial that are left out in turn."""

MIN_Z = 1.645
"""Standard errors by which a larger set must predict segments better that it was not fitted to: a
one-sided level of 5 %."""

CONTACTS_MIN_Z = 3.0
"""As ``MIN_Z``, for the contacts: the best of 25 candidates gains by chance, too.
Times the square root of the overlap: segments of a short trial share steps."""

INDEPENDENT_ERRORS = 100
"""Independent errors of one unit that all errors together count as in the posterior deviations:
fewer than in the fit, because no model has a factor for each limb and contact. With 100, the
intervals of the robots with seeds 0 to 63 of ``benchmarks.calibration.robots`` contained the truth
at about their rates; with 400, those of determined factors contained it too rarely."""


@dataclass(frozen=True, eq=False)
class Fit:
    """The chosen set of parameters.

    Attributes:
        name: Name of the set.
        parameters: The parameters.
        deviations: Posterior standard deviation of each factor's logarithm, ``(factors,)``; that of
            the prior for a factor that was not fitted.
        errors: Errors of its predictions, ``(errors,)``.
        held_out_loss_before: Mean loss of the nominal model over all segments.
        held_out_loss: Mean loss over all segments, each left out of the fit.
    """

    name: str
    parameters: Parameters
    deviations: FloatArray
    errors: FloatArray
    held_out_loss_before: float
    held_out_loss: float


def prior_deviations(factors: int) -> FloatArray:
    """Returns the standard deviation of the prior of each factor's logarithm, ``(factors,)``."""
    deviations = np.full(factors, PRIOR_DEVIATION)
    deviations[2:4] = GUESSED_PRIOR_DEVIATION  # friction and damping
    return deviations


def simulated_models(factors: int) -> int:
    """Returns the number of models that a fit simulates at most.

    The check of a suspicious log is not included: see ``log_check``.

    Args:
        factors: Number of factors.
    """
    slopes = 2 * factors
    contacts = len(CANDIDATE_STIFFNESSES) * len(CANDIDATE_DAMPINGS)
    searched = len(CANDIDATE_DELAYS) + contacts
    # Errors before and after, each candidate, then slopes and a new point per iteration.
    return 3 + searched + MAX_ITERATIONS * (slopes + 1) + slopes + FOLDS


def chosen_fit(predictions: Predictions, before: FloatArray, stats: SimulationStats) -> Fit:
    """Fits the nested sets of parameters, and returns the best one.

    Args:
        predictions: Predictions of the healthy trials.
        before: Errors of the nominal model, ``(errors,)``.
        stats: Statistics that are updated by the prediction of the fit.
    """
    robot = predictions.robot
    start = nominal(robot)
    size = len(start.factors)
    folds = predictions.folds(FOLDS)
    losses = predictions.losses(before)
    unfitted = prior_deviations(size)
    chosen = Fit(NOMINAL, start, unfitted, before, float(losses.mean()), float(losses.mean()))

    delays = {
        replace(start, delay=steps): before
        if steps == start.delay
        else predictions.errors([replace(start, delay=steps)])[:, 0]
        for steps in CANDIDATE_DELAYS
    }
    found, held_out = _best(predictions, delays, folds)
    best = found
    if is_better(held_out, losses, MIN_Z):
        losses = held_out
        chosen = _with(chosen, DELAY, found, delays[found], held_out)

    contacts = _contacts(predictions, found, delays[found])
    found, held_out = _best(predictions, contacts, folds)
    if is_better(held_out, losses, CONTACTS_MIN_Z * np.sqrt(predictions.overlap)):
        losses, best = held_out, found
        chosen = _with(chosen, CONTACTS, found, contacts[found], held_out)

    x = _solved(predictions, size, best)
    parameters = _scaled(best, x)
    errors = predictions.errors([parameters], stats)[:, 0]
    if root_mean_square(damped(errors)) >= root_mean_square(damped(chosen.errors)):
        return chosen
    # Independent segments: long simulations are chaotic, so their derivatives are meaningless.
    slopes = _Slopes.of(predictions.with_estimated_states(parameters), x, errors, best)
    points = [slopes.without(folds[predictions.segment_of_error] == own) for own in range(FOLDS)]
    every = predictions.errors([_scaled(best, point) for point in points])
    held_out = np.stack([predictions.losses(column) for column in every.T])[
        folds, np.arange(len(folds))
    ]
    if not is_better(held_out, losses, MIN_Z):
        return chosen
    fitted = _with(chosen, FACTORS, parameters, errors, held_out)
    return replace(fitted, deviations=slopes.deviations())


def _with(
    fit: Fit, name: str, parameters: Parameters, errors: FloatArray, held_out: FloatArray
) -> Fit:
    loss = float(held_out.mean())
    return replace(fit, name=name, parameters=parameters, errors=errors, held_out_loss=loss)


def _contacts(
    predictions: Predictions, start: Parameters, errors: FloatArray
) -> dict[Parameters, FloatArray]:
    """Returns the errors with each candidate of stiffness and damping, given those of the start."""
    candidates = [
        replace(start, contact_stiffness=stiffness, contact_damping=damping)
        for stiffness, damping in product(CANDIDATE_STIFFNESSES, CANDIDATE_DAMPINGS)
    ]
    new = [candidate for candidate in candidates if candidate != start]
    return {start: errors, **dict(zip(new, predictions.errors(new).T, strict=True))}


def _best(
    predictions: Predictions, candidates: Mapping[Parameters, FloatArray], folds: IndexArray
) -> tuple[Parameters, FloatArray]:
    """Returns the best candidate, and the losses of segments by the best one without their part."""
    losses = {own: predictions.losses(errors) for own, errors in candidates.items()}
    best = min(candidates, key=lambda own: float(np.sum(damped(candidates[own]) ** 2)))
    held_out = np.empty(len(folds))
    for part in range(FOLDS):
        out = folds == part
        without = min(losses, key=lambda own: float(losses[own][~out].sum()))
        held_out[out] = losses[without][out]
    return best, held_out


def _scaled(start: Parameters, logarithms: FloatArray) -> Parameters:
    """Returns parameters with other factors, and the delay and the contacts of the start."""
    return replace(
        from_factors(np.exp(logarithms), start.delay),
        contact_stiffness=start.contact_stiffness,
        contact_damping=start.contact_damping,
    )


Residual = Callable[[FloatArray], FloatArray]
"""Function from logarithms of factors, ``(factors, m)``, to residuals, ``(residuals, m)``."""


def _solved(predictions: Predictions, size: int, start: Parameters) -> FloatArray:
    """Returns the logarithms of the fitted factors, ``(factors,)``."""
    zero = np.zeros((size, 1))
    residual = _residual(predictions, start)
    fitted, _ = mujoco.minimize.least_squares(
        zero,
        residual,
        bounds=[np.full_like(zero, -MAX_LOG_FACTOR), np.full_like(zero, MAX_LOG_FACTOR)],
        jacobian=lambda x, _residual: _central(residual, x),
        max_iter=MAX_ITERATIONS,
        xtol=1e-3,
        verbose=mujoco.minimize.Verbosity.SILENT,
    )
    return np.asarray(fitted.ravel())


def _residual(predictions: Predictions, start: Parameters) -> Residual:
    """Returns the residuals of the data, then those of the prior."""

    def residual(logarithms: FloatArray) -> FloatArray:
        logarithms = np.reshape(logarithms, (len(logarithms), -1))
        models = [_scaled(start, row) for row in logarithms.T]
        errors = predictions.errors(models)
        weight = np.sqrt(len(errors)) * PRIOR_WEIGHT / prior_deviations(len(logarithms))
        return np.concatenate([damped(errors), weight[:, np.newaxis] * logarithms])

    return residual


def _central(residual: Residual, x: FloatArray) -> FloatArray:
    """Returns the Jacobian of the residuals by central differences, ``(residuals, factors)``."""
    steps = DIFFERENCE_STEP * np.eye(len(x))
    return np.asarray((residual(x + steps) - residual(x - steps)) / (2 * DIFFERENCE_STEP))


@dataclass(frozen=True, eq=False)
class _Slopes:
    """The residuals of the data around a fit, without those of the prior.

    Attributes:
        x: Logarithms of the fitted factors, ``(factors,)``.
        residuals: Residuals of the fit, ``(residuals,)``.
        ahead: Forward differences of the residuals, ``(residuals, factors)``.
        behind: Backward differences.
    """

    x: FloatArray
    residuals: FloatArray
    ahead: FloatArray
    behind: FloatArray

    @classmethod
    def of(
        cls, predictions: Predictions, x: FloatArray, errors: FloatArray, start: Parameters
    ) -> "_Slopes":
        steps = DIFFERENCE_STEP * np.eye(len(x))
        points = np.concatenate([x + steps, x - steps])
        models = [_scaled(start, point) for point in points]
        residuals = damped(errors)
        moved = damped(predictions.errors(models)) - residuals[:, np.newaxis]
        ahead, behind = np.split(moved / DIFFERENCE_STEP, 2, axis=1)
        return cls(x, residuals, ahead, -behind)

    def without(self, left_out: BoolArray) -> FloatArray:
        """Returns the logarithms of the fit without some residuals, by one Gauss-Newton step.

        The step of the whole fit, which the solver left, is subtracted.

        Args:
            left_out: Mask of the residuals, ``(residuals,)``.
        """
        step = self._step(~left_out) - self._step(np.ones_like(left_out))
        return np.asarray(np.clip(self.x + step, -MAX_LOG_FACTOR, MAX_LOG_FACTOR))

    def _step(self, used: BoolArray) -> FloatArray:
        slopes, residuals = (self.ahead + self.behind)[used] / 2, self.residuals[used]
        weight = 1 / (max(len(residuals), 1) * PRIOR_WEIGHT**2)
        prior = prior_deviations(len(self.x)) ** -2
        gradient = slopes.T @ residuals * weight + prior * self.x
        return np.asarray(-np.linalg.solve(slopes.T @ slopes * weight + np.diag(prior), gradient))

    def deviations(self) -> FloatArray:
        """Returns the posterior standard deviation of each logarithm, ``(factors,)``."""
        weight = INDEPENDENT_ERRORS / len(self.residuals)
        information = consistent_information(self.ahead, self.behind) * weight
        prior = np.diag(prior_deviations(len(self.x)) ** -2)
        return np.asarray(np.sqrt(np.diag(np.linalg.inv(prior + information))))
