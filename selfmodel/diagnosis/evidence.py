"""How badly hypotheses predict logged trials: simulated once, remembered."""

from collections.abc import Sequence
from functools import partial
from typing import Literal

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis.comparator import Comparator, Piecewise
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.simulation.cache import Cache
from selfmodel.simulation.outcome import SimulationResult
from selfmodel.simulation.requests import ClosedLoop, Ensemble, Request, Segments, recordable
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.trial import Trial


class Evidence:
    """What a comparator makes of logged trials; it remembers every hypothesis.

    Args:
        simulator: The self-model.
        comparator: Says what to simulate and how far it is from a trial.
        beside: Evidence of the same two, whose rows are taken and never added to; see ``aside``.
    """

    def __init__(
        self, simulator: Simulator, comparator: Comparator, *, beside: "Evidence | None" = None
    ) -> None:
        self._simulator = simulator
        self._comparator = comparator
        self._beside = beside
        self._losses: dict[str, Cache[Hypothesis]] = {}  # by the trial's log

    def aside(self) -> "Evidence":
        """Returns evidence that remembers apart, and simulates nothing that this one knows."""
        return Evidence(self._simulator, self._comparator, beside=self)

    @property
    def is_piecewise(self) -> bool:
        """Whether the comparator judges in pieces, so that two hypotheses can be tested."""
        return isinstance(self._comparator, Piecewise)

    def uses_segments(self, trials: Sequence[Trial]) -> bool:
        """Returns whether the comparator judges all trials by short predictions."""
        return all(isinstance(self._comparator.request(trial), Segments) for trial in trials)

    @property
    def hypotheses(self) -> set[Hypothesis]:
        """The hypotheses that were ever simulated."""
        return {hypothesis for memo in self._losses.values() for hypothesis in memo}

    def judged(self, trials: Sequence[Trial]) -> set[Hypothesis]:
        """Returns the hypotheses that were simulated for every one of some trials."""
        return set.intersection(*(set(self.known(trial)) for trial in trials))

    def known(self, trial: Trial) -> Cache[Hypothesis]:
        """Returns what is remembered of a trial."""
        return self._losses.get(trial.path, Cache())

    def check(self, trials: Sequence[Trial]) -> None:
        """Checks that the comparator can judge all trials, before any search.

        Raises:
            InputError: It cannot; the sentence names every trial that it cannot judge, and why.
        """
        problems = []
        for trial in trials:
            try:
                self._comparator.request(trial)
            except InputError as error:
                problems.append(str(error))
        if problems:
            raise InputError("; ".join(problems))

    def distances(self, hypotheses: Sequence[Hypothesis], trials: Sequence[Trial]) -> FloatArray:
        """Returns how far each hypothesis is from all trials together, ``(n,)``.

        It is the sum of the comparator's distances; a hypothesis whose simulation diverges is
        infinitely far.
        """
        total = np.zeros(len(hypotheses))
        for trial in trials:
            total += np.array([row.mean() for row in self._of(hypotheses, trial)])
        return total

    def losses(self, hypotheses: Sequence[Hypothesis], trials: Sequence[Trial]) -> FloatArray:
        """Returns how badly each hypothesis predicts each piece of all trials, ``(n, pieces)``.

        A comparator that does not judge in pieces has one for each trial.
        """
        return np.concatenate([np.array(self._of(hypotheses, trial)) for trial in trials], axis=1)

    def _of(self, hypotheses: Sequence[Hypothesis], trial: Trial) -> list[FloatArray]:
        memo = self._losses.setdefault(trial.path, Cache())
        if self._beside is not None:
            memo.update_from(self._beside.known(trial), hypotheses)
        return memo.get_or_compute(hypotheses, partial(self._simulate, trial))

    def _simulate(self, trial: Trial, hypotheses: list[Hypothesis]) -> FloatArray:
        outcome = self._simulated(trial, hypotheses)
        broken_down = outcome.diverged[:, np.newaxis]
        # What a comparator makes of a simulation that broke down does not matter.
        warnings: Literal["ignore"] | None = "ignore" if broken_down.any() else None
        with np.errstate(over=warnings, invalid=warnings, divide=warnings):
            losses = self._judged(outcome.behaviour, trial, len(hypotheses))
        wrong = losses[~((losses >= 0) | broken_down)]
        if len(wrong):
            raise self._broken(f"gave a distance that is not a number of at least 0: {wrong[0]}")
        return np.where(broken_down, np.inf, losses)

    def _judged(self, simulated: Behaviour, trial: Trial, count: int) -> FloatArray:
        comparator = self._comparator
        if isinstance(comparator, Piecewise):
            losses = np.asarray(comparator.losses(simulated, trial))
            if losses.ndim != 2 or len(losses) != count or not losses.shape[1]:
                raise self._broken(f"gave losses {losses.shape} for {count} simulations")
            return losses
        distances = np.asarray(comparator.distances(simulated, trial))
        if distances.shape != (count,):
            raise self._broken(f"gave {distances.shape} distances for {count} simulations")
        return np.asarray(distances[:, np.newaxis])

    def _simulated(self, trial: Trial, hypotheses: list[Hypothesis]) -> SimulationResult:
        request = self._comparator.request(trial)
        possible = recordable(request)
        if not request.record or not set(request.record) <= set(possible):
            raise self._broken(
                f"asked for the signals {request.record!r}, of {', '.join(possible)}"
            )
        return simulate(self._simulator, request, trial, hypotheses)

    def _broken(self, what: str) -> InputError:
        return InputError(
            f"the comparator {self._comparator.name!r} {what}: run "
            f"selfmodel.diagnosis.comparator_contract.check_comparator on it"
        )


def simulate(
    simulator: Simulator, request: Request, trial: Trial, hypotheses: Sequence[Hypothesis]
) -> SimulationResult:
    """Simulates what a comparator requested to judge a trial.

    Args:
        simulator: The self-model.
        request: What the comparator asked for.
        trial: The trial that it asked about.
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
