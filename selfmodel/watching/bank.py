"""A bank of single faults, whose losses since a change are kept up to date segment by segment."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.comparators.segment_prediction import SegmentPrediction
from selfmodel.diagnosis import significance
from selfmodel.diagnosis.direct_evidence import observed_faults, standing_joints
from selfmodel.diagnosis.losses import LossTable
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.joints import LOCKED_LEG
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial, TrialPart
from selfmodel.watching.finding import Rated

AT_ONCE = 8
"""Hypotheses that are simulated in one control step, or as many as keep up with the segments."""

MAX_PIECES = 40
"""Segments since a change after which the hypotheses that are left are the answer."""


class Bank:
    """Hypotheses of one fault about a robot that changed, and ``INTACT``.

    Jams are at the angles at which the encoders end, and legs of which all joints stand may be
    locked. Two hypotheses are compared by the loss of the comparator plus that of the hinges that
    show the change, as far as both predict them: a fault of a joint changes the motion of that
    joint most. Those that are clearly worse than the best one are left out, and not simulated
    again. The trial ``since`` has the steps since the change, and the hinges, by column, show it.
    """

    def __init__(
        self,
        simulator: Simulator,
        comparator: SegmentPrediction,
        space: HypothesisSpace,
        since: Trial,
        hinges: Sequence[int],
    ) -> None:
        self._table, self.hinges = LossTable(simulator, comparator), list(hinges)
        self._horizon = comparator.horizon
        anatomy = space.anatomy
        standing = standing_joints([since], anatomy)
        observed = observed_faults([since], anatomy, standing)
        moving = {*LOCKED_LEG.parts(anatomy)} - {fault.part for fault in observed}
        space = replace(space, observed=observed).without(LOCKED_LEG, moving)
        self._left = [INTACT, *space.with_one_more(INTACT)]
        self._compared: list[TrialPart] = []
        self._new: list[TrialPart] = []
        self._work = self._compare()
        self._losses: Mapping[Hypothesis, FloatArray] = {}

    @property
    def segments(self) -> int:
        """Number of segments by which the hypotheses were compared."""
        return len(self._compared)

    def add(self, segment: TrialPart) -> None:
        """Adds a segment since the change, unless there are enough."""
        if self.segments + len(self._new) < MAX_PIECES:
            self._new.append(segment)

    @property
    def is_busy(self) -> bool:
        """Whether there are segments by which the hypotheses are not compared yet."""
        return bool(self._new)

    def advance(self) -> Sequence[Rated]:
        """Simulates a few hypotheses, and once all were, returns those that are left, best first.

        What is left is not significantly worse than the best. Of those that differ in severities
        alone, the best one is returned. A segment in which all simulations diverge says nothing.
        """
        return next(self._work)

    def _compare(self) -> Iterator[Sequence[Rated]]:
        while True:
            while not self._new:
                yield ()
            every, new = list(dict.fromkeys([*self._left, INTACT])), [*self._new]
            size = max(AT_ONCE, math.ceil(len(every) / self._horizon))
            for part in new:
                for first in range(0, len(every), size):
                    yield ()
                    self._table.losses(every[first : first + size], [part])
            finite = [part for part in new if self._is_finite(every, part)]
            del self._new[: len(new)]
            self._compared += finite
            yield self._rated(every, self._compared) if finite else ()

    def _is_finite(self, every: Sequence[Hypothesis], part: TrialPart) -> bool:
        return bool(np.isfinite(self._table.losses(every, [part])).any())

    def _rated(self, every: Sequence[Hypothesis], segments: Sequence[TrialPart]) -> list[Rated]:
        """Returns the hypotheses that are left, and forgets the others."""
        losses, by_hinge = (
            self._table.losses(every, segments),
            self._table.by_hinge(every, segments),
        )
        at_hinges = np.array(by_hinge)[:, :, self.hinges]
        # The first row is of the comparator, the others are of hinges, (1 + hinges, pieces).
        rows = np.concatenate([losses[:, np.newaxis], at_hinges.swapaxes(1, 2)], axis=1)
        self._losses = dict(zip(every, rows, strict=True))
        order = sorted(self._left, key=lambda one: float(self._losses[one][0].sum()))
        best = order[0]
        for one in order:
            own, other = self.compared(one, best)
            best = one if own.sum() < other.sum() else best
        leads = {one: significance.lead(*self.compared(best, one)) for one in [best, *order]}
        self._left = [one for one, lead in leads.items() if lead < significance.MIN_Z_OF_CHANGE]
        rated = dict[object, Rated]()
        for one, lead in leads.items():
            if lead < significance.MIN_Z:
                loss = float(self._losses[one][0].mean())
                rated.setdefault(one.without_severities, Rated(one, loss))
        return list(rated.values())

    def compared(self, one: Hypothesis, other: Hypothesis) -> FloatArray:
        """Returns the losses by which two hypotheses are compared, ``(2, pieces)``."""
        both = np.array([self._losses[one], self._losses[other]])
        return np.asarray(np.where(np.isnan(both).any(axis=0), 0.0, both).sum(axis=1))
