"""Losses of hypotheses on logged trials, and the problem that a diagnosis solves with them."""

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray, median_of_known
from selfmodel.diagnosis.choice import contract_error, prepared_trial
from selfmodel.diagnosis.comparator import (
    Comparator,
    Losses,
    PiecewiseTrial,
    PreparedTrial,
    as_comparator,
)
from selfmodel.diagnosis.significance import CONTRADICTION
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.joints import JAMMED_AT_ANGLE, OF_MOTORS, SERVO_GAIN, WEAK_MOTOR
from selfmodel.faults.kind import Fault
from selfmodel.progress import Observer, ignore
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.calibration import Calibration
from selfmodel.simulation.requests import END, ClosedLoop, Ensemble, Request, Segments
from selfmodel.simulation.rollout import SimulationResult, largest_batch
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial, TrialPart, observed_as, whole

Parts = Sequence[Trial | TrialPart]

LossFunction = Callable[[Sequence[Hypothesis]], FloatArray]
"""Returns the losses of some hypotheses, ``(n, pieces)``; inf where a simulation diverged."""

Calibrate = Callable[[Sequence[Trial]], Calibration]
"""Fits the self-model to some trials of the healthy robot."""

OPENING, MIN_OPENING = 1 / 3, 100
"""Part of a trial that is simulated, from its beginning, if the comparator has no surrogate, and
its shortest length, control steps. The first part discriminates best: later, contact has made any
two simulations differ."""

MANY_TRIALS = 3
"""Trials from which on the surrogate of the surrogate is enough: together they have as many pieces
as one trial by the surrogate."""

MIN_SURROGATE_PIECES = 2
"""Pieces of the surrogate comparator that a search in a part of the trials needs."""

TOLD_APART = (0.2, 0.5)
"""Severities at which the gain of a servo is compared with the torque of its motor."""

MAX_JAM_SPREAD = 0.05
"""Largest difference between the angles of the hinges of one jammed joint, rad."""


class Timeline(NamedTuple):
    """Index of the trial of each piece, and its first and last time, s, ``(pieces,)`` each."""

    trial: IndexArray
    begin: FloatArray
    end: FloatArray


class LossTable:
    """Losses of hypotheses on trials, by the content of the trial and the hypothesis.

    A trial is prepared once, and a hypothesis is simulated once for each trial: the total, the
    parts of signals and the losses of hinges are of one simulation. They are independent of the
    hypotheses computed before.
    """

    def __init__(self, simulator: Simulator, comparator: Comparator) -> None:
        self._simulator = simulator
        self._comparator = as_comparator(comparator, getattr(comparator, "name", repr(comparator)))
        self._prepared: dict[Hashable, PreparedTrial | PiecewiseTrial] = {}
        self._known: dict[tuple[Hashable, Hypothesis], Losses] = {}

    def of_robot(self, robot: Robot) -> "LossTable":
        """Returns an empty table of the same comparator, with another self-model."""
        return LossTable(Simulator(robot, self._simulator.threads), self._comparator)

    def check(self, trials: Sequence[Trial]) -> None:
        """Raises an ``InputError`` with every trial that the comparator refuses, and the reason."""
        if problems := self._refusals(trials):
            raise InputError("; ".join(problems))

    def _refusals(self, trials: Sequence[Trial]) -> list[str]:
        problems = []
        for trial in trials:
            try:
                self._of(trial)
            except InputError as error:
                problems.append(str(error))
        return problems

    def is_piecewise(self, trials: Sequence[Trial]) -> bool:
        """Returns whether the distances are means of losses, so that paired tests are possible."""
        return all(isinstance(self._of(trial), PiecewiseTrial) for trial in trials)

    def uses_segments(self, trials: Sequence[Trial]) -> bool:
        """Returns whether the comparator compares short predictions on all trials."""
        return all(isinstance(self._of(trial).request, Segments) for trial in trials)

    def distances(self, hypotheses: Sequence[Hypothesis], trials: Parts) -> FloatArray:
        """Returns the sum over the trials of the mean loss of each hypothesis, ``(n,)``.

        It is infinite for a hypothesis whose simulation diverges.
        """
        total = np.zeros(len(hypotheses))
        for rows, pieces in self._rows_of(hypotheses, trials):
            losses = (row.total[pieces] for row in rows)
            # A change near the end of a trial leaves no piece of it.
            total += [one.mean() if len(one) else 0.0 for one in losses]
        return total

    def losses(self, hypotheses: Sequence[Hypothesis], trials: Parts) -> FloatArray:
        """Returns the losses of each hypothesis on all trials, ``(n, pieces)``.

        A comparator without losses has one column per trial: the distance.
        """
        rows_of = self._rows_of(hypotheses, trials)
        return np.concatenate(
            [np.array([row.total[pieces] for row in rows]) for rows, pieces in rows_of], axis=1
        )

    def by_signal(self, hypothesis: Hypothesis, trials: Parts) -> Mapping[str, FloatArray]:
        """Returns the part of each signal in each loss of a hypothesis, ``(pieces,)`` each.

        The result is empty for a comparator whose losses are no sums over signals, and for a
        hypothesis whose simulation diverges.
        """
        parts: dict[str, list[FloatArray]] = {}
        for (row,), pieces in self._rows_of([hypothesis], trials):
            if not row.by_signal or not np.isfinite(row.total).all():
                return {}
            for signal, losses in row.by_signal.items():
                parts.setdefault(signal, []).append(losses[pieces])
        return {signal: np.concatenate(each) for signal, each in parts.items()}

    def by_hinge(self, hypotheses: Sequence[Hypothesis], trials: Parts) -> FloatArray | None:
        """Returns the losses of each hinge on its own, ``(n, pieces, hinges)``.

        A loss is infinite where a simulation diverges, and NaN without evidence on the hinge. The
        result is None for a comparator that predicts no single hinges.
        """
        parts = []
        for rows, pieces in self._rows_of(hypotheses, trials):
            hinges = [row.by_hinge for row in rows if row.by_hinge is not None]
            if len(hinges) < len(rows):
                return None
            parts.append(np.array(hinges)[:, pieces])
        return np.concatenate(parts, axis=1)

    def timeline(self, trials: Parts) -> Timeline | None:
        """Returns the times of the columns of ``losses``; None if the comparator has no times."""
        times = []
        for part in map(whole, trials):
            steps = self._piece_steps(part.trial)
            if steps is None:
                return None
            times.append(part.trial.trajectory.time[steps][self._pieces(part)])
        begin, end = np.concatenate(times).T
        return Timeline(np.repeat(np.arange(len(times)), [*map(len, times)]), begin, end)

    def surrogate(self, trials: Sequence[Trial]) -> tuple["LossTable", Sequence[Trial]]:
        """Returns a table and trials that cost less and rank hypotheses about as these trials do.

        A comparator without losses is its own surrogate: its hypotheses are not refined, so its
        distances from the whole trials make the ranking. Otherwise it is the comparator's own
        surrogate (from ``MANY_TRIALS`` on, the surrogate of that one), or the comparator on the
        openings of the trials. A surrogate that refuses a trial, such as one with many late steps,
        is left out.
        """
        if not self.is_piecewise(trials):
            return self, trials
        if self._cheaper is None:
            return self, [self._opening(trial) for trial in trials]
        cheapest = self._cheaper._cheaper if len(trials) >= MANY_TRIALS else None  # noqa: SLF001
        for table in (cheapest, self._cheaper):
            if table is not None and not table._refusals(trials):  # noqa: SLF001
                return table, trials
        return self, trials

    @cached_property
    def _cheaper(self) -> "LossTable | None":
        surrogate = getattr(self._comparator, "surrogate", None)
        return None if surrogate is None else LossTable(self._simulator, surrogate)

    def _opening(self, trial: Trial) -> Trial:
        """The first part of a trial, or the whole trial if the comparator refuses the part."""
        whole_steps = trial.trajectory.steps
        steps = max(round(OPENING * whole_steps), min(MIN_OPENING, whole_steps))
        opening = replace(trial, trajectory=trial.trajectory.first(steps))
        return trial if self._refusals([opening]) else opening

    def _of(self, trial: Trial) -> PreparedTrial | PiecewiseTrial:
        """Returns the prepared trial."""
        if trial.content not in self._prepared:
            prepared = prepared_trial(self._comparator, self._simulator.robot, trial)
            self._prepared[trial.content] = prepared
        return self._prepared[trial.content]

    def _piece_steps(self, trial: Trial) -> IndexArray | None:
        steps: IndexArray | None = getattr(self._of(trial), "piece_steps", None)
        return steps

    def _pieces(self, part: TrialPart) -> BoolArray | slice:
        """Returns the pieces of a trial that lie within a part of it."""
        steps = self._piece_steps(part.trial)
        if part.is_whole or steps is None:
            return slice(None)
        times = part.trial.trajectory.time[steps]
        return np.asarray((times[:, 0] >= part.begin) & (times[:, 1] <= part.end))

    def _rows_of(
        self, hypotheses: Sequence[Hypothesis], trials: Parts
    ) -> Iterator[tuple[list[Losses], BoolArray | slice]]:
        """Returns for each trial the losses of each hypothesis, and the pieces that count."""
        for part in map(whole, trials):
            yield self._rows(hypotheses, part.trial), self._pieces(part)

    def _rows(self, hypotheses: Sequence[Hypothesis], trial: Trial) -> list[Losses]:
        known, content = self._known, trial.content
        missing = list(dict.fromkeys(one for one in hypotheses if (content, one) not in known))
        steps = trial.trajectory.steps
        size = largest_batch(self._simulator.robot, self._of(trial).request, steps)
        for first in range(0, len(missing), size):
            batch = missing[first : first + size]
            losses = self._simulated(batch, trial)
            known.update(((content, one), losses[row]) for row, one in enumerate(batch))
        return [known[content, one] for one in hypotheses]

    def _simulated(self, hypotheses: Sequence[Hypothesis], trial: Trial) -> Losses:
        """Returns the checked losses of simulations; infinite where one diverged."""
        prepared, piece_steps = self._of(trial), self._piece_steps(trial)
        result = simulate(self._simulator, prepared.request, trial, hypotheses)
        diverged = result.diverged[:, np.newaxis]
        with np.errstate(all="ignore") if diverged.any() else nullcontext():
            if isinstance(prepared, PiecewiseTrial):
                given = prepared.losses(result.trajectory)
            else:
                given = np.asarray(prepared.distances(result.trajectory))[..., np.newaxis]
        losses = given if isinstance(given, Losses) else Losses(np.asarray(given))
        total, by_hinge, problem = losses.total, losses.by_hinge, ""
        hinges = (*total.shape, len(trial.trajectory.names.hinges))
        if total.ndim != 2 or len(total) != len(hypotheses) or not total.shape[1]:
            problem = f"returned losses {total.shape} for {len(hypotheses)} simulations"
        elif len(wrong := total[~((total >= 0) | diverged)]):
            problem = f"returned a distance that is not a number of at least 0: {wrong[0]}"
        elif by_hinge is not None and by_hinge.shape != hinges:
            problem = f"returned losses of hinges {by_hinge.shape} in place of {hinges}"
        if problem:
            raise contract_error(self._comparator, problem)
        if piece_steps is not None:
            total = total + contradiction_losses(hypotheses, trial.trajectory, piece_steps)
        if by_hinge is not None:
            by_hinge = np.where(diverged[:, np.newaxis], np.inf, by_hinge)
        return Losses(np.where(diverged, np.inf, total), losses.by_signal, by_hinge)


def simulate(
    simulator: Simulator, request: Request, trial: Trial, hypotheses: Sequence[Hypothesis]
) -> SimulationResult:
    """Runs the simulation that a comparison with a trial requires, a row for each hypothesis."""
    driver, steps = trial.plan.controller, trial.trajectory.steps
    match request:
        case ClosedLoop():
            runs = [(hypothesis, driver) for hypothesis in hypotheses]
            return simulator.run(runs, steps, request.record)
        case Segments():
            return simulator.predict(hypotheses, request, trial.trajectory)
        case Ensemble():
            return simulator.run_ensemble(hypotheses, driver, steps, request)


def contradiction_losses(
    hypotheses: Sequence[Hypothesis], trajectory: Trajectory, piece_steps: IndexArray
) -> FloatArray:
    """Returns the loss in the pieces in which a log contradicts hypotheses, ``(n, pieces)``.

    A sensor whose reading changes has not failed. The loss of a comparator contains this only in
    part: a model that predicts far too much contact at a foot is nearer to a sensor that never
    reads contact than to one that seldom does.
    """
    losses = np.zeros((len(hypotheses), len(piece_steps)))
    for row, hypothesis in zip(losses, hypotheses, strict=True):
        for fault in hypothesis.faults:
            steps = np.append(0, np.cumsum(fault.kind.contradicted(fault, trajectory)))
            is_contradicted = steps[piece_steps[:, 1] + 1] > steps[piece_steps[:, 0]]
            row[is_contradicted] += CONTRADICTION
    return losses


class Problem:
    """Trials to explain, or parts of them, and the losses of hypotheses about them.

    Jams at the angles at which the encoders end are added to the hypotheses, and gains of servos
    that equal weak motors in the trials are left out.

    Args:
        table: Losses of the comparator.
        space: The hypotheses about the robot.
        trials: Trials to explain, or parts of them.
        surrogate: Losses of the surrogate comparator, and its trials; see ``LossTable.surrogate``.
        healthy_trials: Trials of the healthy robot, or parts of them.
        names: Names of the trials of the whole diagnosis, by path.
        settings: Parameters of the search.
        calibrate: Fits the self-model to some trials; None for one that is given as it is.
        healthy_parts: Parts of trials before a change, in which the robot was healthy.
        observer: Called with the progress of each stage.

    Attributes:
        healthy_motions: Healthy trials, and healthy parts of the trials to explain.
        has_test: Whether hypotheses are compared by a paired test.
    """

    def __init__(
        self,
        table: LossTable,
        space: HypothesisSpace,
        trials: Parts,
        *,
        surrogate: tuple[LossTable, Parts],
        healthy_trials: Parts,
        names: Mapping[str, str],
        settings: Settings,
        calibrate: Calibrate | None = None,
        healthy_parts: Parts = (),
        observer: Observer = ignore,
    ) -> None:
        self.table, self.surrogate, self.names, self.settings = table, surrogate, names, settings
        self.calibrate, self.observer = calibrate, observer
        self.trials, self.healthy_trials = [*map(whole, trials)], [*map(whole, healthy_trials)]
        self.healthy_motions = [*self.healthy_trials, *map(whole, healthy_parts)]
        jams = observed_jams([part.rows for part in self.trials], space.anatomy)
        self.space = self._told_apart(replace(space, observed=jams))
        self.has_test = table.is_piecewise([part.trial for part in self.trials])
        # Closed-loop windows are correlated, and not compared with those of healthy trials.
        every = [part.trial for part in (*self.healthy_trials, *self.trials)]
        is_comparable = table.is_piecewise(every) and table.uses_segments(every)
        self._comparable = self.healthy_trials if is_comparable else []

    def _told_apart(self, space: HypothesisSpace) -> HypothesisSpace:
        """Returns the hypotheses without gains of servos of which no prediction reaches a limit."""
        is_asked = SERVO_GAIN in space.kinds or SERVO_GAIN.suits(space.anatomy)
        parts = space.parts(SERVO_GAIN) if is_asked and WEAK_MOTOR in space.kinds else ()
        alike = []
        for part in parts:
            faults = [Fault(kind, part, value) for kind in OF_MOTORS for value in TOLD_APART]
            losses = self.losses([Hypothesis((fault,)) for fault in faults])
            one, other = np.split(losses, 2)
            if np.isfinite(losses).all() and np.array_equal(one, other):
                alike.append(part)
        return space.without(SERVO_GAIN, alike)

    def within(
        self, cut: Callable[[Sequence[Trial]], Parts], healthy_trials: Parts = ()
    ) -> "Problem | None":
        """Returns the problem of a part of the trials; None if the surrogate has too few pieces.

        ``healthy_trials`` are the parts of the trials in which the robot was healthy; they are the
        reference if there are no trials of the healthy robot.
        """
        table, coarse = self.surrogate[0], cut([whole(one).trial for one in self.surrogate[1]])
        if table.losses([INTACT], coarse).shape[1] < MIN_SURROGATE_PIECES:
            return None
        return Problem(
            self.table,
            self.space,
            cut([part.trial for part in self.trials]),
            surrogate=(table, coarse),
            healthy_trials=self.healthy_trials or healthy_trials,
            names=self.names,
            settings=self.settings,
            calibrate=self.calibrate,
            healthy_parts=healthy_trials,
            observer=self.observer,
        )

    @cached_property
    def recalibrated(self) -> LossTable | None:
        """Losses with the self-model that is fitted to the healthy trials and these together.

        None for a self-model that is given as it is, and if the trials are too short for a fit.
        """
        every = [part.rows for part in (*self.healthy_trials, *self.trials)]
        try:
            return self.calibrate and self.table.of_robot(self.calibrate(every).robot)
        except InputError:
            return None

    def losses(self, hypotheses: Sequence[Hypothesis]) -> FloatArray:
        """Returns the losses on the trials to explain, ``(n, pieces)``."""
        return self.table.losses(hypotheses, self.trials)

    def coarse(self, hypotheses: Sequence[Hypothesis]) -> FloatArray:
        """Returns the losses on the same trials by the surrogate, ``(n, fewer pieces)``."""
        table, trials = self.surrogate
        return table.losses(hypotheses, trials)

    def healthy(self, hypotheses: Sequence[Hypothesis]) -> FloatArray | None:
        """Returns the losses on healthy trials, ``(n, healthy pieces)``.

        The result is None without healthy trials, or if the losses are correlated over a trial and
        so not comparable between trials.
        """
        return self.table.losses(hypotheses, self._comparable) if self._comparable else None

    @cached_property
    def reference(self) -> FloatArray | None:
        """Losses of the empty hypothesis on all healthy trials, ``(pieces,)``; None without any.

        Encoders that are lost in the trials to explain are left out of the healthy ones.
        """
        return np.concatenate(self._references) if self._references else None

    @property
    def hardest(self) -> FloatArray | None:
        """The part of ``reference`` of the healthy trial with the largest mean loss."""
        return max(self._references, key=np.mean, default=None)

    @cached_property
    def _references(self) -> list[FloatArray]:
        healthy = self._observed(self.healthy_trials)
        rows = [np.asarray(self.table.losses([INTACT], [part])[0]) for part in healthy]
        return [row for row in rows if len(row)]  # a part before a change may have no piece

    @cached_property
    def has_joints(self) -> bool:
        """Whether the comparator predicts the motion of single joints."""
        return self.table.by_hinge([INTACT], self.trials) is not None

    def of_joint(
        self, joint: str, hypotheses: Sequence[Hypothesis], *, healthy: bool = False
    ) -> FloatArray:
        """Returns the losses of the motion of a joint on the trials to explain, ``(n, pieces)``.

        A loss is the mean over the known hinges of the joint, and NaN where all are unknown, as for
        a hypothesis that detaches the joint. Without healthy trials there are no pieces of them.
        """
        trials = self._observed_comparable if healthy else self.trials
        by_hinge = self.table.by_hinge(hypotheses, trials) if trials else None
        if by_hinge is None:
            return np.empty((len(hypotheses), 0))
        anatomy = self.space.anatomy
        columns = [anatomy.hinges.index(one) for one in anatomy.joint(joint).hinges]
        losses = by_hinge[:, :, columns]
        known = ~np.isnan(losses)
        count = known.sum(axis=2)
        total = np.where(known, losses, 0.0).sum(axis=2)
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)

    @cached_property
    def _observed_comparable(self) -> list[TrialPart]:
        return self._observed(self._comparable)

    def _observed(self, healthy: Sequence[TrialPart]) -> list[TrialPart]:
        """Returns healthy trials without the encoders that are lost in the trials to explain."""
        observed = [part.trial for part in self.trials]
        return [replace(part, trial=observed_as(part.trial, observed)) for part in healthy]


def by_total_loss(hypotheses: Sequence[Hypothesis], losses: LossFunction) -> list[Hypothesis]:
    """Returns hypotheses sorted by the sum of their losses, smallest first; the sort is stable."""
    if not hypotheses:
        return []
    order = np.argsort(losses(hypotheses).sum(axis=1), kind="stable")
    return [hypotheses[i] for i in order]


def observed_jams(trials: Sequence[Trial], anatomy: Anatomy) -> tuple[Fault, ...]:
    """Returns for every joint a jam at the angle at which its encoders end.

    The coarse levels of a jam's angle are tenths of a radian apart. Between two of them, a motor
    without torque predicts a short segment better than the jam: each segment begins at the logged
    angle. The encoder contains the angle, whether the joint is jammed or not.

    There is none of a joint whose encoders are unknown, or whose hinges end at different angles.
    """
    trajectory = trials[-1].trajectory  # a fault may begin during the trials
    medians = median_of_known(trajectory["joint_positions"][round((1 - END) * trajectory.steps) :])
    ends = dict(zip(trajectory.names.hinges, medians, strict=True))
    jams = []
    for name in JAMMED_AT_ANGLE.parts(anatomy):
        joint = anatomy.joint(name)
        angles = [ends[hinge] for hinge in joint.hinges]
        if np.isfinite(angles).all() and np.ptp(angles) <= MAX_JAM_SPREAD:
            lows, highs = zip(*joint.limits, strict=True)
            angle = min(max(round(float(np.mean(angles)), 3) + 0.0, *lows), *highs)
            jams.append(Fault(JAMMED_AT_ANGLE, name, angle))
    return tuple(jams)
