"""Command source of a trial: a controller, or the playback of recorded commands."""

from collections import Counter
from collections.abc import Sequence, Set as AbstractSet

import numpy as np

from selfmodel.controllers.controller import Controller, ControllerBatch, check_silent_neurons
from selfmodel.controllers.playback import Playback, PlaybackBatch

CommandSource = Controller | Playback
"""Source of a robot's commands: a playback if other software controlled the robot."""


def make_batch(
    sources: Sequence[CommandSource], silent: Sequence[AbstractSet[int]], sensors: int
) -> ControllerBatch:
    """Returns the batch of the command sources of many robots, in their initial state.

    Args:
        sources: Command sources, one per robot: controllers of one design, or playbacks.
        silent: Indices of the silent hidden neurons per robot; they do not affect a playback.
        sensors: Number of sensors of a robot.

    Raises:
        ValueError: The sources are not all playbacks or all controllers of one design.
        InputError: A silent hidden neuron does not exist in the design.
    """
    controllers = [source for source in sources if isinstance(source, Controller)]
    playbacks = [source for source in sources if isinstance(source, Playback)]
    designs = Counter(controller.design for controller in controllers)
    if len(designs) + bool(playbacks) != 1:
        counts = [f"{count} x {design.description}" for design, count in designs.items()]
        counts.append(f"{len(playbacks)} playbacks")
        raise ValueError(
            f"the command sources of one batch must have one design, got {'; '.join(counts)}"
        )
    if playbacks:
        return PlaybackBatch(playbacks, sensors)
    (design,) = designs
    for neurons in silent:
        check_silent_neurons(design, neurons)
    return design.batch(np.array([controller.genome for controller in controllers]), silent)
