"""A part of a trial in time."""

import dataclasses
import math
from dataclasses import dataclass

from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.trial import Trial


@dataclass(frozen=True, eq=False)
class TrialPart:
    """A part of a trial: the pieces that lie between two times.

    Attributes:
        trial: The whole trial.
        begin: First time of the part, s since the start of the trial.
        end: Last time of the part, s since the start of the trial.
    """

    trial: Trial
    begin: float = -math.inf
    end: float = math.inf

    @property
    def is_whole(self) -> bool:
        """Whether the part has no bounds."""
        return self.begin == -math.inf and self.end == math.inf

    @property
    def rows(self) -> Trial:
        """The trial with the rows of the part alone."""
        behaviour = self.trial.behaviour
        kept = (behaviour.time >= self.begin) & (behaviour.time <= self.end)
        part = Behaviour(
            names=behaviour.names,
            time=behaviour.time[kept],
            signals={name: values[kept] for name, values in behaviour.signals.items()},
            late=None if behaviour.late is None else behaviour.late[kept],
        )
        return dataclasses.replace(self.trial, behaviour=part)


def whole(trial: Trial | TrialPart) -> TrialPart:
    """Returns a trial as a part without bounds; a part is returned unchanged."""
    return trial if isinstance(trial, TrialPart) else TrialPart(trial)
