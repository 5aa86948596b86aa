"""Least-squares fit of the joints of a robot with a fixed base, set by set.

The sets of parameters are nested (``sets.SETS``). A set is chosen only if it predicts segments that
were left out of the fit significantly better than the set chosen before.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import mujoco.minimize
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.errors import InputError
from selfmodel.faults.build import apply_faults
from selfmodel.faults.hypothesis import INTACT
from selfmodel.robot.control_delay import MAX_CONTROL_DELAY, as_delay
from selfmodel.robot.joint_parameters import (
    QUANTITIES,
    changed,
    limbs_of_hinges,
    model_with_joint_parameters,
    names_of,
)
from selfmodel.robot.robot import Robot
from selfmodel.simulation.batch_memory import batch_bytes, hypothesis_bytes
from selfmodel.simulation.joints.segments import JointSegments
from selfmodel.simulation.joints.sets import NOMINAL, SETS, Basis, Point
from selfmodel.simulation.losses import damped, is_better, root_mean_square
from selfmodel.simulation.outcome import SimulationStats
from selfmodel.simulation.prediction import predict
from selfmodel.trials.signals import CALIBRATION_ERROR_SCALES

PRIOR_WEIGHT = 0.01
"""Weight of the prior relative to the data: all errors together count as 1 / PRIOR_WEIGHT**2
independent errors of one unit each. Long simulations without contacts have errors far below their
unit, so this weight is less than that of short predictions."""

DIFFERENCE_STEP = 0.05
"""Step of the finite differences of a logarithm, relative to the deviation of its prior."""

MIN_Z = 3.0
"""Standard errors by which a larger set must predict segments better that it was not fitted to."""

FOLDS = 3
"""Parts of the segments that are left out in turn."""

ITERATIONS, FOLD_ITERATIONS, DELAY_ITERATIONS = 5, 3, 2
"""Iterations of the least-squares solver: of a fit to all segments, of a fit without some of them,
and of the fits that compare control delays."""

MAX_ERROR = 1e6
"""Bound on the absolute error of a prediction: that of a simulation that is no longer finite."""


@dataclass(frozen=True, eq=False)
class JointFit:
    """Fit of one set of parameters to trials.

    Attributes:
        name: Name of the set, of ``SETS``.
        logarithms: Logarithm of the factor of each motor or hinge, by quantity.
        deviations: Standard deviation of each logarithm, in the same shape. It is that of the prior
            where the trials do not determine the parameter, and 0 in the nominal set.
        delay: Control delay, in control steps.
        error: Root mean square error of the predictions, in ``CALIBRATION_ERROR_SCALES``.
        held_out_error: Root mean square error in segments that were left out of the fit.
        joint_errors: Root mean square error of the positions of each hinge, rad.
    """

    name: str
    logarithms: dict[str, FloatArray]
    deviations: dict[str, FloatArray]
    delay: float
    error: float
    held_out_error: float
    joint_errors: FloatArray


def simulated_models(robot: Robot) -> int:
    """Returns the number of models that ``Experiment.chosen_sets`` simulates at most."""
    limbs = limbs_of_hinges(robot)
    delays = MAX_CONTROL_DELAY + 1 + 2 * robot.substeps.bit_length()
    total = 1
    for name in SETS[1:]:
        per_iteration = 2 + len(Basis.of(robot, name).independent(limbs))
        folds = FOLD_ITERATIONS * (FOLDS - 1)  # each without one of the folds
        iterations = ITERATIONS + folds + 1 + (delays if name == SETS[1] else 0)
        total += iterations * per_iteration
    return total


class Experiment:
    """Predictions of the segments of all trials with models of one robot.

    Args:
        robot: The robot as its model describes it.
        data: Segments of at least one trial of the healthy robot.
        threads: Threads of MuJoCo's steps.
    """

    def __init__(self, robot: Robot, data: Sequence[JointSegments], threads: int) -> None:
        self._robot, self._data, self._threads = robot, data, threads
        self._segments = sum(len(own.judged) for own in data)
        self._folds = np.arange(self._segments) % FOLDS
        self._limbs = limbs_of_hinges(robot)

    def nominal_errors(self) -> FloatArray:
        """Returns the errors of the robot's own model, segment by segment, ``(errors,)``."""
        return np.asarray(self._errors([self._start()])[0])

    def chosen_sets(self) -> list[JointFit]:
        """Fits the nested sets of parameters.

        Returns:
            The nominal set, then each set that is significantly better than the one before; the
            last is the best.

        Raises:
            InputError: Every simulation of the nominal model diverged.
        """
        start, errors = self._start(), self.nominal_errors()
        if not (errors < MAX_ERROR).any():
            raise InputError(
                "no simulation of the healthy robot remained finite: check the model, and the "
                "units of the logs"
            )
        everything = np.ones(self._segments, dtype=bool)
        chosen = [self._fit(NOMINAL, start, None, errors)]
        losses, point = self._losses(errors), start
        folds = [start] * FOLDS
        for name in SETS[1:]:
            basis = Basis.of(self._robot, name)
            if name == "shared":
                point = self._with_best_delay(basis, start, everything)
            point = self._solved(basis, point, everything, ITERATIONS)
            point = self._with_near_delay(basis, point, everything)
            folds = [replace(fold, delay=point.delay) for fold in folds]
            folds = [
                self._solved(basis, fold, self._folds != number, FOLD_ITERATIONS)
                for number, fold in enumerate(folds)
            ]
            held_out = self._held_out(folds)
            own = self._losses(held_out)
            if not is_better(own, losses, MIN_Z):
                continue
            chosen.append(self._fit(name, point, basis, held_out))
            losses = own
        return chosen

    def _fit(self, name: str, point: Point, basis: Basis | None, held_out: FloatArray) -> JointFit:
        errors = self._errors([point])[0]
        deviations = self._zero() if basis is None else self._deviations(basis, point)
        return JointFit(
            name=name,
            logarithms=point.logarithms,
            deviations=deviations,
            delay=point.delay,
            error=root_mean_square(errors),
            held_out_error=root_mean_square(held_out),
            joint_errors=self._joint_errors(errors),
        )

    def _start(self) -> Point:
        return Point(self._zero(), self._robot.control_delay)

    def _zero(self) -> dict[str, FloatArray]:
        return {q: np.zeros(len(names_of(self._robot, q))) for q in QUANTITIES}

    def _with_best_delay(self, basis: Basis, start: Point, used: BoolArray) -> Point:
        """Returns the fit with the best delay: of whole control steps, then of parts of one."""
        substeps = 1 if self._robot.model.na else self._robot.substeps
        solved: dict[int, tuple[float, Point]] = {}

        def cost(parts: int) -> float:
            if parts not in solved:
                moved = replace(start, delay=as_delay(parts, substeps))
                point = self._solved(basis, moved, used, DELAY_ITERATIONS)
                residuals = self._residuals(basis, [point], used)[:, 0]
                solved[parts] = float(residuals @ residuals), point
            return solved[parts][0]

        last = MAX_CONTROL_DELAY * substeps
        best = min(range(0, last + 1, substeps), key=cost)
        step = substeps // 2
        while step:
            near = [best + move for move in (-step, 0, step) if 0 <= best + move <= last]
            best = min(near, key=cost)
            step //= 2
        return solved[best][1]

    def _with_near_delay(self, basis: Basis, start: Point, used: BoolArray) -> Point:
        """Returns the fit with the best delay around that of a fit.

        The delay moves by a physics step at a time, as long as the fit improves.
        """
        substeps = 1 if self._robot.model.na else self._robot.substeps

        def cost(point: Point) -> float:
            residuals = self._residuals(basis, [point], used)[:, 0]
            return float(residuals @ residuals)

        best, least = start, cost(start)
        for direction in (-1, 1):
            while True:
                parts = round(best.delay * substeps) + direction
                if not 0 <= parts <= MAX_CONTROL_DELAY * substeps:
                    break
                moved = replace(best, delay=as_delay(parts, substeps))
                moved = self._solved(basis, moved, used, DELAY_ITERATIONS)
                if not cost(moved) < least:
                    break
                best, least = moved, cost(moved)
        return best

    def _solved(self, basis: Basis, start: Point, used: BoolArray, iterations: int) -> Point:
        """Returns the least-squares fit of a set to some segments."""

        def residual(rows: FloatArray) -> FloatArray:
            rows = np.reshape(rows, (basis.size, -1))
            points = [basis.point(column, start.delay) for column in rows.T]
            return self._residuals(basis, points, used)

        fitted, _ = mujoco.minimize.least_squares(
            basis.coordinates(start)[:, np.newaxis],
            residual,
            bounds=[-basis.bounds[:, np.newaxis], basis.bounds[:, np.newaxis]],
            jacobian=lambda x, at: self._slopes(residual, basis, x, at, used),
            max_iter=iterations,
            xtol=1e-3,
            verbose=mujoco.minimize.Verbosity.SILENT,
        )
        return basis.point(fitted.ravel(), start.delay)

    def _slopes(
        self,
        residual: Callable[[FloatArray], FloatArray],
        basis: Basis,
        x: FloatArray,
        at: FloatArray,
        used: BoolArray,
    ) -> FloatArray:
        """Returns the Jacobian of the residuals by forward differences, ``(residuals, size)``.

        Coordinates of different limbs are moved together, because the joints of one limb do not
        move another limb on a fixed base. Effects between limbs, such as their collisions, are left
        out of the Jacobian only.
        """
        widths = DIFFERENCE_STEP * basis.deviations
        batches = basis.independent(self._limbs)
        moved = np.stack([np.isin(np.arange(basis.size), batch) for batch in batches], axis=1)
        change = residual(x + moved * widths[:, np.newaxis]) - np.reshape(at, (-1, 1))
        count = len(change) - basis.size
        limb_of_error = np.resize(self._limbs, sum(self._widths()))[np.repeat(used, self._widths())]
        slopes = np.zeros((len(change), basis.size))
        for column, batch in enumerate(batches):
            for coordinate in batch:
                own = np.isin(limb_of_error, basis.limbs_of(coordinate, self._limbs))
                slopes[:count][own, coordinate] = change[:count][own, column] / widths[coordinate]
                row = count + coordinate
                slopes[row, coordinate] = change[row, column] / widths[coordinate]
        return slopes

    def _residuals(self, basis: Basis, points: Sequence[Point], used: BoolArray) -> FloatArray:
        """Returns the residuals of the data and of the prior, ``(residuals, points)``."""
        errors = self._errors(points)[:, np.repeat(used, self._widths())].T
        coordinates = np.stack([basis.coordinates(point) for point in points], axis=1)
        weight = np.sqrt(len(errors)) * PRIOR_WEIGHT / basis.deviations
        return np.concatenate([damped(errors), weight[:, np.newaxis] * coordinates])

    def _errors(self, points: Sequence[Point]) -> FloatArray:
        """Returns the errors of all segments, segment by segment, ``(points, errors)``.

        The points have one control delay. A step without a known state has an error of 0.
        """
        needed = max(hypothesis_bytes(self._robot, own.segments, steps=0) for own in self._data)
        size = max(1, batch_bytes() // needed)
        batches = [points[first : first + size] for first in range(0, len(points), size)]
        return np.concatenate([self._batch_errors(batch) for batch in batches])

    def _batch_errors(self, points: Sequence[Point]) -> FloatArray:
        robot = self._robot
        embodiments = [
            apply_faults(
                model_with_joint_parameters(robot, changed(robot, point.logarithms)),
                robot.anatomy,
                INTACT,
            )
            for point in points
        ]
        rows = []
        for own in self._data:
            predicted = predict(
                robot,
                embodiments,
                own.segments,
                threads=self._threads,
                stats=SimulationStats(),
                delay=points[0].delay,
            ).behaviour
            parts = []
            for signal, observed in own.observed.items():
                with np.errstate(over="ignore", invalid="ignore"):  # bounded below
                    error = predicted[signal][:, :, 1:] - observed
                error /= CALIBRATION_ERROR_SCALES[signal]
                error = np.where(own.judged[..., np.newaxis], error, 0.0)
                parts.append(error.reshape(*error.shape[:2], -1))
            rows.append(np.concatenate(parts, axis=2).reshape(len(points), -1))
        errors = np.nan_to_num(np.concatenate(rows, axis=1), nan=MAX_ERROR)
        return np.asarray(np.clip(errors, -MAX_ERROR, MAX_ERROR))

    def _widths(self) -> IndexArray:
        """Returns the number of errors of each segment, ``(segments,)``."""
        hinges = len(self._robot.anatomy.hinges)
        return np.concatenate(
            [
                np.full(len(own.judged), own.judged.shape[1] * hinges * len(own.observed))
                for own in self._data
            ]
        )

    def _losses(self, errors: FloatArray) -> FloatArray:
        """Returns the mean loss of each segment, ``(segments,)``."""
        widths = self._widths()
        firsts = np.concatenate([[0], np.cumsum(widths)[:-1]])
        return np.asarray(np.add.reduceat(damped(errors) ** 2, firsts) / widths)

    def _held_out(self, folds: Sequence[Point]) -> FloatArray:
        """Returns the errors of each segment by the fit that it was left out of, ``(errors,)``."""
        number = np.repeat(self._folds, self._widths())
        every = self._errors(folds)
        return np.asarray(every[number, np.arange(len(number))])

    def _joint_errors(self, errors: FloatArray) -> FloatArray:
        """Returns the root mean square error of the position of each hinge, rad, ``(hinges,)``."""
        hinges, squares, count, first = len(self._robot.anatomy.hinges), 0.0, 0, 0
        for own in self._data:
            segments, horizon = own.judged.shape
            size = segments * horizon * hinges * len(own.observed)
            block = errors[first : first + size].reshape(segments, len(own.observed), -1, hinges)
            squares = squares + (block[:, 0] ** 2).sum(axis=(0, 1))
            count += int(own.judged.sum())
            first += size
        scale = CALIBRATION_ERROR_SCALES["joint_positions"]
        return np.asarray(np.sqrt(squares / max(count, 1)) * scale)

    def _deviations(self, basis: Basis, point: Point) -> dict[str, FloatArray]:
        """Returns the standard deviation of each logarithm.

        The variance of the data is that of the segments' gradients (Huber 1967, White 1980), which
        includes model error and the correlation of neighbouring steps; that of the prior is added.
        """
        everything = np.ones(self._segments, dtype=bool)

        def residual(rows: FloatArray) -> FloatArray:
            points = [basis.point(column, point.delay) for column in rows.T]
            return self._residuals(basis, points, everything)

        x = basis.coordinates(point)[:, np.newaxis]
        values = residual(x)
        slopes, values = self._slopes(residual, basis, x, values, everything), values[:, 0]
        count = len(values) - basis.size
        firsts = np.concatenate([[0], np.cumsum(self._widths())[:-1]])
        gradients = np.add.reduceat(slopes[:count] * values[:count, np.newaxis], firsts)
        segments = len(gradients)
        prior = slopes[count:].T @ slopes[count:]
        spread = segments / max(segments - 1, 1) * gradients.T @ gradients
        inverse = np.linalg.inv(slopes.T @ slopes)
        # In the unit of the prior, whose precision is 1 / deviation^2.
        unit = count * PRIOR_WEIGHT**2
        variance = np.diag(inverse @ (spread + prior * unit) @ inverse)
        return basis.spread(np.minimum(np.sqrt(variance), basis.deviations))
