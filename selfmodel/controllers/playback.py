"""What drives a robot whose controller is not known: the commands that were recorded."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import FloatArray, frozen


@dataclass(frozen=True, eq=False)
class Playback:
    """Recorded commands, given again step by step, whatever the sensors say.

    Attributes:
        motors: What is commanded, in order.
        commands: ``(steps, motors)``, each in its motor's unit. The last stands when they end.

    Raises:
        ValueError: There are no commands, they do not fit the motors, or one is not finite.
    """

    motors: tuple[str, ...]
    commands: FloatArray

    def __post_init__(self) -> None:
        if self.commands.shape[1:] != (len(self.motors),) or not len(self.commands):
            raise ValueError(
                f"commands must have shape (steps, motors) = (1 or more, {len(self.motors)}), "
                f"got {self.commands.shape}"
            )
        unknown = np.flatnonzero(~np.isfinite(self.commands).all(axis=1))
        if len(unknown):
            raise ValueError(f"the commands of step {unknown[0]} are not all known")
        object.__setattr__(self, "commands", frozen(self.commands))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Playback):
            return NotImplemented
        return self.motors == other.motors and self._bytes() == other._bytes()

    def __hash__(self) -> int:
        return hash((self.motors, self._bytes()))

    def _bytes(self) -> tuple[tuple[int, ...], bytes]:
        return self.commands.shape, self.commands.tobytes()


def played_back(motors: tuple[str, ...], commands: FloatArray) -> Playback:
    """Returns the recording of commands of which some may not be known: NaN.

    A command that was lost is taken to be the one before it, which stood until the next.

    Args:
        motors: What is commanded, in order.
        commands: ``(steps, motors)``, each in its motor's unit.

    Raises:
        ValueError: The first is not known.
    """
    last = np.where(np.isnan(commands), 0, np.arange(len(commands))[:, np.newaxis])
    np.maximum.accumulate(last, axis=0, out=last)
    return Playback(motors, np.take_along_axis(commands, last, axis=0))


class Playbacks:
    """The recorded commands of many robots, stepped together like a ``Population``.

    Args:
        playbacks: One a robot.
        sensors: How many readings a robot has; nobody looks at them.
    """

    def __init__(self, playbacks: Sequence[Playback], sensors: int) -> None:
        self._commands = [playback.commands for playback in playbacks]
        self._step = 0
        self.readings = np.zeros((len(playbacks), sensors))

    def step(self, targets: FloatArray) -> None:
        """Gives the commands of the next step.

        Args:
            targets: ``(n, motors)``, written: each in its motor's unit.
        """
        for target, commands in zip(targets, self._commands, strict=True):
            target[:] = commands[min(self._step, len(commands) - 1)]
        self._step += 1
