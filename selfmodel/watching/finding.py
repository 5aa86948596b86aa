"""Findings: what a watch says, when something about the robot changes."""

from dataclasses import dataclass
from typing import Any, Literal

from selfmodel.faults.hypothesis import Hypothesis

Status = Literal[
    "watching", "not judged", "stale", "changed", "explained", "ambiguous", "unexplained"
]
"""``watching``: the robot is as it was in the healthy trials. ``not judged``: they do not cover
what it does. ``stale``: no step comes, as who waits for the steps says. ``changed``: an alarm,
whose cause is sought. The others end a watch: one fault is left, several are, or none explains what
is seen."""


ENDS: tuple[Status, ...] = ("explained", "ambiguous", "unexplained")
"""Those that end a watch."""


@dataclass(frozen=True)
class Rated:
    """A hypothesis that is left after a change, and its mean loss since then."""

    hypothesis: Hypothesis
    loss: float


@dataclass(frozen=True)
class Finding:
    """What a watch says at one step.

    Attributes:
        time: Time of the newest step, s since the first.
        status: See ``Status``.
        reason: Clause, of ``not judged``, ``stale`` and ``unexplained``; else "".
        onset: Time of the change, s; None without one.
        earliest: Lower bound of the onset, s; with ``latest``, it has 95 % of the evidence.
        latest: Upper bound of the onset, s.
        shown_by: Joints, sensors and signals that show the change, the clearest first.
        remaining: Hypotheses that are left, the best first: one of each kind and part.
    """

    time: float
    status: Status
    reason: str = ""
    onset: float | None = None
    earliest: float | None = None
    latest: float | None = None
    shown_by: tuple[str, ...] = ()
    remaining: tuple[Rated, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Returns the finding with texts and numbers alone, as JSON has it."""
        remaining = [{"hypothesis": str(r.hypothesis), "loss": r.loss} for r in self.remaining]
        return {**vars(self), "shown_by": list(self.shown_by), "remaining": remaining}

    @property
    def words(self) -> str:
        """The finding in plain words, without its time."""
        clauses = [self.reason] if self.reason else []
        if self.onset is not None:
            since = f"since t = {self.onset:.2f} s ({self.earliest:.2f} to {self.latest:.2f})"
            clauses.insert(0, since)
        if self.remaining:
            clauses.append("; ".join(rated.hypothesis.words for rated in self.remaining))
        elif self.shown_by:
            clauses.append(f"shown by {', '.join(self.shown_by)}")
        return f"{self.status}: {', '.join(clauses)}" if clauses else self.status

    def __str__(self) -> str:
        return f"{self.time:8.2f} s  {self.words}"
