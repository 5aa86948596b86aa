"""Fit of nested sets of parameters to trials of the healthy robot, and its held-out test.

The sets grow: none; the control delay; the stiffness and damping of contacts; factors. A set is
chosen only if it predicts segments that were left out of its fit significantly better than the set
chosen before. Delay and contacts are found by exhaustive search; factors by a box-constrained
nonlinear least squares (``mujoco.minimize``) with a Gaussian prior for those that the trials do not
determine.

A robot with a floating base has one set of factors. With a fixed base, which determines neither
masses nor the friction of the ground, nor has contacts, there are three: gain, force limit,
damping, dry friction and armature of all joints together, of each kind of joint, and of each joint.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import mujoco.minimize
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.robot.anatomy import MAX_CONTROL_DELAY, as_delay
from selfmodel.simulation.model_factors import Basis, Parameters, bases, prior_deviations
from selfmodel.simulation.segments import SegmentErrors, is_better, pseudo_huber

NOMINAL, DELAY, CONTACTS = "nominal", "delay", "contacts"
"""Names of the nested sets of parameters before those of factors."""

CANDIDATE_STIFFNESSES = (0.25, 0.5, 1.0, 2.0, 4.0)
CANDIDATE_DAMPINGS = (0.125, 0.25, 0.5, 1.0, 2.0)
"""Factors of the stiffness and the damping of contacts in the exhaustive search."""

STEPS = (1.0, 0.3)
"""Shares of a Gauss-Newton step that are tried with each delay."""

FOLDS = 4
"""Consecutive parts of each trial that are left out in turn, where the base is free."""

MIN_Z, SHRUNK_MIN_Z, CONTACTS_MIN_Z = 1.645, 2.24, 3.0
"""Standard errors by which a larger set must predict segments better that it was not fitted to: a
one-sided level of 5 %. A fit that is used in part is the best of four: a quarter of that level. The
best of 25 contacts gains by chance, too; theirs is times the square
root of the overlap, because segments of a short trial share steps."""

INDEPENDENT_ERRORS = 100
"""Independent errors of one unit that all errors together count as in the posterior deviations:
fewer than in the fit, because no model has a factor for each limb and contact. With 100, intervals
contain the truth at about their rates (``benchmarks.calibration``); with 400, too rarely."""

UNDETERMINED_SHARE = 0.7
"""Deviation of a parameter, relative to that of its prior, from which on it is not determined: the
trials halve the variance of a parameter that they determine."""


@dataclass(frozen=True)
class Method:
    """Numbers of a fit, which depend on whether the base makes contacts.

    Attributes:
        prior_weight: Weight of the prior relative to the data. All errors together count as
            1 / prior_weight**2 independent errors, whatever their number: errors of neighbouring
            steps and columns are strongly correlated.
        step: Step of the finite differences of a logarithm.
        is_central: Whether the solver's differences are central, with that step; otherwise they are
            forward, and the step is relative to the deviation of the prior.
        iterations: Largest number of iterations of the least-squares solver.
        delay_iterations: As ``iterations``, for each delay that is tried; 0 to keep the delay.
        regularizers: Smallest and largest regularizer of the solver, and the factor from one to the
            next; each that is tried takes a simulation.
        tolerance: Size of a step, relative to the logarithms, below which the solver ends.
        folds: Consecutive parts of each trial that are left out of the fit in turn.
        weights: Shares of the way from the set before to the fit of which one is chosen.
    """

    prior_weight: float
    step: float
    is_central: bool
    iterations: int
    delay_iterations: int
    regularizers: Mapping[str, float]
    tolerance: float
    folds: int
    weights: tuple[float, ...]


FLOATING = Method(0.05, 0.1, True, 3, 0, {}, 1e-3, FOLDS, (1.0,))
"""Where there are contacts, smaller steps are dominated by noise: a parameter changes the time at
which a foot makes contact."""

FIXED = Method(
    prior_weight=0.03,
    step=0.05,
    is_central=False,
    iterations=5,
    delay_iterations=2,
    regularizers={"mu_min": 1e-3, "mu_max": 1e5, "mu_factor": 10.0},
    tolerance=1e-2,
    folds=8,
    weights=(0.25, 0.5, 0.75, 1.0),
)
"""Long simulations without contacts have errors far below their unit, so their prior weighs less
than that of short predictions."""


@dataclass(frozen=True, eq=False)
class Fit:
    """Fit of one set of parameters to trials.

    Attributes:
        name: Name of the set.
        parameters: The fitted parameters.
        deviations: Posterior standard deviation of the logarithm of each factor, by the name of
            its quantity in ``Parameters``; that of the prior for a factor that was not fitted.
        errors: Errors of its predictions, ``(errors,)``.
        held_out: Errors in segments that were each left out of the fit, ``(errors,)``.
        is_fitted: Whether the set contains factors.
        weight: Share of the way from the set before to the fit.
    """

    name: str
    parameters: Parameters
    deviations: Mapping[str, FloatArray]
    errors: FloatArray
    held_out: FloatArray
    is_fitted: bool = False
    weight: float = 1.0


def is_determined(deviation: FloatArray, prior: FloatArray) -> BoolArray:
    """Returns whether trials determine parameters, given both standard deviations."""
    return np.asarray(deviation < UNDETERMINED_SHARE * prior)


def nested_fits(segments: SegmentErrors, first: Fit) -> list[Fit]:
    """Returns the nominal set, then each nested set that was chosen; the last is the best."""
    robot, best, chosen = segments.robot, first.parameters, [first]

    def choose(fit: Fit, min_z: float) -> bool:
        losses, others = (segments.losses(own.held_out) for own in (fit, chosen[-1]))
        better = is_better(losses, others, min_z)
        chosen.extend([fit] * better)
        return better

    if not robot.has_fixed_base:
        delays = [replace(best, delay=steps) for steps in range(MAX_CONTROL_DELAY + 1)]
        fit = _best_candidate(DELAY, segments, delays, first)
        choose(fit, MIN_Z)
        best = fit.parameters
        contacts = [
            replace(best, contact_stiffness=stiffness, contact_damping=damping)
            for stiffness, damping in product(CANDIDATE_STIFFNESSES, CANDIDATE_DAMPINGS)
        ]
        fit = _best_candidate(CONTACTS, segments, contacts, fit)
        if choose(fit, CONTACTS_MIN_Z * np.sqrt(segments.overlap)):
            best = fit.parameters
    for number, (name, basis) in enumerate(bases(robot)):
        fitter = _Fitter(segments, basis, FIXED if robot.has_fixed_base else FLOATING)
        best, x = fitter.fitted(best, is_first=not number)
        errors = segments.of([best])[:, 0]
        if _cost(errors) < _cost(chosen[-1].errors):
            fit = fitter.tested(name, best, x, errors, chosen[-1])
            choose(fit, MIN_Z if fit.weight == 1 else SHRUNK_MIN_Z)
    return chosen


def _cost(errors: FloatArray) -> float:
    return float(np.sum(pseudo_huber(errors) ** 2))


def _best_candidate(
    name: str, segments: SegmentErrors, candidates: list[Parameters], known: Fit
) -> Fit:
    """Returns the best of a fit and other candidates.

    The held-out errors of each part are those of the best candidate without it.
    """
    new = [own for own in candidates if own != known.parameters]
    errors = {known.parameters: known.errors, **dict(zip(new, segments.of(new).T, strict=True))}
    losses = {own: segments.losses(each) for own, each in errors.items()}
    best = min(errors, key=lambda own: _cost(errors[own]))
    folds = segments.folds(FOLDS)
    parts = folds[segments.segment_of_error]
    held_out = np.empty(len(parts))
    for part in range(FOLDS):
        kept = folds != part
        without = min(losses, key=lambda own: float(losses[own][kept].sum()))
        held_out[parts == part] = errors[without][parts == part]
    return Fit(name, best, known.deviations, errors[best], held_out)


@dataclass(frozen=True, eq=False)
class _Fitter:
    """Least-squares fits of one set of factors, given by its coordinates."""

    segments: SegmentErrors
    basis: Basis
    method: Method

    @cached_property
    def _widths(self) -> FloatArray:
        """Steps of the finite differences, ``(coordinates,)``."""
        prior, method = self.basis.prior, self.method
        return np.asarray(method.step * (np.ones_like(prior) if method.is_central else prior))

    def residuals(self, points: Sequence[Parameters], coordinates: FloatArray) -> FloatArray:
        """Returns those of the data, then those of the prior, ``(residuals, points)``.

        The coordinates of the points are ``(points, coordinates)``.
        """
        errors = self.segments.of(points)
        weight = np.sqrt(len(errors)) * self.method.prior_weight / self.basis.prior
        return np.concatenate([pseudo_huber(errors), (weight * coordinates).T])

    def slopes(self, start: Parameters, x: FloatArray, at: FloatArray) -> FloatArray:
        """Returns the derivatives of the residuals, ``(residuals, coordinates)``."""
        basis, width, steps = self.basis, self._widths, np.diag(self._widths)
        moved = np.concatenate([x + steps, x - steps]) if self.method.is_central else x + steps
        ahead = self.residuals([basis.applied(start, row) for row in moved], moved)
        if not self.method.is_central:
            return np.asarray((ahead - at[:, np.newaxis]) / width)
        ahead, behind = np.split(ahead, 2, axis=1)
        return np.asarray((ahead - behind) / (2 * width))

    def solved(self, start: Parameters) -> tuple[Parameters, FloatArray]:
        """Returns the fit of the start's factors, with its delay and contacts; its coordinates."""
        basis = self.basis

        def residual(logarithms: FloatArray) -> FloatArray:
            rows = np.reshape(logarithms, (len(logarithms), -1)).T
            return self.residuals([basis.applied(start, row) for row in rows], rows)

        bounds = basis.bounds[:, np.newaxis]
        fitted, _ = mujoco.minimize.least_squares(
            basis.coordinates(start)[:, np.newaxis],
            residual,
            bounds=[-bounds, bounds],
            jacobian=lambda x, at: self.slopes(start, x.ravel(), at.ravel()),
            max_iter=self.method.iterations,
            xtol=self.method.tolerance,
            verbose=mujoco.minimize.Verbosity.SILENT,
            **self.method.regularizers,
        )
        x = np.asarray(fitted.ravel())
        return basis.applied(start, x), x

    @property
    def delay_parts(self) -> int:
        """Parts of a control step of which a delay is a multiple."""
        robot = self.segments.robot
        return 1 if robot.model.na else robot.substeps

    def fitted(self, start: Parameters, *, is_first: bool) -> tuple[Parameters, FloatArray]:
        """Returns the fit of a set, with the best delay, and its coordinates.

        All delays are tried before the first set is fitted, and those around its delay after each.
        """
        parts = self.delay_parts
        if is_first and self.method.delay_iterations:
            delays = range(0, MAX_CONTROL_DELAY * parts + 1, parts)
            start = _Delays(self, start, delays).best_around(parts // 2)
        best, x = self.solved(start)
        if self.method.delay_iterations:
            moved = _Delays(self, best, [round(best.delay * parts)]).best_around(1)
            if moved.delay != best.delay:
                best, x = self.solved(moved)
        return best, x

    def tested(
        self, name: str, point: Parameters, x: FloatArray, errors: FloatArray, before: Fit
    ) -> Fit:
        """Returns a fit with its held-out errors and its posterior deviations.

        Its residuals are linearised around it, with independent segments: long simulations are
        chaotic, so that their derivatives would be meaningless. The fit without a part differs by
        one Gauss-Newton step, less that of the whole fit, which the solver left. ``x`` are the
        coordinates of the fitted parameters, ``point``.

        The fit is used as far as it helps: it is moved towards that of the set before by the share
        with the lowest held-out loss, by errors that change in proportion.
        """
        segments, basis, width = self.segments, self.basis, self._widths
        independent = segments.with_estimated_states(point)
        residuals = pseudo_huber(errors)

        def slopes_of(widths: FloatArray) -> FloatArray:
            moved = [basis.applied(point, own) for own in x + np.diag(widths)]
            return (pseudo_huber(independent.of(moved)) - residuals[:, np.newaxis]) / widths

        ahead = slopes_of(width)
        behind = slopes_of(-width) if self.method.is_central else ahead

        def step(used: BoolArray) -> FloatArray:
            slopes, left = (ahead + behind)[used] / 2, residuals[used]
            weight = 1 / (max(len(left), 1) * self.method.prior_weight**2)
            prior = basis.prior**-2
            gradient = slopes.T @ left * weight + prior * x
            information = slopes.T @ slopes * weight + np.diag(prior)
            return np.asarray(-np.linalg.solve(information, gradient))

        folds = self.method.folds
        parts = segments.folds(folds)[segments.segment_of_error]
        whole = step(np.ones(len(parts), np.bool_))
        without = np.array([x + (step(parts != part) - whole) for part in range(folds)])
        without = np.clip(without, -basis.bounds, basis.bounds)
        known = basis.coordinates(before.parameters)

        def held_out(weight: float) -> FloatArray:
            points = [basis.applied(point, known + weight * (own - known)) for own in without]
            return np.asarray(segments.of(points)[np.arange(len(parts)), parts])

        left_out, known_errors = held_out(1.0), before.held_out

        def loss(share: float) -> float:
            return _cost(share * left_out + (1 - share) * known_errors)

        weight = min(self.method.weights, key=loss)
        if weight != 1.0:
            point = basis.applied(point, known + weight * (x - known))
            errors, left_out = segments.of([point])[:, 0], held_out(weight)
        fitted = basis.by_quantity(self._deviations(residuals, ahead, behind))
        deviations = prior_deviations(segments.robot) | fitted
        return Fit(name, point, deviations, errors, left_out, is_fitted=True, weight=weight)

    def _deviations(
        self, residuals: FloatArray, ahead: FloatArray, behind: FloatArray
    ) -> FloatArray:
        """Returns the posterior standard deviation of each coordinate.

        Without contacts, the variance of the data is that of the segments' gradients (Huber 1967,
        White 1980), which includes model error and the correlation of neighbouring steps; that of
        the prior is added.
        """
        prior = self.basis.prior
        if not self.segments.robot.has_fixed_base:
            weight = INDEPENDENT_ERRORS / len(residuals)
            information = consistent_information(ahead, behind) * weight
            variance = np.diag(np.linalg.inv(np.diag(prior**-2) + information))
            return np.asarray(np.sqrt(variance))
        slopes, segment = (ahead + behind) / 2, self.segments.segment_of_error
        used = np.unique(segment)
        scores = slopes * residuals[:, np.newaxis]
        gradients = np.array([scores[segment == number].sum(axis=0) for number in used])
        spread = len(used) / max(len(used) - 1, 1) * gradients.T @ gradients
        weight = len(residuals) * self.method.prior_weight**2
        inverse = np.linalg.inv(slopes.T @ slopes + np.diag(weight * prior**-2))
        variance = np.diag(inverse @ (spread + np.diag(weight**2 * prior**-2)) @ inverse)
        return np.asarray(np.minimum(np.sqrt(variance), prior))


class _Delays:
    """Short fits with several control delays, in parts of a control step.

    A wrong gain or damping looks like a wrong delay, so the factors are fitted with each. All
    delays take a step with the slopes at the best one, which they nearly have too.
    """

    def __init__(self, fitter: _Fitter, start: Parameters, delays: Iterable[int]) -> None:
        self._fitter, self._start = fitter, start
        # Cost, coordinates and residuals of the best point with each delay.
        self._tried: dict[int, tuple[float, FloatArray, FloatArray]] = {}
        self._try([(delay, fitter.basis.coordinates(start)) for delay in delays])
        if len(self._tried) > 1:
            for _ in range(fitter.method.delay_iterations):
                self._improve(list(self._tried), self._inverse())

    def best_around(self, step: int) -> Parameters:
        """Returns the best point; its delay moves by ``step`` while that helps, then by less."""
        inverse, last = self._inverse(), MAX_CONTROL_DELAY * self._fitter.delay_parts
        while step:
            centre = self._best
            near = [own for own in (centre - step, centre + step) if 0 <= own <= last]
            near = [own for own in near if own not in self._tried]
            if near:
                self._try([(own, self._tried[centre][1]) for own in near])
                for _ in range(self._fitter.method.delay_iterations):
                    self._improve(near, inverse)
            if self._best == centre:
                step //= 2
        return self._point(self._best, self._tried[self._best][1])

    @property
    def _best(self) -> int:
        return min(self._tried, key=lambda delay: self._tried[delay][0])

    def _point(self, delay: int, x: FloatArray) -> Parameters:
        start = replace(self._start, delay=as_delay(delay, self._fitter.delay_parts))
        return self._fitter.basis.applied(start, x)

    def _try(self, candidates: Sequence[tuple[int, FloatArray]]) -> None:
        points = [self._point(*own) for own in candidates]
        residuals = self._fitter.residuals(points, np.array([x for _, x in candidates])).T
        for (delay, x), residual in zip(candidates, residuals, strict=True):
            cost = float(residual @ residual)
            if delay not in self._tried or cost < self._tried[delay][0]:
                self._tried[delay] = cost, x, residual

    def _inverse(self) -> FloatArray:
        """Returns the pseudo-inverse of the slopes at the best point."""
        _, x, residual = self._tried[self._best]
        slopes = self._fitter.slopes(self._point(self._best, x), x, residual)
        return np.asarray(np.linalg.pinv(slopes))

    def _improve(self, delays: Iterable[int], inverse: FloatArray) -> None:
        bounds, moved = self._fitter.basis.bounds, list[tuple[int, FloatArray]]()
        for delay in delays:
            _, x, residual = self._tried[delay]
            step = inverse @ residual
            moved += [(delay, np.clip(x - share * step, -bounds, bounds)) for share in STEPS]
        self._try(moved)


def consistent_information(ahead: FloatArray, behind: FloatArray) -> FloatArray:
    """Returns the Fisher information on parameters, ``(parameters, parameters)``.

    A small change of a parameter changes the times of contacts, and with them the residuals at
    random. The square of one finite difference includes the square of this noise, which is no
    information: a parameter without influence would appear to be known. The noise of the forward
    and of the backward difference, ``(residuals, parameters)``, is independent, so their product
    does not include it. Negative eigenvalues are set to 0.
    """
    product = ahead.T @ behind
    values, vectors = np.linalg.eigh((product + product.T) / 2)
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)
