"""Replay: a new simulation of a logged trial, compared with the log."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from selfmodel.arrays import FloatArray, data_frame, finite_or_none
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.signals import SIGNALS, Signal
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial


@dataclass(frozen=True, eq=False)
class Replay:
    """Comparison of a logged trial with its simulation, on the observed numbers.

    Attributes:
        simulated: Simulated signals, ``(steps, width)`` each.
        observed: Whether the log has an observed number at all.
        identical: Whether all observed numbers are bit-identical to the simulated ones; False if
            nothing was observed.
        first_divergence_step: First step at which a signal differs by more than the tolerance;
            None without such a step.
        errors: Root mean square error of each signal over its columns, ``(steps,)`` in the signal's
            unit; NaN at a step without an observation.
        diverged: Whether the simulation diverged; its signals are then invalid.
    """

    simulated: Trajectory
    observed: bool
    identical: bool
    first_divergence_step: int | None
    errors: Mapping[Signal, FloatArray]
    diverged: bool

    def rms(self, signal: Signal, steps: slice = slice(None)) -> float:
        """Returns the root mean square error of a signal over some steps; NaN if not observed."""
        with np.errstate(over="ignore"):  # values of a diverged simulation
            squares = self.errors[signal][steps] ** 2
            observed = squares[~np.isnan(squares)]
            return float(np.sqrt(observed.mean())) if len(observed) else np.nan

    def __repr__(self) -> str:
        step = self.first_divergence_step
        compared = "no divergence" if step is None else f"first divergence at step {step}"
        state = "identical" if self.identical else compared
        state = state if self.observed else "nothing was observed"
        broken = ", the simulation diverged" if self.diverged else ""
        lines = [f"<Replay of {self.simulated.steps} steps: {state}{broken}"]
        if not self.identical:
            lines += [f"  rms {self.rms(signal):10.3g}  {signal}" for signal in self.errors]
        return "\n".join(lines) + ">"

    def to_dict(self) -> dict[str, Any]:
        """Returns the JSON values; a signal's rms is None if not observed, or not finite."""
        rms_values = [(signal, self.rms(signal)) for signal in self.errors]
        return {
            "observed": self.observed,
            "identical": self.identical,
            "first_divergence_step": self.first_divergence_step,
            "diverged": self.diverged,
            "rms": {signal: finite_or_none(rms) for signal, rms in rms_values},
        }

    def to_pandas(self) -> Any:  # noqa: ANN401  # pandas has no types
        """Returns the errors as a ``pandas.DataFrame``, one row per step, one column per signal."""
        steps = np.arange(self.simulated.steps)
        return data_frame({"step": steps, **{str(name): own for name, own in self.errors.items()}})


def replay(
    trial: Trial, hypothesis: Hypothesis, simulator: Simulator, tolerance: float = 0.0
) -> Replay:
    """Simulates a logged trial under a hypothesis and compares the simulation with the log.

    A log of another MuJoCo version requires a tolerance above 0: the largest difference of two
    equal numbers, in the unit of the signal.
    """
    logged = trial.trajectory
    outcome = simulator.run([(hypothesis, trial.plan.controller)], logged.steps, SIGNALS)
    simulated = outcome.trajectory.run(0)
    errors, known, same = dict[Signal, FloatArray](), list[bool](), list[bool]()
    differs = np.zeros(logged.steps, np.bool_)
    for signal in SIGNALS:
        one, other = simulated[signal], logged[signal]
        observed = ~np.isnan(other)
        with np.errstate(all="ignore"):  # values of a diverged simulation; steps not observed
            difference = np.where(observed, one - other, 0.0)
            differs |= ~(np.abs(difference) <= tolerance).all(axis=1)
            errors[signal] = np.sqrt((difference**2).sum(axis=1) / observed.sum(axis=1))
        known.append(bool(observed.any()))
        is_same = (one.view(np.int64) == other.view(np.int64)) | ~observed
        same.append(bool(is_same.all()))
    steps = np.flatnonzero(differs)
    return Replay(
        simulated=simulated,
        observed=any(known),
        identical=any(known) and all(same),
        first_divergence_step=int(steps[0]) if len(steps) else None,
        errors=errors,
        diverged=bool(outcome.diverged[0]),
    )
