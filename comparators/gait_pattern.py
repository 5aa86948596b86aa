"""Difference of gait patterns: rhythm, phase and footfall sequence, whatever the time shift."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.comparators.bounded import bounded
from selfmodel.comparators.gait_features import (
    LARGE_DIFFERENCES,
    Gait,
    differences,
    observed_features,
)
from selfmodel.comparators.observed import observed_signals
from selfmodel.comparators.windows import masked_mean
from selfmodel.simulation.requests import ClosedLoop
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.signals import Signal
from selfmodel.trials.trial import Trial

SIGNALS: tuple[Signal, ...] = ("sensors", "joint_positions")

MAX_WINDOWS = 4
"""Windows of a trial, at most."""
MIN_WINDOW = 100
"""Control steps of a window, at least, unless the trial is shorter."""


@dataclass(frozen=True)
class GaitPattern:
    """The difference of gait features, which do not depend on when a stride begins.

    A trial is cut into at most four windows, each multiplied by a taper, so that the phase of the
    stride at its beginning does not matter. In each window, six groups of features are compared;
    the bounded loss of a group in a window is one loss:

    * duty: part of the time that each reading is above one half (for a touch: the duty factor);
    * sequence: the order in which readings rise above one half (for touches: the footfall
      sequence), as frequencies of transitions from one reading to the next;
    * phase: the relation between every two readings or joints, as the complex coherency of their
      motion (its angle is the phase, its magnitude how constant the phase is);
    * rhythm: the distribution of the power of all motion over frequency, as a distance in Hz (a
      stride frequency that rises by 1 Hz moves all power by 1 Hz or more);
    * posture and excursion: the mean and the standard deviation of every reading and joint.

    Readings are not classified as touches, because a log does not contain the kind of a sensor: one
    half separates the values of a binary reading, and is half of the joint's range for an angle. A
    robot without touch sensors is compared by its joints. Unobserved values of the trial are left
    out of both gaits.

    Source: Hildebrand, "Symmetrical gaits of horses", Science 150 (1965), describes a gait by duty
    factor and phase, and orders gaits by their footfall sequences. The rest is selfmodel's choice.

    Limits: the travel of the robot is not compared. Failures that do not change the gait (a sensor
    that the controller hardly uses) are close to the healthy robot. A time shift matters a little
    if a window has fewer than two strides, or the gait changes. The order of feet that touch down
    together is decided by noise. A robot that lies still has no gait: its posture decides.

    Attributes:
        name: The comparator's name.
    """

    name: str = "gait-pattern"

    def prepare(self, trial: Trial) -> "PreparedGait":
        """Returns the gait of the trial, from its observed readings and joint positions.

        Raises:
            InputError: Neither readings nor joint positions were observed.
        """
        signals = observed_signals(trial, SIGNALS, self.name)
        logged = np.concatenate([trial.behaviour[signal] for signal in signals], axis=-1)
        readings = trial.behaviour["sensors"].shape[-1] if "sensors" in signals else 0
        observed, timestep = np.isfinite(logged), _timestep(trial.behaviour.time)
        windows = min(MAX_WINDOWS, max(1, len(logged) // MIN_WINDOW))
        known = observed_features(_observed_in_windows(observed, windows), readings)
        share = np.stack([known[group].any(axis=-1) for group in LARGE_DIFFERENCES], axis=-1).mean()
        return PreparedGait(
            request=ClosedLoop(record=signals),
            observed=observed,
            readings=readings,
            timestep=timestep,
            windows=windows,
            gait=Gait(logged[np.newaxis], observed, readings, timestep, windows),
            known=known,
            share=float(share),
        )


@dataclass(frozen=True, eq=False)
class PreparedGait:
    """A trial prepared for ``GaitPattern``.

    Attributes:
        request: A closed-loop rollout that records the observed signals.
        observed: Mask of the observed values, ``(steps, columns)``.
        readings: Number of columns that are readings of the controller; they are the first.
        timestep: Control time step, s.
        windows: Number of windows.
        gait: The gait of the trial.
        known: Mask of the features with an observation, by group, ``(windows, features)`` each.
        share: Share of the groups and windows with an observation.
    """

    request: ClosedLoop
    observed: BoolArray
    readings: int
    timestep: float
    windows: int
    gait: Gait
    known: Mapping[str, BoolArray]
    share: float

    def distances(self, simulated: Behaviour) -> FloatArray:
        """Returns the distance of each simulation, ``(n,)``, from 0 to 1."""
        return np.asarray(self.losses(simulated).mean(axis=1))

    def losses(self, simulated: Behaviour) -> FloatArray:
        """Returns the loss of each group of features in each window.

        Returns:
            ``(n, windows * groups)``; their mean is the distance.
        """
        values = np.concatenate([simulated[signal] for signal in self.request.record], axis=-1)
        gaits = Gait(values, self.observed, self.readings, self.timestep, self.windows)
        found = differences(gaits, self.gait)
        losses = np.stack(
            [
                masked_mean(bounded(found[group] / large), self.known[group])
                for group, large in LARGE_DIFFERENCES.items()
            ],
            axis=-1,
        )
        return np.asarray((losses / self.share).reshape(len(values), -1))


def _timestep(time: FloatArray) -> float:
    return float(time[-1] - time[0]) / (len(time) - 1) if len(time) > 1 else 1.0


def _observed_in_windows(observed: BoolArray, windows: int) -> BoolArray:
    """Returns whether a column has an observation in a window, ``(windows, columns)``.

    Steps that are left over at the end are ignored, as by ``Gait``.
    """
    length = len(observed) // windows
    return np.asarray(observed[: windows * length].reshape(windows, length, -1).any(axis=1))


GAIT_PATTERN = GaitPattern()
