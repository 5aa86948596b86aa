"""Problems: of trials, and with losses that are functions of the hypotheses, without physics."""

from collections.abc import Callable, Sequence
from types import SimpleNamespace

import numpy as np

from selfmodel.diagnosis.losses import LossFunction, LossTable
from selfmodel.diagnosis.problem import Problem, Refits
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import FaultKind
from selfmodel.progress import ignore
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.trial import Trial, TrialPart, trial_names, whole

HingeLosses = Callable[[Sequence[Hypothesis]], np.ndarray]


def problem_of(
    table: LossTable,
    robot: Robot,
    trials: Sequence[Trial],
    healthy: Sequence[Trial | TrialPart],
    kinds: Sequence[FaultKind],
    *,
    refit: Refits | None = None,
) -> Problem:
    """The problem of some trials of a robot."""
    return Problem(
        table,
        HypothesisSpace.of(kinds, robot.anatomy),
        [*map(TrialPart, trials)],
        table.surrogate(trials),
        [*map(whole, healthy)],
        trial_names(trials),
        Settings(),
        refit=refit,
    )


class Synthetic(Problem):
    """A problem of given losses.

    Args:
        space: The hypotheses.
        losses: Losses on the trials, ``(n, pieces)``.
        most: Faults of a hypothesis, at most.
        coarse: Losses by the surrogate; those on the trials by default.
        before: Losses on healthy trials.
        hinges: Losses of hinges on the trials, ``(n, pieces, hinges)``.
        hinges_before: Losses of hinges on healthy trials.
    """

    def __init__(
        self,
        space: HypothesisSpace,
        losses: LossFunction,
        *,
        most: int = 4,
        coarse: LossFunction | None = None,
        before: LossFunction | None = None,
        hinges: HingeLosses | None = None,
        hinges_before: HingeLosses | None = None,
    ) -> None:
        self.space, self.settings = space, Settings(genes=most)
        self.trials, self.healthy_trials, self._observed = ["damaged"], [], ["healthy"]
        self.losses, self.observer, self.refit = losses, ignore, None
        self.standing = frozenset[str]()
        self.coarse = coarse or losses
        self._before, self._hinges, self._hinges_before = before, hinges, hinges_before
        self.table = SimpleNamespace(by_hinge=self._by_hinge)
        self.has_joints, self._is_comparable, self.is_long = hinges is not None, True, False

    def healthy(self, hypotheses: Sequence[Hypothesis]) -> np.ndarray | None:
        """Returns the given losses."""
        return self._before(hypotheses) if self._before else None

    def _by_hinge(self, hypotheses: Sequence[Hypothesis], trials: object) -> np.ndarray | None:
        given = self._hinges_before if trials == ["healthy"] else self._hinges
        return given(hypotheses) if given else None
