"""What drives a robot through a trial: its controller, or commands that were recorded."""

from collections.abc import Sequence

from selfmodel.arrays import FloatArray
from selfmodel.controller import Controller, Population
from selfmodel.playback import Playback, Playbacks

Driver = Controller | Playback
"""What a trial was driven by. A log of a robot that walks by other software has no controller."""


def drive(drivers: Sequence[Driver], neurons: FloatArray, sensors: int) -> Population | Playbacks:
    """Returns what computes the commands of many robots, step by step.

    Args:
        drivers: One a robot, all of one kind.
        neurons: ``(n, hidden)``: 1 for a neuron that works, 0 for a silent one.
        sensors: How many readings a robot has.

    Raises:
        ValueError: They are not of one kind.
    """
    controllers = [driver for driver in drivers if isinstance(driver, Controller)]
    if len(controllers) == len(drivers):
        return Population(controllers, neurons)
    playbacks = [driver for driver in drivers if isinstance(driver, Playback)]
    if len(playbacks) == len(drivers):
        return Playbacks(playbacks, sensors)
    raise ValueError(
        f"the robots of one batch are driven alike, got {len(controllers)} controllers and "
        f"{len(playbacks)} recordings"
    )
