"""The problem of a diagnosis: the trials to explain, healthy ones, and hypotheses about them."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis import significance
from selfmodel.diagnosis.direct_evidence import observed_faults, standing_joints
from selfmodel.diagnosis.losses import LossTable, Parts
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.joints import LOCKED_LEG, SERVO_GAIN, WEAK_MOTOR
from selfmodel.faults.kind import Fault
from selfmodel.progress import Observer, ignore
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.trial import Trial, TrialPart, observed_as, whole

Refits = Callable[[Sequence[Trial], Sequence[Hypothesis]], Robot]
"""Fits the self-model again, to trials and the faults of the robot in each."""

MIN_SURROGATE_PIECES = 2
"""Pieces of the surrogate comparator that a search in a part of the trials needs."""

TOLD_APART = (0.2, 0.5)
"""Severities at which the gain of a servo is compared with the torque of its motor."""

SAME_MOVEMENT = 0.05
"""Largest root mean square difference of each motor's commands, step by step, relative to their
deviation, in one movement. The model then has the same error: of 36 healthy synthetic servos with
friction that no model has, which repeated a movement, the largest contrast was 0.6; with 0.8 times
its amplitude it was 4.2, and at twice its frequency 11."""


@dataclass(eq=False)
class Problem:
    """Trials to explain, or parts of them, and the losses of hypotheses about them.

    Jams at the angles at which the encoders end are added to the hypotheses. Left out are legs of
    which a joint moves, and gains of servos that equal weak motors in the trials.

    Attributes:
        surrogate: Losses of the surrogate comparator, and its trials; see ``LossTable.surrogate``.
        names: Names of the trials of the whole diagnosis, by path.
        refit: Fits the self-model again; None for one that is given as it is.
        healthy_parts: Parts of trials before a change, in which the robot was healthy.
        standing: Joints that stand in the trials though they are commanded to move, with which the
            search begins; none if the comparator does not predict segments.
    """

    table: LossTable
    space: HypothesisSpace
    trials: Sequence[TrialPart]
    surrogate: tuple[LossTable, Parts]
    healthy_trials: Sequence[TrialPart]
    names: Mapping[str, str]
    settings: Settings
    refit: Refits | None = None
    healthy_parts: Sequence[TrialPart] = ()
    observer: Observer = ignore
    standing: frozenset[str] = field(init=False)
    _is_comparable: bool = field(init=False)
    _refits: "dict[Hypothesis, Problem | None]" = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        trials, anatomy = [part.rows for part in self.trials], self.space.anatomy
        standing = standing_joints(trials, anatomy)
        # A comparator that reads no encoders would owe its diagnoses to them.
        self.standing = standing if self.table.uses_segments(trials) else frozenset()
        shown = observed_faults(trials, anatomy, standing)
        space = replace(self.space, observed=shown, left_out=frozenset())
        moving = {*LOCKED_LEG.parts(space.anatomy)} - {fault.part for fault in shown}
        self.space = self._told_apart(space.without(LOCKED_LEG, moving))
        # Closed-loop windows are correlated, and not compared with those of healthy trials.
        every = [part.trial for part in (*self.healthy_trials, *self.trials)]
        is_comparable = self.table.is_piecewise(every) and self.table.uses_segments(every)
        self._is_comparable = is_comparable and len(self.healthy_trials) > 0

    @property
    def healthy_motions(self) -> list[TrialPart]:
        """Healthy trials, and healthy parts of the trials to explain."""
        return [*self.healthy_trials, *self.healthy_parts]

    @cached_property
    def is_long(self) -> bool:
        """Whether a trial is so long that parts of it are simulated alone."""
        return self.table.has_sections([part.trial for part in self.trials])

    def _told_apart(self, space: HypothesisSpace) -> HypothesisSpace:
        """Returns the hypotheses without gains of servos of which no prediction reaches a limit."""
        is_asked = SERVO_GAIN in space.kinds or SERVO_GAIN.suits(space.anatomy)
        parts = space.parts(SERVO_GAIN) if is_asked and WEAK_MOTOR in space.kinds else ()
        alike = []
        for part in parts:
            kinds = (WEAK_MOTOR, SERVO_GAIN)
            faults = [Fault(kind, part, value) for kind in kinds for value in TOLD_APART]
            losses = self.losses([Hypothesis((fault,)) for fault in faults])
            one, other = np.split(losses, 2)
            if np.isfinite(losses).all() and np.array_equal(one, other):
                alike.append(part)
        return space.without(SERVO_GAIN, alike)

    def within(
        self,
        cut: Callable[[Sequence[Trial]], Sequence[TrialPart]],
        healthy_trials: Sequence[TrialPart] = (),
    ) -> "Problem | None":
        """Returns the problem of a part of the trials; None if the surrogate has too few pieces.

        ``healthy_trials`` are the parts of the trials in which the robot was healthy; they are the
        reference if there are no trials of the healthy robot.
        """
        table, coarse = self.surrogate[0], cut([whole(one).trial for one in self.surrogate[1]])
        if table.losses([INTACT], coarse).shape[1] < MIN_SURROGATE_PIECES:
            return None
        return replace(
            self,
            trials=cut([part.trial for part in self.trials]),
            surrogate=(table, coarse),
            healthy_trials=self.healthy_trials or healthy_trials,
            healthy_parts=healthy_trials,
        )

    def refitted(self, hypothesis: Hypothesis) -> "Problem | None":
        """Returns this problem by the self-model that is fitted to the healthy trials and these.

        In these, the robot has the faults of the hypothesis. The surrogate has the self-model of
        before. None for one that is given as it is, and if the trials are too short for a fit.
        """
        if hypothesis not in self._refits:
            every = [part.rows for part in (*self.healthy_trials, *self.trials)]
            faults = [INTACT] * len(self.healthy_trials) + [hypothesis] * len(self.trials)
            found = None
            if self.refit is not None:
                with suppress(InputError):
                    found = replace(self, table=self.table.of_robot(self.refit(every, faults)))
            self._refits[hypothesis] = found
        return self._refits[hypothesis]

    def losses(self, hypotheses: Sequence[Hypothesis]) -> FloatArray:
        """Returns the losses on the trials to explain, ``(n, pieces)``."""
        return self.table.compared(hypotheses, self.trials)

    def coarse(self, hypotheses: Sequence[Hypothesis]) -> FloatArray:
        """Returns the losses on the same trials by the surrogate, ``(n, fewer pieces)``."""
        table, trials = self.surrogate
        return table.compared(hypotheses, trials)

    def healthy(self, hypotheses: Sequence[Hypothesis]) -> FloatArray | None:
        """Returns the losses on healthy trials, ``(n, healthy pieces)``.

        The result is None without healthy trials, or if the losses are correlated over a trial and
        so not comparable between trials.
        """
        if not self._is_comparable:
            return None
        return self.table.losses(hypotheses, self.healthy_trials)

    def contrast(self, hypothesis: Hypothesis) -> float:
        """Returns by how many standard errors a fault gains more here than on healthy trials.

        Those are the trials with the same movement: one robot in both, however wrong its model,
        gains about as much in either. 0 for several faults, without such a healthy trial for each
        trial, and with a free base: contacts make two trials of one robot differ.
        """
        if len(hypothesis) != 1 or self.space.anatomy.floating_base or not self._repeated:
            return 0.0
        pair = [hypothesis, INTACT]
        return significance.contrast(*self.losses(pair), *self.table.losses(pair, self._repeated))

    @cached_property
    def _repeated(self) -> list[TrialPart]:
        """Healthy trials whose movements those to explain repeat; none if one repeats none."""
        is_repeated = [
            [self._is_comparable and _repeats(part.trial, own.trial) for own in self.healthy_trials]
            for part in self.trials
        ]
        every = [*zip(self._observed, *is_repeated, strict=True)]
        return [own for own, *by in every if any(by)] if all(map(any, is_repeated)) else []

    @cached_property
    def reference(self) -> FloatArray | None:
        """Losses of the empty hypothesis on all healthy trials, ``(pieces,)``; None without any.

        Encoders that are lost in the trials to explain are left out of the healthy ones.
        """
        rows = [losses for _, losses in self._references]
        return np.concatenate(rows) if rows else None

    def suffices(self, hypothesis: Hypothesis) -> bool:
        """Returns whether joints stand, and a hypothesis predicts the trials as the healthy ones.

        That is, as well as the empty hypothesis predicts the healthy trials. Weak faults beside it
        do not show in that.
        """
        if not self.standing or not len(hypothesis) or self.reference is None:
            return False
        excess = significance.excess_over_healthy(self.losses([hypothesis])[0], self.reference)
        return excess < significance.MIN_Z

    @cached_property
    def standing_parts(self) -> frozenset[str]:
        """Parts whose faults may stop the joints that stand: these, and their limbs."""
        parts = {*self.standing}
        for name, limb in self.space.anatomy.limbs.items():
            joints = {joint.name for joint in limb}
            if not self.standing.isdisjoint(joints):
                parts |= {name, *joints}
        return frozenset(parts)

    @property
    def hardest(self) -> float:
        """Largest mean loss of the empty hypothesis on a healthy trial; 0 without any."""
        return max((float(losses.mean()) for _, losses in self._references), default=0.0)

    @cached_property
    def _references(self) -> list[tuple[TrialPart, FloatArray]]:
        rows = [(part, self.table.losses([INTACT], [part])[0]) for part in self._observed]
        return [(part, row) for part, row in rows if len(row)]  # before a change may be no piece

    def expected(self, hypothesis: Hypothesis) -> FloatArray | None:
        """Returns the losses to expect of the right hypothesis in another gait than the healthy.

        They are those of the healthy trial for which they are largest: its own, times the relative
        sensitivity of the trials to explain. None without healthy trials.
        """
        rows = [
            self._relative_sensitivity(hypothesis, part) * losses
            for part, losses in self._references
        ]
        return max(rows, key=np.mean, default=None)

    def _relative_sensitivity(self, hypothesis: Hypothesis, healthy: TrialPart) -> float:
        """Returns the sensitivity of the trials to explain over that of a healthy trial.

        It is at least 1, and 1 with a fixed base: no contacts make an error grow.
        """
        if self.space.anatomy.floating_base:
            here = self.table.sensitivity(self.trials, hypothesis)
            there = self.table.sensitivity([healthy])
            return max(here / there, 1.0) if here and there else 1.0
        return 1.0

    @cached_property
    def has_joints(self) -> bool:
        """Whether the comparator predicts the motion of single joints."""
        return self.table.by_hinge([INTACT], self.trials) is not None

    def of_joint(
        self, joint: str, hypotheses: Sequence[Hypothesis], *, healthy: bool = False
    ) -> FloatArray:
        """Returns the losses of the motion of a joint on the trials to explain, ``(n, pieces)``.

        A loss is the mean over the known hinges of the joint, and NaN where all are unknown, as for
        a hypothesis that detaches the joint. Without healthy trials there are no pieces of them.
        """
        is_known = self._is_comparable or not healthy
        trials = self._observed if healthy else self.trials
        by_hinge = self.table.by_hinge(hypotheses, trials) if is_known else None
        if by_hinge is None:
            return np.empty((len(hypotheses), 0))
        anatomy = self.space.anatomy
        columns = [anatomy.hinges.index(one) for one in anatomy.joint(joint).hinges]
        losses = by_hinge[:, :, columns]
        known = ~np.isnan(losses)
        count = known.sum(axis=2)
        total = np.where(known, losses, 0.0).sum(axis=2)
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)

    @cached_property
    def _observed(self) -> list[TrialPart]:
        """Healthy trials without the encoders that are lost in the trials to explain."""
        others = [part.trial for part in self.trials]
        return [
            replace(part, trial=observed_as(part.trial, others)) for part in self.healthy_trials
        ]


def _repeats(one: Trial, other: Trial) -> bool:
    """Returns whether a trial has the commands of another at all its steps; see SAME_MOVEMENT."""
    commands, repeated = one.trajectory["commands"], other.trajectory["commands"]
    steps = min(len(commands), len(repeated))
    if steps < (1 - SAME_MOVEMENT) * len(commands):
        return False
    commands, repeated = commands[:steps], repeated[:steps]
    difference = np.sqrt(np.square(commands - repeated).mean(axis=0))
    return bool((difference <= SAME_MOVEMENT * repeated.std(axis=0)).all())
