"""Playback of recorded commands, for a robot whose controller is unknown."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray, frozen, held
from selfmodel.errors import typed


@typed
@dataclass(frozen=True, eq=False)
class Playback:
    """Recorded commands, repeated step by step independently of the sensors.

    Attributes:
        motors: Names of the motors, in order.
        commands: ``(steps, motors)``, each in its motor's unit. The last command is held after the
            end of the recording.
        function: Name of the function of the robot's observations that gave the commands; "" if
            none is known.

    Raises:
        ValueError: The commands have another shape or no rows, or a command is not finite.
    """

    motors: tuple[str, ...]
    commands: FloatArray
    function: str = ""

    def __post_init__(self) -> None:
        if self.commands.shape[1:] != (len(self.motors),) or not len(self.commands):
            raise ValueError(
                f"commands must have shape (steps, motors) = (1 or more, {len(self.motors)}), "
                f"got {self.commands.shape}"
            )
        incomplete = np.flatnonzero(~np.isfinite(self.commands).all(axis=1))
        if len(incomplete):
            raise ValueError(f"the commands of step {incomplete[0]} are not all finite")
        object.__setattr__(self, "commands", frozen(self.commands))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Playback):
            return NotImplemented
        return self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)

    @cached_property  # every look-up of a trial needs it
    def _key(self) -> tuple[tuple[str, ...], bytes, str]:
        return self.motors, self.commands.tobytes(), self.function

    @property
    def summary(self) -> str:
        """Short description, for the contents of a log."""
        who = f"the function {self.function}" if self.function else "other software"
        return f"{who}; its commands are played back"


def played_back(motors: tuple[str, ...], commands: FloatArray, function: str = "") -> Playback:
    """Returns the playback of a recording, with the command before each missing one, a NaN.

    Raises:
        ValueError: A command of the first step is missing.
    """
    return Playback(motors, held(commands), function)


class PlaybackBatch:
    """The recorded commands of many robots; a ``ControllerBatch`` that ignores its readings."""

    def __init__(self, playbacks: Sequence[Playback], sensors: int) -> None:
        self._commands = [playback.commands for playback in playbacks]
        self._step = 0
        self.readings = np.zeros((len(playbacks), sensors))
        self.observed: Mapping[str, FloatArray] = {}

    def step(self, targets: FloatArray) -> None:
        """Writes the commands of the next control step; see ``ControllerBatch``."""
        for target, commands in zip(targets, self._commands, strict=True):
            target[:] = commands[min(self._step, len(commands) - 1)]
        self._step += 1

    def end(self, _running: IndexArray) -> None:
        """Changes nothing."""
