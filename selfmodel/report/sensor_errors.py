"""Error of the predictions of a hypothesis by sensor and time."""

from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis.evidence import simulate
from selfmodel.diagnosis.preparation import prepared_trial
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.report.subject import Subject
from selfmodel.simulation.requests import ClosedLoop, Segments
from selfmodel.trials.signals import PREDICTION_ERROR_SCALES, Signal, difference
from selfmodel.trials.trial import Trial

SHOWN: tuple[tuple[Signal, str], ...] = (("sensors", ""), ("joint_positions", "encoder "))
"""Signals whose columns are sensors, with the beginning of their names."""

WINDOWS = 80
"""Windows of a trial that is simulated as a whole, at most."""


@dataclass(frozen=True, eq=False)
class SensorErrors:
    """Root mean square errors by sensor and window.

    Attributes:
        names: Names of the sensors.
        begin: Beginning of each window, s since the start of the trial, ``(windows,)``.
        end: End of each window, likewise.
        errors: Errors in units of ``PREDICTION_ERROR_SCALES``, ``(sensors, windows)``; NaN where
            nothing was observed.
    """

    names: tuple[str, ...]
    begin: FloatArray
    end: FloatArray
    errors: FloatArray


def sensor_errors(subject: Subject, trial: Trial, hypothesis: Hypothesis) -> SensorErrors | None:
    """Returns the errors of a hypothesis on a trial.

    The predictions are those of the comparator: short ones from logged states, or one simulation of
    the whole trial. The result is None if the simulation diverges, or for an ensemble.
    """
    robot, behaviour = subject.simulator.robot, trial.behaviour
    request = prepared_trial(subject.comparator, robot, trial).request
    result = simulate(subject.simulator, request, trial, [hypothesis])
    if result.diverged.any():
        return None
    if isinstance(request, Segments) and request.past is not None:
        starts = request.past.starts
        rows = starts[:, np.newaxis] + np.arange(request.horizon + 1)
    elif isinstance(request, ClosedLoop):
        count = min(WINDOWS, behaviour.steps)
        rows = np.arange(behaviour.steps // count * count).reshape(count, -1)
    else:
        return None
    found: list[FloatArray] = []
    names: list[str] = []
    for signal, prefix in SHOWN:
        if signal not in result.behaviour.signals:
            continue
        predicted = result.behaviour[signal][0]
        predicted = predicted if isinstance(request, Segments) else predicted[rows]
        error = difference(signal, predicted, behaviour[signal][rows])
        found.append(_rms(error / PREDICTION_ERROR_SCALES[signal]))
        names += [f"{prefix}{name}" for name in behaviour.names.columns(signal)]
    if not found:
        return None
    time = behaviour.time[rows]
    return SensorErrors(tuple(names), time[:, 0], time[:, -1], np.concatenate(found))


def _rms(errors: FloatArray) -> FloatArray:
    """Returns the root mean square over the steps of windows, ``(columns, windows)``."""
    known = np.isfinite(errors)
    counts = known.sum(axis=1)
    squares = np.where(known, errors, 0.0) ** 2
    mean = np.full(counts.shape, np.nan)
    np.divide(squares.sum(axis=1), counts, out=mean, where=counts > 0)
    return np.asarray(np.sqrt(mean).T)
