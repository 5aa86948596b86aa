"""Losses of hypotheses on logged trials, by a comparator."""

import sys
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.controllers.playback import Playback
from selfmodel.diagnosis.choice import ComparatorChoice, contract_error, prepared_trial
from selfmodel.diagnosis.comparator import (
    Comparator,
    Losses,
    PiecewiseTrial,
    PreparedPart,
    TrialRefusedError,
    as_comparator,
    piece_steps_of,
    pieces_within,
)
from selfmodel.diagnosis.significance import CONTRADICTION
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.robot.actuators import holding_commands
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.calibration import sensitivity
from selfmodel.simulation.requests import ClosedLoop, Ensemble, Request, Segments
from selfmodel.simulation.rollout import SimulationResult, largest_batch
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial, TrialPart, TrialPlan, whole

Parts = Sequence[Trial | TrialPart]

LossFunction = Callable[[Sequence[Hypothesis]], FloatArray]
"""Returns the losses of some hypotheses, ``(n, pieces)``; inf where a simulation diverged."""

OPENING, MIN_OPENING = 1 / 3, 100
"""Part of a trial that is simulated, from its beginning, if the comparator has no surrogate, and
its shortest length, control steps. The first part discriminates best: later, contact has made any
two simulations differ."""

MANY_TRIALS = 3
"""Trials from which on the surrogate of the surrogate is enough: together they have as many pieces
as one trial by the surrogate."""


class Timeline(NamedTuple):
    """Index of the trial of each piece, and its first and last time, s, ``(pieces,)`` each."""

    trial: IndexArray
    begin: FloatArray
    end: FloatArray


class LimitReachedError(Exception):
    """A comparison would simulate more than a diagnosis may."""


@dataclass(eq=False)
class Account:
    """What the comparisons of a diagnosis have simulated; refits of the self-model are no part.

    Attributes:
        limit: Largest number of control steps; None for any.
        steps: Control steps so far, of all hypotheses, trials and surrogates.
        hypotheses: Distinct hypotheses so far.
    """

    limit: int | None = None
    steps: int = 0
    hypotheses: set[Hypothesis] = field(default_factory=set)

    @property
    def left(self) -> int:
        """Control steps that may still be simulated."""
        return sys.maxsize if self.limit is None else max(self.limit - self.steps, 0)


class LossTable:
    """Losses of hypotheses on trials, by the content of the trial and the hypothesis.

    A trial is prepared once, and a hypothesis is simulated once for each trial, or each section of
    a long one: the total, the parts of signals and the losses of hinges are of one simulation. They
    are independent of the hypotheses computed before. Of a part of a trial, the sections that have
    a piece in it are simulated.
    """

    def __init__(
        self, simulator: Simulator, comparator: Comparator, account: Account | None = None
    ) -> None:
        self._simulator, self.account = simulator, account or Account()
        self._comparator = as_comparator(comparator, getattr(comparator, "name", repr(comparator)))
        self._prepared: dict[Hashable, PreparedPart] = {}
        self._known: dict[tuple[Hashable, int, Hypothesis], Losses] = {}
        self._sensitivity: dict[Hashable, float] = {}

    def of_robot(self, robot: Robot) -> "LossTable":
        """Returns an empty table of the same comparator, with another self-model."""
        simulator = Simulator(robot, self._simulator.threads)
        return LossTable(simulator, self._comparator, self.account)

    def is_piecewise(self, trials: Sequence[Trial]) -> bool:
        """Returns whether a distance is a mean of several losses; of short trials it may be one."""
        return any(self._pieces(trial) > 1 for trial in trials)

    def _pieces(self, trial: Trial) -> int:
        steps = piece_steps_of(self._of(trial))
        return self.losses([INTACT], [trial]).shape[1] if steps is None else len(steps)

    def known(self, trials: Parts) -> list[Hypothesis]:
        """Returns the hypotheses whose losses on all trials are known."""
        sections = [
            (part.trial.content, number)
            for part in map(whole, trials)
            for number in range(len(getattr(self._of(part.trial), "sections", ())) or 1)
        ]
        first = [one for *key, one in self._known if tuple(key) == sections[0]]
        return [one for one in first if all((*key, one) in self._known for key in sections)]

    def uses_segments(self, trials: Sequence[Trial]) -> bool:
        """Returns whether the comparator compares short predictions on all trials."""
        return all(isinstance(self._of(trial).request, Segments) for trial in trials)

    def has_sections(self, trials: Sequence[Trial]) -> bool:
        """Returns whether a trial is so long that parts of it are simulated alone."""
        return any(len(getattr(self._of(trial), "sections", ())) > 0 for trial in trials)

    def distances(self, hypotheses: Sequence[Hypothesis], trials: Parts) -> FloatArray:
        """Returns the sum over the trials of the mean loss of each hypothesis, ``(n,)``.

        It is infinite for a hypothesis whose simulation diverges.
        """
        total = np.zeros(len(hypotheses))
        for part in trials:
            losses = self.losses(hypotheses, [part])
            # A change near the end of a trial leaves no piece of it.
            total += losses.mean(axis=1) if losses.shape[1] else 0.0
        return total

    def sensitivity(self, parts: Sequence[TrialPart], hypothesis: Hypothesis = INTACT) -> float:
        """Returns how sensitive predictions of trials are to errors of the state, on average.

        Of the faults, those that edit the specification are left out; so are trials that are too
        short. 0 if all are. The account does not count these simulations.
        """
        robot, threads, known = self._simulator.robot, self._simulator.threads, self._sensitivity
        faults = Hypothesis(tuple(hypothesis.lacking(hypothesis.spec_part)))
        trials = [rows for rows in (part.rows for part in parts) if rows.trajectory.steps]
        for trial in trials:
            if (trial.content, faults) not in known:
                known[trial.content, faults] = 0.0
                with suppress(InputError):
                    known[trial.content, faults] = sensitivity(robot, trial, faults, threads)
        found = [known[trial.content, faults] for trial in trials]
        return float(np.mean([one for one in found if one] or 0.0))

    def losses(self, hypotheses: Sequence[Hypothesis], trials: Parts) -> FloatArray:
        """Returns the losses of each hypothesis on all trials, ``(n, pieces)``.

        A comparator without losses has one column per trial: the distance.
        """
        rows_of = self._rows_of(hypotheses, trials)
        return np.concatenate(
            [np.array([row.total[pieces] for row in rows]) for rows, pieces in rows_of], axis=1
        )

    def compared(self, hypotheses: Sequence[Hypothesis], trials: Parts) -> FloatArray:
        """Returns the losses by which hypotheses are compared, ``(n, pieces)``.

        Of a comparator with one distance per trial, it is their sum, one piece.
        """
        losses = self.losses(hypotheses, trials)
        is_piecewise = self.is_piecewise([whole(one).trial for one in trials])
        return losses if is_piecewise else losses.sum(axis=1, keepdims=True)

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
            prepared, time = self._of(part.trial), part.trial.trajectory.time
            if (steps := piece_steps_of(prepared)) is None:
                return None
            times.append(time[steps][pieces_within(part, prepared)])
        begin, end = np.concatenate(times).T
        return Timeline(np.repeat(np.arange(len(times)), [*map(len, times)]), begin, end)

    def surrogate(self, trials: Sequence[Trial]) -> tuple["LossTable", Sequence[Trial]]:
        """Returns a table and trials that cost less and rank hypotheses about as these trials do.

        A comparator with one distance per trial is its own surrogate: that of a part of a trial
        is another quantity. Otherwise it is the comparator's own
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
            if table is not None and table._accepts(trials):  # noqa: SLF001
                return table, trials
        return self, trials

    @cached_property
    def _cheaper(self) -> "LossTable | None":
        surrogate = getattr(self._comparator, "surrogate", None)
        return None if surrogate is None else LossTable(self._simulator, surrogate, self.account)

    def _opening(self, trial: Trial) -> Trial:
        """The first part of a trial, or the whole trial if the comparator refuses the part."""
        whole_steps = trial.trajectory.steps
        steps = max(round(OPENING * whole_steps), min(MIN_OPENING, whole_steps))
        opening = replace(trial, trajectory=trial.trajectory.first(steps))
        return opening if self._accepts([opening]) else trial

    def _accepts(self, trials: Sequence[Trial]) -> bool:
        try:
            for trial in trials:
                self._of(trial)
        except InputError:
            return False
        return True

    def _of(self, trial: Trial) -> PreparedPart:
        if trial.content not in self._prepared:
            prepared = prepared_trial(self._comparator, self._simulator.robot, trial)
            self._prepared[trial.content] = prepared
        return self._prepared[trial.content]

    def _rows_of(
        self, hypotheses: Sequence[Hypothesis], trials: Parts
    ) -> Iterator[tuple[list[Losses], BoolArray | slice]]:
        """Returns for each section the losses of each hypothesis, and the pieces that count."""
        for part in map(whole, trials):
            prepared = self._of(part.trial)
            sections = [*enumerate(getattr(prepared, "sections", ()) or [prepared])]
            masks = [pieces_within(part, own) for _, own in sections]
            used = [k for k, mask in enumerate(masks) if isinstance(mask, slice) or mask.any()]
            for k in used or [len(sections) - 1]:
                yield self._rows(hypotheses, part.trial, *sections[k]), masks[k]

    def _rows(
        self, hypotheses: Sequence[Hypothesis], trial: Trial, number: int, section: PreparedPart
    ) -> list[Losses]:
        known, key = self._known, (trial.content, number)
        missing = list(dict.fromkeys(one for one in hypotheses if (*key, one) not in known))
        account, stats = self.account, self._simulator.stats
        afforded = account.left // steps_of(section.request, trial)
        possible = missing[: min(afforded, len(missing))]
        robot, steps = self._simulator.robot, trial.trajectory.steps
        size = largest_batch(robot, section.request, steps) if possible else 1  # reads files
        for first in range(0, len(possible), size):
            batch, before = possible[first : first + size], stats.steps
            losses = self._simulated(batch, trial, section)
            known.update(((*key, one), losses[row]) for row, one in enumerate(batch))
            account.steps += stats.steps - before
            account.hypotheses.update(batch)
        if len(possible) < len(missing):
            raise LimitReachedError
        return [known[*key, one] for one in hypotheses]

    def _simulated(
        self, hypotheses: Sequence[Hypothesis], trial: Trial, prepared: PreparedPart
    ) -> Losses:
        """Returns the checked losses of simulations; infinite where one diverged."""
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
        if (piece_steps := piece_steps_of(prepared)) is not None:
            total = total + contradiction_losses(hypotheses, trial.trajectory, piece_steps)
        if by_hinge is not None:
            by_hinge = np.where(diverged[:, np.newaxis], np.inf, by_hinge)
        return Losses(np.where(diverged, np.inf, total), losses.by_signal, by_hinge)


def steps_of(request: Request, trial: Trial) -> int:
    """Returns the control steps of one hypothesis in the simulation that a comparison requires."""
    match request:
        case ClosedLoop():
            return trial.trajectory.steps
        case Segments():
            return len(request.starts) * request.horizon
        case Ensemble():
            return request.members * trial.trajectory.steps


def check_limit(limit: int | None, choose: ComparatorChoice, trial: Trial, robot: Robot) -> None:
    """Raises ``InputError`` if a limit does not allow for one hypothesis of one trial.

    Args:
        limit: Control steps that a diagnosis may simulate for each trial; None for any number.
        choose: Chooses the comparator; one that refuses the trial is not judged.
        trial: A trial as long as those to diagnose.
        robot: The self-model.
    """
    try:
        comparator = choose(robot, [trial]).comparator
        prepared = prepared_trial(comparator, robot, trial)
    except InputError:
        return
    sections = getattr(prepared, "sections", ()) or [prepared]
    needed = sum(steps_of(section.request, trial) for section in sections)
    if limit is not None and limit < needed:
        raise InputError(
            f"expected max_simulated_steps of {needed} or above, as {comparator.name} simulates "
            f"for one hypothesis in each trial, got {limit}: give more, or another comparator"
        )


def check_steps(comparator: Comparator, trial: Trial, robot: Robot) -> None:
    """Raises ``InputError`` if a comparator refuses a still trial, and not one of usual length."""
    try:
        prepared_trial(comparator, robot, trial)
    except TrialRefusedError as error:
        with suppress(TrialRefusedError):
            prepared_trial(comparator, robot, still_trial(robot, Settings.steps))
            raise InputError(f"{error.reason}: give more steps, or another comparator") from error


def still_trial(robot: Robot, steps: int) -> Trial:
    """Returns a simulated trial of a healthy robot whose motors hold their initial pose."""
    names, hold = robot.anatomy.names, holding_commands(robot.model)[np.newaxis]
    driver = Playback(names.motors, hold)
    run = Simulator(robot, threads=1).run([(INTACT, driver)], steps, SIGNALS).trajectory
    signals = {name: values[0] for name, values in run.signals.items()}
    trajectory, path = Trajectory(names, run.time, signals), f"a trial of {steps} steps"
    return Trial(TrialPlan("still", "single", driver, steps, 0), robot.name, trajectory, path)


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


def by_total_loss(hypotheses: Sequence[Hypothesis], losses: LossFunction) -> list[Hypothesis]:
    """Returns hypotheses sorted by the sum of their losses, smallest first; the sort is stable."""
    if not hypotheses:
        return []
    order = np.argsort(losses(hypotheses).sum(axis=1), kind="stable")
    return [hypotheses[i] for i in order]
