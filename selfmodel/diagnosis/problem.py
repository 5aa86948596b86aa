"""The problem of a diagnosis: trials to explain, hypotheses about them, and their losses."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis.losses import LossTable
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.joints import JAMMED_AT_ANGLE
from selfmodel.faults.kind import Fault
from selfmodel.robot.anatomy import Anatomy
from selfmodel.settings import Settings
from selfmodel.simulation.requests import END
from selfmodel.trials.trial import Trial, TrialPart, observed_as, whole

LossFunction = Callable[[Sequence[Hypothesis]], FloatArray]
"""Returns the losses of some hypotheses, ``(n, pieces)``; inf where a simulation diverged."""

Parts = Sequence[Trial | TrialPart]

MAX_JAM_SPREAD = 0.05
"""Largest difference between the angles of the hinges of one jammed joint, rad."""


class Problem:
    """Trials to explain, or parts of them, and the losses of hypotheses about them.

    Jams at the angles at which the encoders end are added to the hypotheses.

    Args:
        table: Losses of the comparator.
        space: The hypotheses about the robot.
        trials: Trials to explain, or parts of them.
        surrogate: Losses of the surrogate comparator, and its trials; see ``LossTable.surrogate``.
        healthy_trials: Trials of the healthy robot, or parts of them.
        names: Names of the trials of the whole diagnosis, by path.
        settings: Parameters of the search.
    """

    def __init__(
        self,
        table: LossTable,
        space: HypothesisSpace,
        trials: Parts,
        *,
        surrogate: tuple[LossTable, Parts],
        healthy_trials: Parts,
        names: Mapping[str, str],
        settings: Settings,
    ) -> None:
        self.table, self.trials, self.healthy_trials, self.names = (
            table,
            trials,
            healthy_trials,
            names,
        )
        jams = observed_jams([whole(trial).rows for trial in trials], space.anatomy)
        self.space = replace(space, observed=jams)
        self.max_faults, self.kept = settings.genes, settings.kept
        self._surrogate = surrogate
        known = [whole(trial).trial for trial in (*healthy_trials, *trials)]
        # Closed-loop windows are correlated, and not compared with those of healthy trials.
        is_comparable = table.is_piecewise(known) and table.uses_segments(known)
        self._comparable: Parts = healthy_trials if is_comparable else ()

    def losses(self, hypotheses: Sequence[Hypothesis]) -> FloatArray:
        """Returns the losses on the trials to explain, ``(n, pieces)``."""
        return self.table.losses(hypotheses, self.trials)

    def coarse(self, hypotheses: Sequence[Hypothesis]) -> FloatArray:
        """Returns the losses on the same trials by the surrogate, ``(n, fewer pieces)``."""
        table, trials = self._surrogate
        return table.losses(hypotheses, trials)

    def healthy(self, hypotheses: Sequence[Hypothesis]) -> FloatArray | None:
        """Returns the losses on healthy trials, ``(n, healthy pieces)``.

        The result is None without healthy trials, or if the losses are correlated over a trial and
        so not comparable between trials.
        """
        return self.table.losses(hypotheses, self._comparable) if self._comparable else None

    @cached_property
    def reference(self) -> FloatArray | None:
        """Losses of the empty hypothesis on all healthy trials, ``(pieces,)``; None without any.

        Encoders that are lost in the trials to explain are left out of the healthy ones.
        """
        if not self.healthy_trials:
            return None
        return np.asarray(self.table.losses([INTACT], self._observed(self.healthy_trials))[0])

    @cached_property
    def has_joints(self) -> bool:
        """Whether the comparator predicts the motion of single joints."""
        return self.table.by_hinge([INTACT], self.trials) is not None

    def of_joint(self, joint: str, hypotheses: Sequence[Hypothesis]) -> FloatArray:
        """Returns the losses of the motion of a joint on the trials to explain, ``(n, pieces)``.

        A loss is NaN where it is unknown, as it is for a hypothesis that detaches the joint.
        """
        return self._of_joint(joint, hypotheses, self.trials)

    def healthy_of_joint(self, joint: str, hypotheses: Sequence[Hypothesis]) -> FloatArray:
        """Returns the losses of a joint on healthy trials; without any there are no pieces."""
        if not self._comparable:
            return np.empty((len(hypotheses), 0))
        return self._of_joint(joint, hypotheses, self._observed_comparable)

    @cached_property
    def _observed_comparable(self) -> Parts:
        return self._observed(self._comparable)

    def _of_joint(self, joint: str, hypotheses: Sequence[Hypothesis], trials: Parts) -> FloatArray:
        """Returns the mean over the known hinges of a joint, ``(n, pieces)``; NaN without any."""
        by_hinge = self.table.by_hinge(hypotheses, trials)
        if by_hinge is None:
            return np.empty((len(hypotheses), 0))
        anatomy = self.space.anatomy
        columns = [anatomy.hinges.index(hinge) for hinge in anatomy.joint(joint).hinges]
        some = by_hinge[:, :, columns]
        is_known = ~np.isnan(some)
        count = is_known.sum(axis=2)
        total = np.where(is_known, some, 0.0).sum(axis=2)
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)

    def _observed(self, healthy: Parts) -> list[TrialPart]:
        """Returns healthy trials without the encoders that are lost in the trials to explain."""
        observed = [whole(trial).trial for trial in self.trials]
        return [replace(one, trial=observed_as(one.trial, observed)) for one in map(whole, healthy)]


def by_total_loss(hypotheses: Sequence[Hypothesis], losses: LossFunction) -> list[Hypothesis]:
    """Returns hypotheses sorted by the sum of their losses, smallest first; the sort is stable."""
    if not hypotheses:
        return []
    order = np.argsort(losses(hypotheses).sum(axis=1), kind="stable")
    return [hypotheses[i] for i in order]


def observed_jams(trials: Sequence[Trial], anatomy: Anatomy) -> tuple[Fault, ...]:
    """Returns for every joint a jam at the angle at which its encoders end.

    The coarse levels of a jam's angle are tenths of a radian apart. Between two of them, a motor
    without torque predicts a short segment better than the jam: each segment begins at the logged
    angle. The encoder contains the angle, whether the joint is jammed or not.

    Args:
        trials: Trials to explain, or the rows of parts of them; the last one counts.
        anatomy: The robot's parts.

    Returns:
        Faults of the kind ``jam-angle``, in the order of the joints, without joints whose encoders
        are unknown and joints whose hinges end at different angles.
    """
    if not trials:
        return ()
    behaviour = trials[-1].behaviour
    angles = behaviour["joint_positions"][round((1 - END) * behaviour.steps) :]
    ends = {
        hinge: float(np.median(known)) if len(known) else np.nan
        for hinge, column in zip(behaviour.names.hinges, angles.T, strict=True)
        for known in (column[np.isfinite(column)],)
    }
    jams = []
    for joint in JAMMED_AT_ANGLE.parts(anatomy):
        found = [ends[hinge] for hinge in anatomy.joint(joint).hinges]
        if np.isfinite(found).all() and np.ptp(found) <= MAX_JAM_SPREAD:
            lows, highs = zip(*anatomy.joint(joint).limits, strict=True)
            angle = min(max(round(float(np.mean(found)), 3) + 0.0, *lows), *highs)
            jams.append(Fault(JAMMED_AT_ANGLE, joint, angle))
    return tuple(jams)
