"""What drives a robot through a trial: its controller, or commands that were recorded."""

from collections.abc import Sequence

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.cpg import Cpg, Oscillators, Rhythms
from selfmodel.controllers.network import Controller, Network, Population
from selfmodel.controllers.playback import Playback, Playbacks
from selfmodel.errors import InputError

Design = Network | Cpg
"""A kind of controller that fits a robot: how many values a genome has (``weights``), and what it
is decoded to (``controller``)."""

Evolved = Controller | Oscillators
"""A controller that a genome was decoded to. Its ``design`` and ``genome`` are all of it."""

Driver = Evolved | Playback
"""What a trial was driven by. A log of a robot that walks by other software has no controller."""

Brains = Population | Rhythms | Playbacks
"""What computes the commands of many robots: ``readings`` in, ``step`` gives the commands."""


def drive(drivers: Sequence[Driver], neurons: FloatArray, sensors: int) -> Brains:
    """Returns what computes the commands of many robots, step by step.

    Args:
        drivers: One a robot, all of one kind.
        neurons: ``(n, hidden)``: 1 for a neuron that works, 0 for a silent one.
        sensors: How many readings a robot has.

    Raises:
        ValueError: They are not of one kind.
        InputError: A hidden neuron is silent, and there are none.
    """
    controllers = [driver for driver in drivers if isinstance(driver, Controller)]
    if len(controllers) == len(drivers):
        return Population(controllers, neurons)
    oscillators = [driver for driver in drivers if isinstance(driver, Oscillators)]
    if len(oscillators) == len(drivers):
        if np.any(neurons != 1):
            raise InputError(
                "oscillators drive this robot, and have no hidden neurons: leave neuron:... out, "
                "or drive it with a network"
            )
        return Rhythms(oscillators)
    playbacks = [driver for driver in drivers if isinstance(driver, Playback)]
    if len(playbacks) == len(drivers):
        return Playbacks(playbacks, sensors)
    raise ValueError(
        f"the robots of one batch are driven alike, got {len(controllers)} networks, "
        f"{len(oscillators)} sets of oscillators and {len(playbacks)} recordings"
    )
