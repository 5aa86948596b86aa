"""Replay: a new simulation of a logged trial, compared with the log."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from selfmodel.arrays import FloatArray, data_frame, finite_or_none
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.robot.motion import POSE
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.estimation import STATE
from selfmodel.trials.signals import SIGNALS, Signal
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial

State = Mapping[Signal, FloatArray] | None

TOLERANCE = 1e-6
"""Largest difference that counts as equal between versions of MuJoCo, after an import, and from a
logged state: SI units, some thousand roundings, before contacts amplify them."""

NEAR = 1e-3
"""Difference up to which a trial began in the initial pose, rad and m: the resampling of an import
moves it by less."""


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
        from_log: Whether it begins in the logged state of the first step, and not in the initial
            pose of the model: episodes of other environments have random starts.
    """

    simulated: Trajectory
    observed: bool
    identical: bool
    first_divergence_step: int | None
    errors: Mapping[Signal, FloatArray]
    diverged: bool
    from_log: bool = False

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
        return {
            "observed": self.observed,
            "identical": self.identical,
            "first_divergence_step": self.first_divergence_step,
            "diverged": self.diverged,
            "from_log": self.from_log,
            "rms": {signal: finite_or_none(self.rms(signal)) for signal in self.errors},
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
    equal numbers, in the unit of the signal. If the initial pose is not that of the log, the
    simulation begins in the logged state, with ``TOLERANCE`` at least: if that is the whole state,
    the trial begins at rest as an episode does, and no fault moves the initial pose or an encoder.
    """
    state = {signal: trial.trajectory[signal][:1] for signal in STATE}
    variant, pose = build(simulator.robot, hypothesis), simulator.robot.model.qpos0
    moves = not np.array_equal(variant.model.qpos0, pose) or variant.encoder_offset.any()
    if not moves and not any(np.isnan(one).any() for one in state.values()):
        start = simulator.run([(hypothesis, trial.plan.controller)], 1, POSE).trajectory
        apart = [start[signal][0, 0] - state[signal][0] for signal in POSE]
        if np.abs(np.concatenate(apart)).max() > NEAR:
            found = _compared(trial, hypothesis, simulator, max(tolerance, TOLERANCE), state)
            if found.first_divergence_step != 0:
                return found
    return _compared(trial, hypothesis, simulator, tolerance, None)


def _compared(
    trial: Trial, hypothesis: Hypothesis, simulator: Simulator, tolerance: float, state: State
) -> Replay:
    logged = trial.trajectory
    outcome = simulator.run([(hypothesis, trial.plan.controller)], logged.steps, SIGNALS, state)
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
        from_log=state is not None,
    )
