"""Losses of hypotheses on logged trials: each hypothesis is simulated once for each trial."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.diagnosis.choice import contract_error, prepared_trial
from selfmodel.diagnosis.comparator import (
    Comparator,
    ComparatorWithSurrogate,
    Losses,
    PiecewiseTrial,
    PreparedTrial,
    TimedTrial,
    as_comparator,
)
from selfmodel.diagnosis.significance import CONTRADICTION
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.simulation.requests import ClosedLoop, Ensemble, Request, Segments
from selfmodel.simulation.rollout import SimulationResult, largest_batch
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.trial import Trial, TrialPart, whole

OPENING = 1 / 3
"""Part of a trial that is simulated, from its beginning, if the comparator has no surrogate.

The first part discriminates best: later, contact has made any two simulations differ."""

MIN_OPENING = 100
"""Control steps of the shortest opening; a shorter trial is simulated whole."""

SURROGATES, MANY_TRIALS = 2, 3
"""Surrogates, each of the one before, and trials from which on the last one is used."""


@dataclass(frozen=True, eq=False)
class Timeline:
    """Times of the pieces of some trials, in the order of the trials.

    Attributes:
        trial: Index of the trial of each piece, ``(pieces,)``.
        begin: First time of each piece, s since the start of its trial, ``(pieces,)``.
        end: Last time of each piece, likewise.
    """

    trial: IndexArray
    begin: FloatArray
    end: FloatArray


@dataclass(eq=False)
class _Column:
    """A prepared trial, and the losses of the hypotheses that were simulated, each without axis."""

    prepared: PreparedTrial | PiecewiseTrial
    known: dict[Hypothesis, Losses] = field(default_factory=dict)


class LossTable:
    """Losses of hypotheses on trials, by the content of the trial and the hypothesis.

    A trial is prepared once, and a hypothesis is simulated once for each trial. Losses are
    independent of the hypotheses computed before.

    Args:
        simulator: The self-model.
        comparator: The distance between a simulation and a trial.

    Raises:
        InputError: The object is no comparator.
    """

    def __init__(self, simulator: Simulator, comparator: Comparator) -> None:
        self._simulator = simulator
        self._comparator = as_comparator(comparator, getattr(comparator, "name", repr(comparator)))
        self._columns: dict[Hashable, _Column] = {}

    def check(self, trials: Sequence[Trial]) -> None:
        """Checks that the comparator can judge all trials, before any search.

        Raises:
            InputError: The comparator cannot judge some trials; the message contains the reason for
                each.
        """
        problems = []
        for trial in trials:
            try:
                self._column(trial)
            except InputError as error:
                problems.append(str(error))
        if problems:
            raise InputError("; ".join(problems))

    def is_piecewise(self, trials: Sequence[Trial]) -> bool:
        """Returns whether the distances are means of losses, so that paired tests are possible.

        Raises:
            InputError: The comparator cannot judge one of the trials.
        """
        return all(isinstance(self._column(trial).prepared, PiecewiseTrial) for trial in trials)

    def uses_segments(self, trials: Sequence[Trial]) -> bool:
        """Returns whether the comparator judges all trials by short predictions.

        Raises:
            InputError: The comparator cannot judge one of the trials.
        """
        return all(isinstance(self._column(trial).prepared.request, Segments) for trial in trials)

    def distances(
        self, hypotheses: Sequence[Hypothesis], trials: Sequence[Trial | TrialPart]
    ) -> FloatArray:
        """Returns the distance of each hypothesis from all trials together, ``(n,)``.

        The distance is the sum over the trials of the mean loss, and infinite for a hypothesis
        whose simulation diverges.
        """
        total = np.zeros(len(hypotheses))
        for part in map(whole, trials):
            kept = self._pieces(part)
            rows = [one.total[kept] for one in self._rows(hypotheses, part.trial)]
            # A change near the end of a trial leaves no piece of it.
            total += np.array([row.mean() if len(row) else 0.0 for row in rows])
        return total

    def losses(
        self, hypotheses: Sequence[Hypothesis], trials: Sequence[Trial | TrialPart]
    ) -> FloatArray:
        """Returns the losses of each hypothesis on all trials, ``(n, pieces)``.

        A comparator without losses has one column per trial: the distance.
        """
        parts = []
        for part in map(whole, trials):
            kept = self._pieces(part)
            parts.append(np.array([one.total[kept] for one in self._rows(hypotheses, part.trial)]))
        return np.concatenate(parts, axis=1)

    def by_signal(
        self, hypothesis: Hypothesis, trials: Sequence[Trial | TrialPart]
    ) -> Mapping[str, FloatArray]:
        """Returns the part of each signal in each loss of a hypothesis, ``(pieces,)`` each.

        The result is empty for a comparator whose losses are no sums over signals, and for a
        hypothesis whose simulation diverges.
        """
        found: dict[str, list[FloatArray]] = {}
        for part in map(whole, trials):
            (row,) = self._rows([hypothesis], part.trial)
            if not row.by_signal or not np.isfinite(row.total).all():
                return {}
            kept = self._pieces(part)
            for signal, losses in row.by_signal.items():
                found.setdefault(signal, []).append(losses[kept])
        return {signal: np.concatenate(each) for signal, each in found.items()}

    def by_hinge(
        self, hypotheses: Sequence[Hypothesis], trials: Sequence[Trial | TrialPart]
    ) -> FloatArray | None:
        """Returns the losses of each hinge on its own, ``(n, pieces, hinges)``.

        A loss is infinite where a simulation diverges, and NaN without evidence on the hinge. The
        result is None for a comparator that predicts no single hinges.
        """
        found = []
        for part in map(whole, trials):
            rows = [one.by_hinge for one in self._rows(hypotheses, part.trial)]
            known = [row for row in rows if row is not None]
            if len(known) < len(rows):
                return None
            found.append(np.array(known)[:, self._pieces(part)])
        return np.concatenate(found, axis=1)

    def timeline(self, trials: Sequence[Trial | TrialPart]) -> Timeline | None:
        """Returns the times of the columns of ``losses``; None if the comparator has no times.

        Raises:
            InputError: The comparator cannot judge one of the trials.
        """
        times = []
        for part in map(whole, trials):
            prepared = self._column(part.trial).prepared
            if not isinstance(prepared, TimedTrial):
                return None
            times.append(part.trial.behaviour.time[prepared.piece_steps][self._pieces(part)])
        return Timeline(
            trial=np.repeat(np.arange(len(times)), [len(one) for one in times]),
            begin=np.concatenate([one[:, 0] for one in times]),
            end=np.concatenate([one[:, 1] for one in times]),
        )

    @cached_property
    def cheaper(self) -> tuple["LossTable", ...]:
        """Tables of the comparator's surrogate and of that one's surrogate, as far as they are."""
        found: list[LossTable] = []
        current = self._comparator
        while len(found) < SURROGATES and isinstance(current, ComparatorWithSurrogate):
            current = current.surrogate
            found.append(LossTable(self._simulator, current))
        return tuple(found)

    def surrogate(self, trials: Sequence[Trial]) -> tuple["LossTable", Sequence[Trial]]:
        """Returns a table and trials that cost less and rank hypotheses about as these trials do.

        A comparator without losses is its own surrogate: its hypotheses are not refined, so its
        distances from the whole trials make the ranking. Otherwise it is the comparator's own
        surrogate, or the comparator on the openings of the trials. Of ``MANY_TRIALS`` or more, the
        surrogate of the surrogate is enough: together they have as many pieces as one. A surrogate
        that cannot judge a trial, such as one with many late steps, is left out.

        Args:
            trials: Trials that the comparator can judge.
        """
        if not self.is_piecewise(trials):
            return self, trials
        for cheaper in reversed(self.cheaper if len(trials) >= MANY_TRIALS else self.cheaper[:1]):
            if cheaper.accepts(trials):
                return cheaper, trials
        return self, trials if self.cheaper else [self._opening(trial) for trial in trials]

    def _opening(self, trial: Trial) -> Trial:
        """The first part of a trial, or the whole trial if the comparator cannot judge the part."""
        steps = max(round(OPENING * trial.behaviour.steps), min(MIN_OPENING, trial.behaviour.steps))
        opening = replace(trial, behaviour=trial.behaviour.first(steps))
        return opening if self.accepts([opening]) else trial

    def accepts(self, trials: Sequence[Trial]) -> bool:
        """Returns whether the comparator can judge all trials; see ``check``."""
        try:
            self.check(trials)
        except InputError:
            return False
        return True

    def _column(self, trial: Trial) -> _Column:
        if trial.content not in self._columns:
            prepared = prepared_trial(self._comparator, self._simulator.robot, trial)
            self._columns[trial.content] = _Column(prepared)
        return self._columns[trial.content]

    def _pieces(self, part: TrialPart) -> BoolArray | slice:
        """Returns the pieces of the losses of a trial that lie within a part of it."""
        prepared = self._column(part.trial).prepared
        if part.is_whole or not isinstance(prepared, TimedTrial):
            return slice(None)
        times = part.trial.behaviour.time[prepared.piece_steps]
        return np.asarray((times[:, 0] >= part.begin) & (times[:, 1] <= part.end))

    def _rows(self, hypotheses: Sequence[Hypothesis], trial: Trial) -> list[Losses]:
        column = self._column(trial)
        missing = list(dict.fromkeys(one for one in hypotheses if one not in column.known))
        request, simulator = column.prepared.request, self._simulator
        size = largest_batch(simulator.robot, request, trial.behaviour.steps)
        for first in range(0, len(missing), size):
            batch = missing[first : first + size]
            result = simulate(simulator, request, trial, batch)
            found = self._losses_of(column.prepared, trial, batch, result)
            for row, hypothesis in enumerate(batch):
                column.known[hypothesis] = Losses(
                    found.total[row],
                    {signal: losses[row] for signal, losses in found.by_signal.items()},
                    None if found.by_hinge is None else found.by_hinge[row],
                )
        return [column.known[one] for one in hypotheses]

    def _losses_of(
        self,
        prepared: PreparedTrial | PiecewiseTrial,
        trial: Trial,
        hypotheses: Sequence[Hypothesis],
        result: SimulationResult,
    ) -> Losses:
        """Returns the checked losses of simulations; infinite where one diverged."""
        diverged = result.diverged[:, np.newaxis]
        warnings: Literal["ignore"] | None = "ignore" if diverged.any() else None
        with np.errstate(over=warnings, invalid=warnings, divide=warnings):
            found = _compared(prepared, result.behaviour)
        total, count = found.total, len(hypotheses)
        if total.ndim != 2 or len(total) != count or not total.shape[1]:
            raise contract_error(
                self._comparator, f"returned losses {total.shape} for {count} simulations"
            )
        wrong = total[~((total >= 0) | diverged)]
        if len(wrong):
            raise contract_error(
                self._comparator,
                f"returned a distance that is not a number of at least 0: {wrong[0]}",
            )
        if isinstance(prepared, TimedTrial):
            total = total + contradiction_losses(hypotheses, trial.behaviour, prepared.piece_steps)
        total = np.where(diverged, np.inf, total)
        if found.by_hinge is None:
            return replace(found, total=total)
        expected = (*total.shape, len(trial.behaviour.names.hinges))
        if found.by_hinge.shape != expected:
            raise contract_error(
                self._comparator,
                f"returned losses of hinges {found.by_hinge.shape} in place of {expected}",
            )
        by_hinge = np.where(diverged[:, np.newaxis], np.inf, found.by_hinge)
        return Losses(total, found.by_signal, by_hinge)


def simulate(
    simulator: Simulator, request: Request, trial: Trial, hypotheses: Sequence[Hypothesis]
) -> SimulationResult:
    """Runs the simulation that a comparison with a trial requires.

    Args:
        simulator: The self-model.
        request: The request of the prepared trial.
        trial: The trial that was prepared.
        hypotheses: At least one; each is a row of the signals.
    """
    driver, steps = trial.plan.controller, trial.behaviour.steps
    match request:
        case ClosedLoop():
            runs = [(hypothesis, driver) for hypothesis in hypotheses]
            return simulator.run(runs, steps, request.record)
        case Segments():
            return simulator.predict(hypotheses, request, trial.behaviour)
        case Ensemble():
            return simulator.run_ensemble(hypotheses, driver, steps, request)


def _compared(prepared: PreparedTrial | PiecewiseTrial, simulated: Behaviour) -> Losses:
    if isinstance(prepared, PiecewiseTrial):
        found = prepared.losses(simulated)
        return found if isinstance(found, Losses) else Losses(np.asarray(found))
    return Losses(np.asarray(prepared.distances(simulated))[..., np.newaxis])


def contradiction_losses(
    hypotheses: Sequence[Hypothesis], behaviour: Behaviour, piece_steps: IndexArray
) -> FloatArray:
    """Returns the loss of each hypothesis in the pieces in which the log itself contradicts it.

    A sensor whose reading changes has not failed. The loss of a comparator contains this only in
    part: a model that predicts far too much contact at a foot is nearer to a sensor that never
    reads contact than to one that seldom does.

    Args:
        hypotheses: Hypotheses about the trial.
        behaviour: The logged behaviour.
        piece_steps: First and last control step of each piece, ``(pieces, 2)``.

    Returns:
        ``(n, pieces)``.
    """
    losses = np.zeros((len(hypotheses), len(piece_steps)))
    for row, hypothesis in zip(losses, hypotheses, strict=True):
        for fault in hypothesis.faults:
            steps = np.append(0, np.cumsum(fault.kind.contradicted(fault, behaviour)))
            is_contradicted = steps[piece_steps[:, 1] + 1] > steps[piece_steps[:, 0]]
            row[is_contradicted] += CONTRADICTION
    return losses
