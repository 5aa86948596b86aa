"""What comes out of a batch of simulations, and what they cost."""

from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray
from selfmodel.trials.behaviour import Behaviour


@dataclass
class SimulationStats:
    """What a simulator has done so far.

    Attributes:
        runs: Simulations.
        steps: Control steps, over all simulations.
        diverged: Simulations that diverged, or in which MuJoCo warned.
        physics_seconds: Wall time spent inside MuJoCo's steps.
    """

    runs: int = 0
    steps: int = 0
    diverged: int = 0
    physics_seconds: float = 0.0


@dataclass(frozen=True, eq=False)
class SimulationResult:
    """The outcome of a batch of runs.

    Attributes:
        behaviour: The signals that were asked for, with a leading axis of ``n``.
        diverged: ``(n,)``: which runs mean nothing, because the simulation broke down.
    """

    behaviour: Behaviour
    diverged: BoolArray

    def grouped(self, *shape: int) -> "SimulationResult":
        """Returns the same with the runs ``(n,)`` as an array of that shape, row by row."""
        flat = self.behaviour
        signals = {
            signal: values.reshape(*shape, *values.shape[1:])
            for signal, values in flat.signals.items()
        }
        return SimulationResult(
            Behaviour(flat.names, flat.time, signals), np.asarray(self.diverged.reshape(shape))
        )
