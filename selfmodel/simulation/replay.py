"""A logged trial simulated again: whether it is the same, and where it parts."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import SIGNALS, Behaviour, Signal
from selfmodel.trials.trial import Trial


@dataclass(frozen=True, eq=False)
class Replay:
    """A trial beside its simulation. What was not observed is not compared.

    Attributes:
        simulated: What the simulation did, ``(steps, width)`` for each signal.
        identical: Whether every number that was observed is the simulated one, to the bit.
        first_divergence_step: The first step at which some signal differs by more than the
            tolerance; None if there is none.
        errors: For each signal the root mean square over its columns of what differs at each step,
            ``(steps,)`` in the signal's unit; NaN where nothing was observed.
        broke_down: Whether the simulation diverged, so that it means nothing.
    """

    simulated: Behaviour
    identical: bool
    first_divergence_step: int | None
    errors: Mapping[Signal, FloatArray]
    broke_down: bool

    def rms(self, signal: Signal, steps: slice = slice(None)) -> float:
        """Returns the root mean square of a signal's error over some steps; NaN without any."""
        squares = self.errors[signal][steps] ** 2
        observed = squares[~np.isnan(squares)]
        return float(np.sqrt(observed.mean())) if len(observed) else np.nan


def replay(
    trial: Trial, hypothesis: Hypothesis, simulator: Simulator, tolerance: float = 0.0
) -> Replay:
    """Simulates what a trial did, and compares.

    Args:
        trial: The logged trial.
        hypothesis: What is taken to be wrong with the robot.
        simulator: Of the trial's robot.
        tolerance: By how much a number may differ and count as the same, in its unit: more than 0
            where another version of MuJoCo made the log.
    """
    logged = trial.behaviour
    outcome = simulator.run([(hypothesis, trial.plan.controller)], logged.steps, SIGNALS)
    batch = outcome.behaviour
    simulated = Behaviour(batch.names, batch.time, {signal: batch[signal][0] for signal in SIGNALS})
    apart = np.zeros(logged.steps, dtype=bool)
    identical = True
    errors: dict[Signal, FloatArray] = {}
    for signal in SIGNALS:
        told, made = logged[signal], simulated[signal]
        observed = ~np.isnan(told)
        with np.errstate(invalid="ignore", over="ignore"):  # a simulation that broke down
            difference = np.where(observed, made - told, 0.0)
            apart |= (~(np.abs(difference) <= tolerance) & observed).any(axis=1)
            errors[signal] = _rms_of_rows(difference, observed)
        identical &= bool(np.all((_bits(made) == _bits(told)) | ~observed))
    steps = np.flatnonzero(apart)
    return Replay(
        simulated=simulated,
        identical=identical,
        first_divergence_step=int(steps[0]) if len(steps) else None,
        errors=errors,
        broke_down=bool(outcome.diverged[0]),
    )


def _bits(values: FloatArray) -> FloatArray:
    return np.ascontiguousarray(values).view(np.int64)


def _rms_of_rows(difference: FloatArray, observed: BoolArray) -> FloatArray:
    counts = observed.sum(axis=1)
    total = np.sum(np.square(difference), axis=1)
    mean: FloatArray = np.full(len(total), np.nan)
    np.divide(total, counts, out=mean, where=counts > 0)
    return np.sqrt(mean)
