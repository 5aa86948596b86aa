"""Does the robot move in the rhythm and order that the simulation says, whenever it began?"""

from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.comparators.bounded import bounded
from selfmodel.comparators.gait_features import GROUPS, Gait, differences, observed
from selfmodel.comparators.observed import observed_signals
from selfmodel.simulation.requests import ClosedLoop
from selfmodel.trials.behaviour import Behaviour, Signal
from selfmodel.trials.trial import Trial

SIGNALS: tuple[Signal, ...] = ("sensors", "joint_positions")

MOST = 4
"""Windows that a trial is cut into."""
SHORTEST = 100
"""Control steps that a window has at least, unless the trial is shorter."""


@dataclass(frozen=True)
class GaitPattern:
    """The difference of gaits: what they are like, not when a stride begins.

    A trial is cut into at most four windows, each looked at through a taper, so that it does not
    matter where in a stride it begins. In each, six groups of features are compared, and their
    bounded loss is a piece of the trial:

    * duty: how much of the time each reading is above one half (for a touch: the duty factor);
    * sequence: which reading rises above one half after which (for touches: the footfall sequence,
      as frequencies of transitions from one to the next);
    * phase: the relation between every two readings or joints, as the complex coherency of their
      motion (its angle is the phase, its magnitude how well the phase is kept);
    * rhythm: where the power of all motion lies in frequency, as a distance in Hz (a stride
      frequency that rises by 1 Hz moves all power by 1 Hz or more);
    * posture and excursion: the mean and the standard deviation of every reading and joint.

    No reading is taken for a touch by its name or kind, which a log does not tell: one half is
    where a binary reading changes, and for an angle it is half of the joint's range. A robot
    without touch is compared by its joints. What was not observed in the trial is left out of
    both.

    Source: Hildebrand, "Symmetrical gaits of horses", Science 150 (1965), describes a gait by duty
    factor and phase, and orders gaits by their footfall sequences. The rest is a choice made here.

    Limits: it sees nothing of where the robot goes. Failures that leave the gait alone (a sensor
    that the controller hardly listens to) are close to the intact robot. A shift matters a little
    where a window has fewer than two strides, or where the gait changes. Of feet that touch down
    together, noise decides which came first. A robot that lies still has no gait: its posture
    decides.

    Attributes:
        name: What it is called.
    """

    name: str = "gait-pattern"

    def request(self, trial: Trial) -> ClosedLoop:
        """Returns that it looks at the readings and the joints, as far as the trial has them.

        Raises:
            InputError: The trial has neither.
        """
        return ClosedLoop(record=observed_signals(trial, SIGNALS, self.name))

    def distances(self, simulated: Behaviour, trial: Trial) -> FloatArray:
        """Returns the distance of each simulation, ``(n,)``, from 0 to 1."""
        return np.asarray(self.losses(simulated, trial).mean(axis=1))

    def losses(self, simulated: Behaviour, trial: Trial) -> FloatArray:
        """Returns the loss of each group of features in each window.

        Returns:
            ``(n, windows * groups)``; their mean is the distance.
        """
        signals = observed_signals(trial, SIGNALS, self.name)
        logged = np.concatenate([trial.behaviour[signal] for signal in signals], axis=-1)
        moved = np.concatenate([simulated[signal] for signal in signals], axis=-1)
        readings = trial.behaviour["sensors"].shape[-1] if "sensors" in signals else 0
        seen, timestep = np.isfinite(logged), _timestep(trial.behaviour.time)
        windows = min(MOST, max(1, len(logged) // SHORTEST))
        theirs, own = (
            Gait(values, seen, readings, timestep, windows)
            for values in (moved, logged[np.newaxis])
        )
        known = observed(_in_windows(seen, windows), readings)
        gaps = differences(theirs, own)
        pieces = np.stack(
            [_mean(bounded(gaps[group] / large), known[group]) for group, large in GROUPS.items()],
            axis=-1,
        )
        judged = np.stack([known[group].any(axis=-1) for group in GROUPS], axis=-1)
        return np.asarray((pieces / judged.mean()).reshape(len(moved), -1))


def _timestep(time: FloatArray) -> float:
    return float(time[-1] - time[0]) / (len(time) - 1) if len(time) > 1 else 1.0


def _in_windows(seen: BoolArray, windows: int) -> BoolArray:
    """Whether anything of a column was seen in a window, ``(windows, columns)``."""
    length = len(seen) // windows
    return np.asarray(seen[: windows * length].reshape(windows, length, -1).any(axis=1))


def _mean(losses: FloatArray, known: BoolArray) -> FloatArray:
    """The mean over the features that are known, ``(n, windows)``; 0 where none is."""
    count = np.maximum(known.sum(axis=-1), 1)
    return np.asarray((losses * known).sum(axis=-1) / count)


GAIT_PATTERN = GaitPattern()
