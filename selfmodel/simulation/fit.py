"""Fit of nested sets of parameters to trials of the healthy robot, and its held-out test.

The sets grow: none; the control delay; the stiffness and damping of contacts; factors. A set is
chosen only if it predicts segments that were left out of its fit significantly better than the set
chosen before. Delay and contacts are found by exhaustive search; factors by a box-constrained
nonlinear least squares (``mujoco.minimize``) with a Gaussian prior for those that the trials do not
determine.

A robot with a floating base has one set of factors. With a fixed base, which determines neither
masses nor the friction of the ground, nor has contacts, there are three: gain, damping, dry
friction, armature and, if the trials reach any, force limits of all joints together, of each kind
of joint, and of each joint.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import mujoco.minimize
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.robot.anatomy import MAX_CONTROL_DELAY, as_delay
from selfmodel.robot.robot import Robot
from selfmodel.simulation.model_factors import (
    FORCE_LIMITS,
    JOINT_PRIOR_DEVIATIONS,
    MAX_LOG_FACTOR,
    Basis,
    Parameters,
    bases,
    nominal,
    prior_deviations,
)
from selfmodel.simulation.segments import (
    SegmentErrors,
    is_better,
    pseudo_huber,
    root_mean_square,
)

EXACT_ERROR = 0.01
"""Root mean square error, in ``CALIBRATION_ERROR_SCALES``, below which the model counts as
exact."""

NOMINAL, DELAY, CONTACTS = "nominal", "delay", "contacts"
"""Names of the nested sets of parameters before those of factors."""

CANDIDATE_STIFFNESSES = (0.25, 0.5, 1.0, 2.0, 4.0)
CANDIDATE_DAMPINGS = (0.125, 0.25, 0.5, 1.0, 2.0)
"""Factors of the stiffness and the damping of contacts in the exhaustive search."""

FRICTION_STEP = 0.9
"""Factor from one friction to the next beside other contacts: a step of a third of the prior's
deviation."""

FOLDS = 4
"""Consecutive parts of each trial that are left out in turn."""

MIN_Z, CONTACTS_MIN_Z = 1.645, 3.0
"""Standard errors by which a larger set must predict segments better that it was not fitted to: a
one-sided level of 5 %. The best of 25 contacts gains by chance, too; theirs is times the square
root of the overlap, because segments of a short trial share steps."""

INDEPENDENT_ERRORS = 100
"""Independent errors of one unit that all errors together count as in the posterior deviations:
fewer than in the fit, because no model has a factor for each limb and contact. With 100, intervals
contain the truth at about their rates (``benchmarks.calibration``); with 400, too rarely. The
scatter of the segments' gradients (Huber 1967, White 1980) does not contain the error of the model:
on arms, its intervals of 95 % contained the truth in less than half of the cases."""

UNDETERMINED_SHARE = 0.7
"""Deviation of a parameter, relative to that of its prior, from which on it is not determined: the
trials halve the variance of a parameter that they determine."""

LEAST_STEP = 1e-3
"""Norm of a difference of logarithms of parameters that does not count: a step of the solver that
is as near to one that was rejected is taken for it. Each that is tried takes a simulation of all
segments, and most regularizers are far below or above the curvature of the fit: of up to 131 that
were tried for a step, about 20 had an effect."""


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
        delay_iterations: As ``iterations``, for each neighbouring delay; 0 to keep the delay.
        regularizers: Smallest and largest regularizer of the solver, and the factor from one to the
            next.
    """

    prior_weight: float
    step: float
    is_central: bool
    iterations: int
    delay_iterations: int
    regularizers: Mapping[str, float]


FLOATING = Method(0.05, 0.1, True, 3, 0, {})
"""Where there are contacts, smaller steps are dominated by noise: a parameter changes the time at
which a foot makes contact."""

FIXED = Method(0.01, 0.05, False, 5, 2, {"mu_min": 1e-3, "mu_max": 1e5, "mu_factor": 10.0})
"""Long simulations without contacts have errors far below their unit, so their prior weighs less
than that of short predictions."""


REFIT_ITERATIONS = 1
"""Iterations of a refit. Of ten trials of ``benchmarks.foreign``, its cost was lower than that of a
fit to all trials from the nominal model in eight, in a fourth of the time."""


@dataclass(frozen=True, eq=False)
class Fit:
    """Fit of one set of parameters to trials.

    Attributes:
        deviations: Posterior standard deviation of the logarithm of each factor, by the name of
            its quantity in ``Parameters``; that of the prior for a factor that was not fitted.
        errors: Errors of its predictions, ``(errors,)``.
        held_out: Errors in segments that were each left out of the fit, ``(errors,)``.
        is_fitted: Whether the set contains factors.
    """

    name: str
    parameters: Parameters
    deviations: Mapping[str, FloatArray]
    errors: FloatArray
    held_out: FloatArray
    is_fitted: bool = False


def is_determined(deviation: FloatArray, prior: FloatArray) -> BoolArray:
    """Returns whether trials determine parameters, given both standard deviations."""
    return np.asarray(deviation < UNDETERMINED_SHARE * prior)


def nested_fits(segments: SegmentErrors) -> list[Fit]:
    """Returns the nominal set, then each nested set that was chosen; the last is the best.

    The nominal set is the only one if it predicts the segments exactly.
    """
    robot, best = segments.robot, nominal(segments.robot)
    errors = segments.of([best])[:, 0]
    first = Fit(NOMINAL, best, prior_deviations(robot), errors, errors)
    if root_mean_square(errors) < EXACT_ERROR:
        return [first]
    chosen, contacts_min_z = [first], CONTACTS_MIN_Z * float(np.sqrt(segments.overlap))

    def choose(fit: Fit, min_z: float) -> bool:
        losses, others = (segments.losses(own.held_out) for own in (fit, chosen[-1]))
        better = is_better(losses, others, min_z)
        chosen.extend([fit] * better)
        return better

    if not robot.has_fixed_base:
        delays = [replace(best, delay=steps) for steps in range(MAX_CONTROL_DELAY + 1)]
        whole = _best_candidate(DELAY, segments, delays, first)
        choose(whole, MIN_Z)
        part = _part_delay(segments, whole)
        fit = part if choose(part, MIN_Z) else whole
        best = fit.parameters
        contacts = [
            replace(best, contact_stiffness=stiffness, contact_damping=damping)
            for stiffness, damping in product(CANDIDATE_STIFFNESSES, CANDIDATE_DAMPINGS)
        ]
        fit = _best_candidate(CONTACTS, segments, contacts, fit)
        if choose(fit, contacts_min_z):
            best = fit.parameters
    limited = robot.has_fixed_base and _reaches_limits(segments, best)
    for number, (name, basis) in enumerate(bases(robot, reaches_limits=limited)):
        fitter = _Fitter(segments, basis, FIXED if robot.has_fixed_base else FLOATING)
        if robot.has_fixed_base and not number:
            best, x = fitter.solved(fitter.with_best_delay(best))
        else:
            best, x = fitter.with_near_delay(*fitter.solved(best))
        points = [(best, x, segments.of([best])[:, 0])]
        if not robot.has_fixed_base:
            near, errors = _with_near_contacts(segments, best, points[0][2])
            points[:0] = [(near, basis.coordinates(near), errors)] * (near != best)
        for point, x, errors in points:
            is_new = chosen[-1].parameters.contacts == (1.0, 1.0) != point.contacts
            min_z = contacts_min_z if is_new else MIN_Z
            is_lower = _cost(errors) < _cost(chosen[-1].errors)
            if is_lower and choose(fitter.tested(name, point, x, errors), min_z):
                break
    return chosen


def refitted(segments: SegmentErrors, start: Parameters) -> Parameters:
    """Returns a fit of other trials, fitted to the segments: contacts near its own, then factors.

    Its delay stays, and the prior is that of the nominal model. A fixed base is fitted anew: which
    limits and delays count depends on the movement, and its fit is cheap.
    """
    if segments.robot.has_fixed_base:
        return nested_fits(segments)[-1].parameters
    near, _ = _with_near_contacts(segments, start, segments.of([start])[:, 0])
    ((_, basis),) = bases(segments.robot)
    return _Fitter(segments, basis, FLOATING).solved(near, REFIT_ITERATIONS)[0]


def expected_models(robot: Robot) -> int:
    """Returns about how many models a calibration simulates, for its progress."""
    delays, count = MAX_CONTROL_DELAY + 1, 1
    if robot.has_fixed_base:
        method, parts = FIXED, delay_parts(robot)
        tried = delays + 2 * parts.bit_length()
    else:
        method, tried = FLOATING, 0
        count += delays + 2 * (delay_parts(robot).bit_length() - 1)
        count += len(CANDIDATE_STIFFNESSES) * len(CANDIDATE_DAMPINGS) + 11  # and near
    for _, basis in bases(robot):
        width = len(basis.prior)
        slopes = 2 * width if method.is_central else width
        count += (method.iterations + tried * method.delay_iterations) * (slopes + 2)
        count += 2 * width + FOLDS + 2
        tried = 2  # neighbouring delays of a set after the first
    return count


def expected_refit_models(robot: Robot) -> int:
    """Returns about how many models a refit simulates, for its progress."""
    if robot.has_fixed_base:
        return expected_models(robot)
    ((_, basis),) = bases(robot)
    return 11 + REFIT_ITERATIONS * (2 * len(basis.prior) + 2)  # near contacts, frictions


def delay_parts(robot: Robot) -> int:
    """Returns the parts of a control step of which a delay is a multiple."""
    return 1 if robot.model.na else robot.substeps


def _reaches_limits(segments: SegmentErrors, start: Parameters) -> bool:
    """Returns whether lower force limits of the motors change any prediction.

    A limit that is not reached has no slope, and no trial determines it.
    """
    lower = float(np.exp(-JOINT_PRIOR_DEVIATIONS[FORCE_LIMITS]))
    limited = replace(start, force_limits=(lower,) * segments.robot.model.nu)
    own, other = segments.of([start, limited]).T
    return not np.array_equal(own, other)


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


def _part_delay(segments: SegmentErrors, whole: Fit) -> Fit:
    """Returns the best delay of parts of a control step around that of a fit."""
    fit, parts = whole, delay_parts(segments.robot)
    delays, step = range(MAX_CONTROL_DELAY * parts + 1), parts // 2
    while step:
        middle = round(fit.parameters.delay * parts)
        near = [delay for delay in (middle - step, middle + step) if delay in delays]
        moved = [replace(fit.parameters, delay=as_delay(delay, parts)) for delay in near]
        fit = _best_candidate(DELAY, segments, moved, fit)
        step //= 2
    return fit


def _with_near_contacts(
    segments: SegmentErrors, start: Parameters, errors: FloatArray
) -> tuple[Parameters, FloatArray]:
    """Returns a fit with the best contacts beside its own, then the best friction; its errors.

    Contacts were searched with another friction, and friction was fitted with these contacts; each
    changes which of the other is best.
    """
    stiffnesses, dampings = (
        every[max(every.index(own) - 1, 0) : every.index(own) + 2]
        for every, own in (
            (CANDIDATE_STIFFNESSES, start.contact_stiffness),
            (CANDIDATE_DAMPINGS, start.contact_damping),
        )
    )
    contacts = [
        replace(start, contact_stiffness=stiffness, contact_damping=damping)
        for stiffness, damping in product(stiffnesses, dampings)
    ]
    near = [own for own in contacts if own != start]
    found = {start: errors, **dict(zip(near, segments.of(near).T, strict=True))}
    best = min(found, key=lambda own: _cost(found[own]))
    for factor in (FRICTION_STEP, 1 / FRICTION_STEP):
        while abs(np.log(friction := best.friction * factor)) < MAX_LOG_FACTOR:
            moved = replace(best, friction=friction)
            found[moved] = segments.of([moved])[:, 0]
            if not _cost(found[moved]) < _cost(found[best]):
                break
            best = moved
    return best, found[best]


@dataclass(frozen=True, eq=False)
class _Fitter:
    """Least-squares fits of one set of factors, given by its coordinates."""

    segments: SegmentErrors
    basis: Basis
    method: Method

    @cached_property
    def _widths(self) -> FloatArray:
        prior, method = self.basis.prior, self.method
        return np.asarray(method.step * (np.ones_like(prior) if method.is_central else prior))

    def solved(
        self, start: Parameters, iterations: int | None = None
    ) -> tuple[Parameters, FloatArray]:
        """Returns the fit of the start's factors, with its delay and contacts; its coordinates."""
        basis, width, steps = self.basis, self._widths, np.diag(self._widths)
        rejected = list[tuple[FloatArray, FloatArray]]()

        def tried(x: FloatArray) -> FloatArray:
            if not rejected or np.linalg.norm(x - rejected[-1][0]) >= LEAST_STEP:
                rejected.append((x.copy(), residual(x)))
            return rejected[-1][1]

        def residual(logarithms: FloatArray) -> FloatArray:
            # Those of the data, then those of the prior.
            rows = np.reshape(logarithms, (len(logarithms), -1))
            errors = self.segments.of([basis.applied(start, row) for row in rows.T])
            weight = np.sqrt(len(errors)) * self.method.prior_weight / basis.prior
            return np.concatenate([pseudo_huber(errors), weight[:, np.newaxis] * rows])

        def jacobian(x: FloatArray, at: FloatArray) -> FloatArray:
            rejected.clear()  # the last one was accepted
            if self.method.is_central:
                return np.asarray((residual(x + steps) - residual(x - steps)) / (2 * width))
            return np.asarray((residual(x + steps) - at) / width)

        bounds = basis.bounds[:, np.newaxis]
        fitted, _ = mujoco.minimize.least_squares(
            basis.coordinates(start)[:, np.newaxis],
            tried,
            bounds=[-bounds, bounds],
            jacobian=jacobian,
            max_iter=iterations or self.method.iterations,
            xtol=1e-3,
            verbose=mujoco.minimize.Verbosity.SILENT,
            **self.method.regularizers,
        )
        x = np.asarray(fitted.ravel())
        return basis.applied(start, x), x

    def with_best_delay(self, start: Parameters) -> Parameters:
        """Returns the fit with the best delay: of whole control steps, then of parts of one.

        A wrong gain or damping looks like a wrong delay, so each is tried with a short fit.
        """
        parts, solved = delay_parts(self.segments.robot), dict[int, tuple[float, Parameters]]()

        def cost(delay: int) -> float:
            if delay not in solved:
                moved = replace(start, delay=as_delay(delay, parts))
                point, _ = self.solved(moved, self.method.delay_iterations)
                solved[delay] = _cost(self.segments.of([point])), point
            return solved[delay][0]

        delays, step = range(MAX_CONTROL_DELAY * parts + 1), parts // 2
        best = min(delays[::parts], key=cost)
        while step:
            near = (best - step, best, best + step)
            best = min((delay for delay in near if delay in delays), key=cost)
            step //= 2
        return solved[best][1]

    def with_near_delay(self, start: Parameters, x: FloatArray) -> tuple[Parameters, FloatArray]:
        """Returns the fit with the best delay around that of a fit, and its coordinates.

        The delay moves by a physics step at a time, as long as the fit improves.
        """
        iterations, parts = self.method.delay_iterations, delay_parts(self.segments.robot)
        best, delays = (start, x), range(MAX_CONTROL_DELAY * parts + 1)
        least = _cost(self.segments.of([start])) if iterations else 0.0
        for direction in (-1, 1) if iterations else ():
            while (delay := round(best[0].delay * parts) + direction) in delays:
                moved = self.solved(replace(best[0], delay=as_delay(delay, parts)), iterations)
                cost = _cost(self.segments.of(moved[:1]))
                if not cost < least:
                    break
                best, least = moved, cost
        return best

    def tested(self, name: str, point: Parameters, x: FloatArray, errors: FloatArray) -> Fit:
        """Returns a fit with its held-out errors and its posterior deviations.

        Its residuals are linearised around it, with independent segments: long simulations are
        chaotic, so that their derivatives would be meaningless. The fit without a part differs by
        one Gauss-Newton step, less that of the whole fit, which the solver left. ``x`` are the
        coordinates of the fitted parameters, ``point``.
        """
        segments, basis, width = self.segments, self.basis, self._widths
        moved = np.concatenate([x + np.diag(width), x - np.diag(width)])
        independent = segments.with_estimated_states(point)
        residuals = pseudo_huber(errors)
        change = pseudo_huber(independent.of([basis.applied(point, own) for own in moved]))
        change = (change - residuals[:, np.newaxis]) / np.tile(width, 2)
        ahead, behind = np.split(change, 2, axis=1)
        behind = -behind

        def step(used: BoolArray) -> FloatArray:
            slopes, left = (ahead + behind)[used] / 2, residuals[used]
            weight = 1 / (max(len(left), 1) * self.method.prior_weight**2)
            prior = basis.prior**-2
            gradient = slopes.T @ left * weight + prior * x
            information = slopes.T @ slopes * weight + np.diag(prior)
            return np.asarray(-np.linalg.solve(information, gradient))

        parts = segments.folds(FOLDS)[segments.segment_of_error]
        whole = step(np.ones(len(parts), np.bool_))
        without = [x + (step(parts != part) - whole) for part in range(FOLDS)]
        within = np.clip(without, -basis.bounds, basis.bounds)
        every = segments.of([basis.applied(point, own) for own in within])
        held_out = every[np.arange(len(parts)), parts]
        weight = INDEPENDENT_ERRORS / len(residuals)
        information = np.diag(basis.prior**-2) + consistent_information(ahead, behind) * weight
        fitted = basis.by_quantity(np.sqrt(np.diag(np.linalg.inv(information))))
        deviations = prior_deviations(segments.robot) | fitted
        return Fit(name, point, deviations, errors, held_out, is_fitted=True)


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
