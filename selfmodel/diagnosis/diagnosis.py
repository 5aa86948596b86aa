"""A diagnosis: hypotheses ranked by distance to all trials, and a verdict on the best."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from selfmodel.arrays import data_frame
from selfmodel.diagnosis.verdicts.change_point import Change
from selfmodel.diagnosis.verdicts.detectable import DetectableSeverity
from selfmodel.diagnosis.verdicts.fit import Fit
from selfmodel.diagnosis.verdicts.residual import Residual
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.trials.trial import Trial, whole

Verdict = Literal["intact", "explained", "ambiguous", "unexplained"]
"""Verdicts on the best hypothesis.

``intact``: the empty hypothesis predicts the trials about as well as the self-model predicts the
healthy robot, and no other hypothesis except ``undetectable`` ones does. ``explained``: the same
for a hypothesis with faults. ``ambiguous``: other hypotheses are indistinguishable from the best.
``unexplained``: the best hypothesis predicts significantly worse than the self-model predicts the
healthy robot, or significantly worse than with a fault of an unsearched kind, so a fault is
missing; requires a trial of the healthy robot. A diagnosis is also ``unexplained`` if the
simulation of every hypothesis diverged."""


@dataclass(frozen=True)
class Candidate:
    """A hypothesis and its distance to the trials.

    Attributes:
        hypothesis: In canonical form.
        distance: Sum over the trials of the comparator's distance, in the comparator's unit.
    """

    hypothesis: Hypothesis
    distance: float

    def to_dict(self) -> dict[str, Any]:
        """Returns the JSON values; the distance is None where a simulation diverged."""
        return {"hypothesis": str(self.hypothesis), "distance": _finite(self.distance)}


@dataclass(frozen=True)
class UnsearchedFault:
    """A hypothesis with one fault of an unsearched kind.

    Attributes:
        hypothesis: The complete hypothesis, including the fault of the unsearched kind.
        kind: Name of the unsearched kind.
        others: The best hypothesis of each other unsearched kind that predicts the trials
            significantly better too, by the kind's name.
    """

    hypothesis: Hypothesis
    kind: str
    others: Mapping[str, Hypothesis] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Returns the JSON values."""
        others = {kind: str(hypothesis) for kind, hypothesis in self.others.items()}
        return {
            "hypothesis": str(self.hypothesis),
            "kind": self.kind,
            **({"others": others} if others else {}),
        }


@dataclass(frozen=True)
class Diagnosis:
    """Hypotheses ranked against some trials, and a verdict.

    Attributes:
        ranked: Candidates, at least one. The first is the best: the hypothesis with the fewest
            faults, each of which makes the prediction significantly better; for a comparator
            without a significance test, the one with the smallest distance. The others follow by
            distance, at equal distances by number of faults. Of hypotheses that differ in
            severities alone, only the first is ranked.
        trials: Number of trials.
        intact_distance: Distance of the empty hypothesis.
        indistinguishable: Hypotheses not significantly worse than the best, smallest distance
            first; of those that differ in severities alone, only the first.
        verdict: ``intact``, ``explained``, ``ambiguous`` or ``unexplained``; see ``Verdict``.
        test: Name of the test behind ``indistinguishable``.
        unsearched: The best hypothesis with a fault of an unsearched kind, if it predicts the
            trials significantly better; see ``unsearched.best_unsearched_fault``.
        undetectable: The best hypothesis with one more fault, for each undetectable fault,
            smallest distance first, at most as many as are ranked; see
            ``undetectable.undetectable_faults``.
        detectable: Smallest detectable severities of each kind and part, if the best hypothesis
            is the empty one; see ``detectable.detectable_severities``.
        fit: Numbers behind the verdict; None if every simulation diverged.
        change: Change of the robot during the trials; the diagnosis is about the time after it.
            None if one hypothesis is enough.
        residual: Signals and time of the loss that is left, if it is unexplained.
        reason: Cause of the verdict and remedy, if every simulation diverged; else empty.
    """

    ranked: tuple[Candidate, ...]
    trials: int
    intact_distance: float
    indistinguishable: tuple[Hypothesis, ...]
    verdict: Verdict
    test: str
    unsearched: UnsearchedFault | None = None
    undetectable: tuple[Hypothesis, ...] = ()
    reason: str = ""
    detectable: tuple[DetectableSeverity, ...] = ()
    fit: Fit | None = None
    change: Change | None = None
    residual: Residual | None = None

    @property
    def best(self) -> Hypothesis:
        """The best hypothesis."""
        return self.ranked[0].hypothesis

    def explained(self, trials: Sequence[Trial]) -> list[Trial]:
        """Returns the rows of the trials that the diagnosis is about: those after a change.

        Args:
            trials: The trials of the diagnosis.
        """
        if self.change is None:
            return list(trials)
        return [whole(part).rows for part in self.change.since(trials)]

    def __repr__(self) -> str:
        count = f"{self.trials} {'trial' if self.trials == 1 else 'trials'}"
        lines = [f"<Diagnosis of {count}: {self.best}, {self.verdict}"]
        lines += [f"  {one.distance:10.4f}  {one.hypothesis}" for one in self.ranked]
        for name in ("indistinguishable", "undetectable"):
            others = ", ".join(map(str, getattr(self, name)))
            lines += [f"  {name}: {others}"] if others else []
        if self.unsearched is not None:
            lines.append(f"  unsearched: {self.unsearched.hypothesis} ({self.unsearched.kind})")
        lines += [f"  {self.change}"] if self.change else []
        lines += [f"  reason: {self.reason}"] if self.reason else []
        return "\n".join(lines) + ">"

    def to_dict(self) -> dict[str, Any]:
        """Returns the JSON values of a run's ``diagnoses.json``.

        The keys ``rivals``, ``unseen`` and ``outside`` are those of a published format; they hold
        the attributes ``indistinguishable``, ``undetectable`` and ``unsearched``.
        """
        return {
            "trials": self.trials,
            "intact_distance": _finite(self.intact_distance),
            "rivals": [str(hypothesis) for hypothesis in self.indistinguishable],
            "unseen": [str(hypothesis) for hypothesis in self.undetectable],
            "verdict": self.verdict,
            "test": self.test,
            "outside": self.unsearched.to_dict() if self.unsearched else None,
            "ranked": [candidate.to_dict() for candidate in self.ranked],
            **({"reason": self.reason} if self.reason else {}),
            **({"fit": self.fit.to_dict()} if self.fit else {}),
            **({"residual": self.residual.to_dict()} if self.residual else {}),
            **({"change": self.change.to_dict()} if self.change else {}),
            **(
                {"detectable": [one.to_dict() for one in self.detectable]}
                if self.detectable
                else {}
            ),
        }

    def to_pandas(self) -> Any:  # noqa: ANN401  # pandas is optional
        """Returns the ranking as a ``pandas.DataFrame``: hypothesis and distance, best first.

        Raises:
            InputError: pandas is not installed.
        """
        return data_frame([candidate.to_dict() for candidate in self.ranked])


def _finite(distance: float) -> float | None:
    """JSON has no infinity, which is the distance of a simulation that diverged."""
    return distance if math.isfinite(distance) else None
