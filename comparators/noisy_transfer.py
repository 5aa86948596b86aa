"""Likelihood of a trial under an ensemble of perturbed self-models."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.comparators.sensor_series import observed_signals, padded_windows
from selfmodel.diagnosis.comparator import Prepared
from selfmodel.simulation.requests import Ensemble
from selfmodel.trials.signals import ENSEMBLE_DEVIATION_FLOORS, Signal, comparable
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial

WINDOW = 25
"""Control steps of a window."""


@dataclass(frozen=True)
class NoisyTransfer:
    """Shortfall of a trial's log likelihood under an ensemble of perturbed simulations.

    Each hypothesis is simulated with six self-models whose masses, friction, damping and motors
    were drawn at a reality gap of 0.05, the same six for every hypothesis (common random numbers).
    The features of a window of 25 steps are the mean and the standard deviation of every column.
    If the robot were one more draw from a normal distribution of which six draws are known, a
    feature would follow a Student t about their mean, with five degrees of freedom and a scale of
    sqrt(1 + 1/6) times their standard deviation, to which the signal's floor is added in squares.
    The loss is the difference between the log likelihood of members that all reproduce the trial
    and that of the trial, averaged over the features of a signal, and over the signals.

    So a difference has a small loss where the members differ from each other, as in later steps,
    and a large loss where they agree; an ensemble that is wide enough to fit any trial has a loss
    for its width. The base's orientation is compared as in ``sensor-series``. Unobserved values of
    the trial are left out.

    Source: the paper names noisy transfer as future work. Noise in the badly modelled parts of a
    simulation: Jakobi, Husbands and Harvey, "Noise and the reality gap" (ECAL 1995). Estimates of
    where a simulation can be trusted: Koos, Mouret and Doncieux, "The transferability approach",
    IEEE Transactions on Evolutionary Computation 17 (2013). The t distribution is the textbook's
    prediction of one more draw, such as in Gelman et al., "Bayesian Data Analysis". Windows,
    features and floors are selfmodel's choices.

    Limits: the level of the gap is assumed, not measured; because no member is the model itself,
    the distance of the true hypothesis is above 0 even without a gap. Delay and measurement noise
    are not drawn. The cost is six simulations per hypothesis, where other comparators need one, and
    six members estimate a deviation only roughly. Features are taken to be independent.
    """

    name: str = "noisy-transfer"
    members: int = 6
    level: float = 0.05

    def prepare(self, trial: Trial) -> Prepared:
        """Returns the features of the trial, of the signals that were observed."""
        signals = observed_signals(trial, ENSEMBLE_DEVIATION_FLOORS, self.name)
        features = {signal: _trial_features(signal, trial.trajectory[signal]) for signal in signals}
        weight = np.zeros(-(-trial.trajectory.steps // WINDOW))
        for each in features.values():
            weight += each.weight.sum(axis=1)
        request = Ensemble(signals, self.members, self.level)
        return Prepared(request, partial(_losses, features, weight))


class TrialFeatures(NamedTuple):
    """The features of one signal of a trial.

    Attributes:
        observed: Mask of the observed values, ``(steps, columns)``.
        values: Features of each window, ``(1, windows, 2 * columns)``.
        weight: Weight of each feature, ``(windows, 2 * columns)``; 0 if unobserved.
        floor: Deviation that is added to that of the members.
    """

    observed: BoolArray
    values: FloatArray
    weight: FloatArray
    floor: float


def _losses(
    features: Mapping[Signal, TrialFeatures], weight: FloatArray, simulated: Trajectory
) -> FloatArray:
    """Returns the loss of each window with an observation, ``(n, windows)``.

    ``weight`` is the sum of the weights in each window, 0 if nothing was observed.
    """
    total = np.zeros((len(simulated[next(iter(features))]), len(weight)))
    for signal, logged in features.items():
        # One hypothesis at a time: its members fit in the CPU cache, and no result depends on the
        # other hypotheses.
        for hypothesis, members in enumerate(simulated[signal]):
            difference = _features(comparable(signal, members), logged.observed)
            difference -= logged.values
            shortfall = _likelihood_shortfall(difference, logged.floor)
            total[hypothesis] += (shortfall * logged.weight).sum(axis=1)
    # In C order: the order in memory is the order in which a mean adds.
    return np.ascontiguousarray(total[:, weight > 0] / weight[weight > 0])


def _trial_features(signal: Signal, values: FloatArray) -> TrialFeatures:
    logged = comparable(signal, values)
    observed = np.isfinite(logged)
    windows = padded_windows(observed, WINDOW).any(axis=1)
    weight = np.tile(windows, 2) / (2 * observed.shape[1])
    values = _features(logged[np.newaxis], observed)
    return TrialFeatures(observed, values, weight, ENSEMBLE_DEVIATION_FLOORS[signal])


def _features(values: FloatArray, observed: BoolArray) -> FloatArray:
    """Returns the mean and the standard deviation of each column's observed values, by window.

    Args:
        values: ``(members, steps, columns)``; unobserved values may be NaN.
        observed: ``(steps, columns)``.

    Returns:
        ``(members, windows, 2 * columns)``; 0 if nothing was observed.
    """
    windows = padded_windows(values, WINDOW, observed)
    mask = padded_windows(observed, WINDOW)
    count = np.maximum(mask.sum(axis=-2), 1)
    mean = windows.sum(axis=-2) / count
    windows -= mean[..., np.newaxis, :]
    windows *= mask
    spread = np.sqrt(np.square(windows, out=windows).sum(axis=-2) / count)
    return np.concatenate([mean, spread], axis=-1)


def _likelihood_shortfall(difference: FloatArray, floor: float) -> FloatArray:
    """Returns the highest possible log likelihood of each feature less that of the trial.

    ``difference`` are the features of the members less those of the trial,
    ``(members, windows, features)``.
    """
    members = len(difference)
    freedom = max(members - 1, 1)
    mean = difference.mean(axis=0)
    variance = np.square(difference - mean).sum(axis=0) * ((1 + 1 / members) / freedom)
    wider = variance / floor**2
    squares = np.square(mean / floor) / (1 + wider)
    return np.asarray(0.5 * np.log1p(wider) + 0.5 * (freedom + 1) * np.log1p(squares / freedom))


NOISY_TRANSFER = NoisyTransfer()
