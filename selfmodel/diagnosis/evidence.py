"""Losses of hypotheses on logged trials, each simulated once, and once more for those of hinges."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Literal

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.controllers.controller import CommandSource
from selfmodel.diagnosis.comparator import (
    Comparator,
    HingewiseTrial,
    LocatedTrial,
    PiecewiseTrial,
    PreparedTrial,
    TimedTrial,
    as_comparator,
)
from selfmodel.diagnosis.preparation import contract_error, prepared_trial
from selfmodel.diagnosis.search.search_cost import steps_of
from selfmodel.diagnosis.verdicts.change_point import Timeline
from selfmodel.diagnosis.verdicts.contradiction import contradiction_losses
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.simulation.batch_memory import largest_batch
from selfmodel.simulation.cache import Cache
from selfmodel.simulation.outcome import SimulationResult
from selfmodel.simulation.requests import ClosedLoop, Ensemble, Request, Segments
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.trial import Trial, TrialPart, whole

TrialContent = tuple[str, CommandSource]
"""See ``Trial.content``."""


class Evidence:
    """Losses of hypotheses on logged trials, cached by trial and hypothesis.

    Trials are prepared once. Losses are independent of the hypotheses computed before.

    Args:
        simulator: The self-model.
        comparator: The distance between a simulation and a trial.

    Raises:
        InputError: The object is no comparator.
    """

    def __init__(self, simulator: Simulator, comparator: Comparator) -> None:
        self._simulator = simulator
        self._comparator = as_comparator(comparator, getattr(comparator, "name", repr(comparator)))
        self._prepared: dict[TrialContent, PreparedTrial] = {}
        self._losses: dict[TrialContent, Cache[Hypothesis]] = {}
        self._hinge_losses: dict[TrialContent, Cache[Hypothesis]] = {}

    def is_piecewise(self, trials: Sequence[Trial]) -> bool:
        """Returns whether the distances are means of losses, so that paired tests are possible.

        Raises:
            InputError: The comparator cannot judge one of the trials.
        """
        return all(isinstance(self._prepare(trial), PiecewiseTrial) for trial in trials)

    def uses_segments(self, trials: Sequence[Trial]) -> bool:
        """Returns whether the comparator judges all trials by short predictions.

        Raises:
            InputError: The comparator cannot judge one of the trials.
        """
        return all(isinstance(self._prepare(trial).request, Segments) for trial in trials)

    def predicts_hinges(self, trials: Sequence[Trial]) -> bool:
        """Returns whether the comparator predicts the motion of single hinges in all trials.

        Raises:
            InputError: The comparator cannot judge one of the trials.
        """
        return all(isinstance(self._prepare(trial), HingewiseTrial) for trial in trials)

    def check(self, trials: Sequence[Trial]) -> None:
        """Checks that the comparator can judge all trials, before any search.

        Raises:
            InputError: The comparator cannot judge some trials; the message contains the reason for
                each.
        """
        problems = []
        for trial in trials:
            try:
                self._prepare(trial)
            except InputError as error:
                problems.append(str(error))
        if problems:
            raise InputError("; ".join(problems))

    def steps_per_hypothesis(self, trials: Sequence[Trial]) -> int:
        """Returns the control steps that a comparison of one hypothesis with all trials simulates.

        Raises:
            InputError: The comparator cannot judge one of the trials.
        """
        return sum(steps_of(self._prepare(one).request, one.behaviour.steps) for one in trials)

    def distances(
        self, hypotheses: Sequence[Hypothesis], trials: Sequence[Trial | TrialPart]
    ) -> FloatArray:
        """Returns the distance of each hypothesis from all trials together, ``(n,)``.

        The distance is the sum of the comparator's distances, and infinite for a hypothesis whose
        simulation diverges.
        """
        total = np.zeros(len(hypotheses))
        for trial in trials:
            # A change near the end of a trial leaves no piece of it.
            rows = self._part_rows(hypotheses, trial)
            total += np.array([row.mean() if len(row) else 0.0 for row in rows])
        return total

    def losses(
        self, hypotheses: Sequence[Hypothesis], trials: Sequence[Trial | TrialPart]
    ) -> FloatArray:
        """Returns the losses of each hypothesis on all trials, ``(n, pieces)``.

        A comparator without losses has one column per trial: the distance.
        """
        rows = [np.array(self._part_rows(hypotheses, trial)) for trial in trials]
        return np.concatenate(rows, axis=1)

    def timeline(self, trials: Sequence[Trial | TrialPart]) -> Timeline | None:
        """Returns the times of the columns of ``losses``; None if the comparator has no times.

        Raises:
            InputError: The comparator cannot judge one of the trials.
        """
        times = []
        for part in map(whole, trials):
            prepared = self._prepare(part.trial)
            if not isinstance(prepared, TimedTrial):
                return None
            times.append(part.trial.behaviour.time[prepared.piece_steps][self._pieces(part)])
        return Timeline(
            trial=np.repeat(np.arange(len(times)), [len(one) for one in times]),
            begin=np.concatenate([one[:, 0] for one in times]),
            end=np.concatenate([one[:, 1] for one in times]),
        )

    def losses_by_signal(
        self, hypothesis: Hypothesis, trials: Sequence[Trial | TrialPart]
    ) -> Mapping[str, float]:
        """Returns the part of each signal in the mean loss of a hypothesis.

        The result is empty for a comparator whose losses are no sums over signals, and for a
        hypothesis whose simulation diverges.
        """
        parts = self.pieces_by_signal(hypothesis, trials)
        return {signal: float(losses.mean()) for signal, losses in parts.items()}

    def pieces_by_signal(
        self, hypothesis: Hypothesis, trials: Sequence[Trial | TrialPart]
    ) -> Mapping[str, FloatArray]:
        """Returns the part of each signal in each loss of a hypothesis, ``(pieces,)`` each.

        The result is empty in the cases of ``losses_by_signal``.
        """
        found: dict[str, list[FloatArray]] = {}
        for part in map(whole, trials):
            prepared = self._prepare(part.trial)
            if not isinstance(prepared, LocatedTrial):
                return {}
            result = simulate(self._simulator, prepared.request, part.trial, [hypothesis])
            if result.diverged.any():
                return {}
            kept = self._pieces(part)
            for signal, losses in prepared.losses_by_signal(result.behaviour).items():
                found.setdefault(signal, []).append(losses[0, kept])
        return {signal: np.concatenate(each) for signal, each in found.items()}

    def losses_by_hinge(
        self, hypotheses: Sequence[Hypothesis], trials: Sequence[Trial | TrialPart]
    ) -> FloatArray:
        """Returns the losses of each hinge on its own, ``(n, pieces, hinges)``.

        The simulations are those of ``losses``. A loss is infinite where one diverges, and NaN
        where the log contains no evidence on a hinge, or the hypothesis detaches it.

        Raises:
            InputError: The comparator cannot judge a trial, or does not predict single hinges; see
                ``predicts_hinges``.
        """
        found = []
        for part in map(whole, trials):
            cache = self._hinge_losses.setdefault(part.trial.content, Cache())
            compute = partial(self._compute_by_hinge, part.trial)
            rows = np.array(cache.get_or_compute(hypotheses, compute))
            found.append(rows[:, self._pieces(part)])
        return np.concatenate(found, axis=1)

    def _prepare(self, trial: Trial) -> PreparedTrial:
        key = trial.content
        if key not in self._prepared:
            self._prepared[key] = prepared_trial(self._comparator, self._simulator.robot, trial)
        return self._prepared[key]

    def _part_rows(
        self, hypotheses: Sequence[Hypothesis], trial: Trial | TrialPart
    ) -> list[FloatArray]:
        part = whole(trial)
        rows = self._rows(hypotheses, part.trial)
        if part.is_whole:
            return rows
        kept = self._pieces(part)
        return [row[kept] for row in rows]

    def _pieces(self, part: TrialPart) -> BoolArray | slice:
        """Returns the columns of the losses of a trial that lie within a part of it."""
        prepared = self._prepare(part.trial)
        if part.is_whole or not isinstance(prepared, TimedTrial):
            return slice(None)
        times = part.trial.behaviour.time[prepared.piece_steps]
        return np.asarray((times[:, 0] >= part.begin) & (times[:, 1] <= part.end))

    def _rows(self, hypotheses: Sequence[Hypothesis], trial: Trial) -> list[FloatArray]:
        cache = self._losses.setdefault(trial.content, Cache())
        return cache.get_or_compute(hypotheses, partial(self._compute, trial))

    def _compute(self, trial: Trial, hypotheses: list[Hypothesis]) -> FloatArray:
        prepared = self._prepare(trial)
        rows = []
        for batch in self._batches(prepared, trial, hypotheses):
            result = simulate(self._simulator, prepared.request, trial, batch)
            rows.append(self._losses_of(prepared, trial, batch, result))
        return np.concatenate(rows)

    def _compute_by_hinge(self, trial: Trial, hypotheses: list[Hypothesis]) -> FloatArray:
        prepared = self._prepare(trial)
        if not isinstance(prepared, HingewiseTrial):
            raise contract_error(self._comparator, "does not predict single hinges")
        rows = []
        for batch in self._batches(prepared, trial, hypotheses):
            result = simulate(self._simulator, prepared.request, trial, batch)
            rows.append(self._hinge_losses_of(prepared, trial, batch, result))
            # The same simulations have the losses that are asked for next.
            losses = self._losses_of(prepared, trial, batch, result)
            total = dict(zip(batch, losses, strict=True))
            cache = self._losses.setdefault(trial.content, Cache())
            cache.get_or_compute(batch, partial(_rows_of, total))
        return np.concatenate(rows)

    def _hinge_losses_of(
        self,
        prepared: HingewiseTrial,
        trial: Trial,
        hypotheses: list[Hypothesis],
        result: SimulationResult,
    ) -> FloatArray:
        with _diverging(result.diverged):
            losses = np.asarray(prepared.losses_by_hinge(result.behaviour))
        hinges = trial.behaviour.names.hinges
        if losses.ndim != 3 or losses.shape[::2] != (len(hypotheses), len(hinges)):
            raise contract_error(
                self._comparator,
                f"returned losses {losses.shape} of {len(hinges)} hinges for {len(hypotheses)} "
                f"simulations",
            )
        detached = [self._simulator.detached_hinges(hypothesis) for hypothesis in hypotheses]
        unknown = np.array([[hinge in one for hinge in hinges] for one in detached])
        diverged = result.diverged[:, np.newaxis, np.newaxis]
        return np.where(diverged, np.inf, np.where(unknown[:, np.newaxis], np.nan, losses))

    def _batches(
        self, prepared: PreparedTrial, trial: Trial, hypotheses: Sequence[Hypothesis]
    ) -> list[list[Hypothesis]]:
        """Returns the hypotheses in batches that the memory allows."""
        simulator = self._simulator
        size = largest_batch(simulator.robot, prepared.request, trial.behaviour.steps)
        listed = list(hypotheses)
        return [listed[first : first + size] for first in range(0, len(listed), size)]

    def _losses_of(
        self,
        prepared: PreparedTrial,
        trial: Trial,
        hypotheses: list[Hypothesis],
        result: SimulationResult,
    ) -> FloatArray:
        diverged = result.diverged[:, np.newaxis]
        with _diverging(result.diverged):
            losses = self._compare(prepared, result.behaviour, len(diverged))
        wrong = losses[~((losses >= 0) | diverged)]
        if len(wrong):
            raise contract_error(
                self._comparator,
                f"returned a distance that is not a number of at least 0: {wrong[0]}",
            )
        if isinstance(prepared, TimedTrial):
            losses = losses + contradiction_losses(
                hypotheses, trial.behaviour, prepared.piece_steps
            )
        return np.where(diverged, np.inf, losses)

    def _compare(self, prepared: PreparedTrial, simulated: Behaviour, count: int) -> FloatArray:
        if isinstance(prepared, PiecewiseTrial):
            losses = np.asarray(prepared.losses(simulated))
            if losses.ndim != 2 or len(losses) != count or not losses.shape[1]:
                raise contract_error(
                    self._comparator, f"returned losses {losses.shape} for {count} simulations"
                )
            return losses
        distances = np.asarray(prepared.distances(simulated))
        if distances.shape != (count,):
            raise contract_error(
                self._comparator, f"returned {distances.shape} distances for {count} simulations"
            )
        return np.asarray(distances[:, np.newaxis])


def _rows_of(rows: Mapping[Hypothesis, FloatArray], hypotheses: list[Hypothesis]) -> FloatArray:
    return np.array([rows[hypothesis] for hypothesis in hypotheses])


def _diverging(diverged: BoolArray) -> np.errstate:
    """Returns a context without warnings of the losses of diverged simulations.

    These losses are replaced afterwards.
    """
    warnings: Literal["ignore"] | None = "ignore" if diverged.any() else None
    return np.errstate(over=warnings, invalid=warnings, divide=warnings)


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
