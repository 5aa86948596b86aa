"""How likely is the trial, if the robot differs from its model by as much as robots do?"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.comparators.observed import observed_signals
from selfmodel.simulation.requests import Ensemble
from selfmodel.trials.behaviour import Behaviour, Signal
from selfmodel.trials.signal_difference import comparable
from selfmodel.trials.trial import Trial

WINDOW = 25
"""Control steps of a window; a window is a piece of the trial."""

FLOORS: Mapping[Signal, float] = MappingProxyType(
    {
        "sensors": 0.1,
        "joint_positions": 0.05,
        "base_orientation": 0.1,
        "base_linear_velocity": 0.1,
    }
)
"""The deviation that members which all do the same still have, in the signal's unit: what no
member is drawn with, such as the noise of the instruments."""


@dataclass(frozen=True)
class NoisyTransfer:
    """How unlikely the trial is under an ensemble of perturbed simulations of each hypothesis.

    Each hypothesis is simulated with six self-models whose masses, friction, damping and motors
    were drawn at a reality gap of 0.05, the same six for every hypothesis (common random numbers).
    The trial is cut into windows of 25 steps. In each, the mean and the standard deviation of
    every column are taken, and the members say how they are distributed: were the robot one more
    draw from a normal distribution of which six draws are known, it would follow a Student t about
    their mean, with five degrees of freedom and a scale of sqrt(1 + 1/6) times their standard
    deviation, to which the signal's floor is added in squares. The loss is by how much the log
    likelihood of what the trial shows falls short of the highest that there is, that of members
    that all did what the trial shows; it is averaged over the features of a signal, and over the
    signals.

    So noise counts as noise: where the members themselves disagree, a difference from them says
    little, and where they agree, much. That takes the place of a weight for early moments, and an
    ensemble that would fit anything pays for its width. A base's orientation is compared as the
    direction of gravity that it feels and the horizontal part of where it points. What was not
    observed in the trial is not compared.

    Source: the paper names noisy transfer as future work. That a simulation should be noisy about
    what it gets wrong: Jakobi, Husbands and Harvey, "Noise and the reality gap" (ECAL 1995). That
    it should know where it is to be trusted: Koos, Mouret and Doncieux, "The transferability
    approach", IEEE Transactions on Evolutionary Computation 17 (2013). The t distribution is the
    textbook's prediction of one more draw, such as in Gelman et al., "Bayesian Data Analysis".
    Windows, features and floors are choices made here.

    Limits: the level of the gap is assumed, not measured: a robot that is further from its model
    makes every hypothesis unlikely, and one that is closer is told apart less sharply than it could
    be; as no member is the model itself, not even the truth is at 0 where there is no gap. Delay,
    instruments and structure are not drawn. It costs as many simulations as there are members, six
    for every one of the other comparators, and six tell a deviation only roughly. Beyond the moment
    from which the members disagree, a trial says little. Features are judged as if they were
    independent.

    Attributes:
        name: What it is called.
        members: Simulations of each hypothesis.
        level: The level of the reality gap that they are drawn from.
    """

    name: str = "noisy-transfer"
    members: int = 6
    level: float = 0.05

    def request(self, trial: Trial) -> Ensemble:
        """Returns the ensemble, and that it looks at those of its signals that the trial has.

        Raises:
            InputError: The trial has none of them.
        """
        return Ensemble(observed_signals(trial, FLOORS, self.name), self.members, self.level)

    def distances(self, simulated: Behaviour, trial: Trial) -> FloatArray:
        """Returns the mean loss of the windows, ``(n,)``."""
        return np.asarray(self.losses(simulated, trial).mean(axis=1))

    def losses(self, simulated: Behaviour, trial: Trial) -> FloatArray:
        """Returns the loss of each window of which anything was observed, ``(n, windows)``."""
        signals = observed_signals(trial, FLOORS, self.name)
        windows = -(-trial.behaviour.steps // WINDOW)
        total = np.zeros((len(simulated[signals[0]]), windows))
        judged = np.zeros(windows)
        for signal in signals:
            logged = comparable(signal, trial.behaviour[signal])
            seen = np.isfinite(logged)
            shown, floor = _features(logged[np.newaxis], seen), FLOORS[signal]
            known = np.tile(_in_windows(seen).any(axis=1), 2) / (2 * seen.shape[1])
            # One hypothesis at a time: its members fit in the cache, and none touches another.
            for one, runs in enumerate(simulated[signal]):
                difference = _features(comparable(signal, runs), seen) - shown
                total[one] += (_shortfall(difference, floor) * known).sum(axis=1)
            judged += known.sum(axis=1)
        some = judged > 0
        # In C order, because the order in memory decides the order in which a mean adds.
        return np.ascontiguousarray(total[:, some] / judged[some])


def _features(values: FloatArray, seen: BoolArray) -> FloatArray:
    """The mean and the standard deviation of each column in each window, where it was seen.

    Args:
        values: ``(members, steps, columns)``; what was not seen may be anything, NaN included.
        seen: ``(steps, columns)``.

    Returns:
        ``(members, windows, 2 * columns)``; 0 where nothing was seen.
    """
    cut = _in_windows(np.where(seen, values, 0.0))
    told = _in_windows(seen)
    count = np.maximum(told.sum(axis=-2), 1)
    mean = cut.sum(axis=-2) / count
    cut -= mean[..., np.newaxis, :]
    cut *= told
    spread = np.sqrt(np.square(cut, out=cut).sum(axis=-2) / count)
    return np.concatenate([mean, spread], axis=-1)


def _in_windows(values: FloatArray | BoolArray) -> FloatArray:
    """Cuts the steps into windows, ``(..., windows, WINDOW, columns)``, the last filled with 0."""
    *before, steps, columns = values.shape
    windows = -(-steps // WINDOW)
    whole = np.zeros((*before, windows * WINDOW, columns))
    whole[..., :steps, :] = values
    return whole.reshape(*before, windows, WINDOW, columns)


def _shortfall(difference: FloatArray, floor: float) -> FloatArray:
    """By how much the log likelihood of each feature is below the highest.

    Args:
        difference: Of the members from what the trial shows, ``(members, windows, features)``.
        floor: The least deviation.

    Returns:
        ``(windows, features)``, exactly 0 where no member differs.
    """
    members = len(difference)
    freedom = max(members - 1, 1)
    mean = difference.mean(axis=0)
    variance = np.square(difference - mean).sum(axis=0) * ((1 + 1 / members) / freedom)
    wider = variance / floor**2
    squares = np.square(mean / floor) / (1 + wider)
    return np.asarray(0.5 * np.log1p(wider) + 0.5 * (freedom + 1) * np.log1p(squares / freedom))


NOISY_TRANSFER = NoisyTransfer()
