"""Results and statistics of simulation batches."""

from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray
from selfmodel.trials.behaviour import Behaviour


@dataclass
class SimulationStats:
    """Cumulative statistics of a simulator.

    Attributes:
        runs: Number of simulations.
        steps: Number of control steps, over all simulations.
        diverged: Number of simulations that diverged or had a MuJoCo warning.
        physics_seconds: Wall time of MuJoCo's steps, s.
    """

    runs: int = 0
    steps: int = 0
    diverged: int = 0
    physics_seconds: float = 0.0


@dataclass(frozen=True, eq=False)
class SimulationResult:
    """Result of a batch of runs.

    Attributes:
        behaviour: The recorded signals, with a leading axis of ``n``.
        diverged: Mask of the runs that diverged, ``(n,)``; their signals are invalid.
    """

    behaviour: Behaviour
    diverged: BoolArray

    def grouped(self, *shape: int) -> "SimulationResult":
        """Returns the result with its axis of runs, ``(n,)``, reshaped in row-major order."""
        flat = self.behaviour
        signals = {
            signal: values.reshape(*shape, *values.shape[1:])
            for signal, values in flat.signals.items()
        }
        return SimulationResult(
            Behaviour(flat.names, flat.time, signals), np.asarray(self.diverged.reshape(shape))
        )
