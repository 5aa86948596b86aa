"""Counts of a campaign, by target."""

from collections import Counter
from dataclasses import dataclass, field

from tests.fuzz.oracle import Verdict


@dataclass
class Tally:
    """Counts of one target.

    Attributes:
        outcomes: Number of cases by outcome.
        findings: Number of cases by place of the finding.
        seconds: CPU time of all checks, s.
        slowest: Largest CPU time of a case, s.
        megabytes: Largest growth of the memory by a case, 10^6 bytes.
    """

    outcomes: Counter[str] = field(default_factory=Counter)
    findings: Counter[str] = field(default_factory=Counter)
    seconds: float = 0.0
    slowest: float = 0.0
    megabytes: float = 0.0

    @property
    def cases(self) -> int:
        """Number of cases."""
        return self.outcomes.total() + self.findings.total()

    def add(self, verdict: Verdict) -> None:
        """Counts a case."""
        if verdict.problem:
            self.findings[verdict.place] += 1
        else:
            self.outcomes[verdict.outcome] += 1
        self.seconds += verdict.seconds
        self.slowest = max(self.slowest, verdict.seconds)
        self.megabytes = max(self.megabytes, verdict.megabytes)
