"""Promises of the losses of single joints: excess over healthy trials, and distinction."""

from collections.abc import Sequence

import numpy as np
import pytest

from selfmodel.diagnosis.joint_losses import HingeLosses, JointLosses, joint_is_better
from selfmodel.diagnosis.verdicts.change_point import MIN_PIECES
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.tasks import ROBOTS
from tests.diagnosis.search.test_refine import ANATOMY, said

PIECES = 80
KNEE, SHOULDER = "front_left_knee", "front_left_shoulder"
WEAK, STIFF = said(f"motor:{KNEE}=0.3"), said(f"joint-friction:{KNEE}=0.2")


def hinge_losses(seed: int, worse: dict[str, dict[Hypothesis, float]] | None = None) -> HingeLosses:
    """Losses that vary over the pieces, equally for all hypotheses, and more for some joints.

    Args:
        seed: Seed of the variation.
        worse: Further loss by joint and hypothesis; NaN for no evidence.
    """
    noise = np.random.default_rng(seed).exponential(0.1, (PIECES, len(ANATOMY.hinges)))
    own = np.random.default_rng(seed + 1).normal(0, 0.02, (PIECES, len(ANATOMY.hinges)))

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        rows = np.array([noise + own * (hypothesis != INTACT) for hypothesis in hypotheses])
        for joint, more in (worse or {}).items():
            for row, hypothesis in zip(rows, hypotheses, strict=True):
                for hinge in ANATOMY.joint(joint).hinges:
                    row[:, ANATOMY.hinges.index(hinge)] += more.get(hypothesis, 0.0)
        return rows

    return losses


def test_the_joint_with_the_largest_excess_is_the_first():
    joints = JointLosses(
        ANATOMY,
        damaged=hinge_losses(1, {KNEE: {INTACT: 0.3}, SHOULDER: {INTACT: 0.1}}),
        healthy=hinge_losses(5),
    )

    excess = joints.excess(INTACT)

    assert list(excess)[:2] == [KNEE, SHOULDER]
    assert set(excess) == {joint.name for joint in ANATOMY.joints}
    assert list(excess.values()) == sorted(excess.values(), reverse=True)
    assert excess[KNEE] > 10
    assert max(z for name, z in excess.items() if name not in (KNEE, SHOULDER)) < 3


def test_the_reference_is_the_intact_robot_on_the_healthy_trials():
    worse_if_weak = {KNEE: {WEAK: 0.3}}
    joints = JointLosses(ANATOMY, hinge_losses(1, worse_if_weak), hinge_losses(5, worse_if_weak))

    assert joints.excess(WEAK)[KNEE] > 10
    assert joints.excess(INTACT)[KNEE] < 3


def test_without_healthy_trials_there_is_no_excess():
    joints = JointLosses(ANATOMY, hinge_losses(1), None)

    assert joints.excess(INTACT) == {}
    assert joints.healthy_of(KNEE, [INTACT, WEAK]).shape == (2, 0)


def test_a_joint_without_evidence_has_no_excess():
    unknown = hinge_losses(1, {KNEE: {INTACT: np.nan}})

    assert KNEE not in JointLosses(ANATOMY, unknown, hinge_losses(5)).excess(INTACT)
    assert KNEE not in JointLosses(ANATOMY, hinge_losses(1), unknown).excess(INTACT)


def test_hypotheses_are_distinguished_at_the_joints_where_their_faults_differ():
    elsewhere = {SHOULDER: {STIFF: 0.3}}
    there = {KNEE: {STIFF: 0.3}}

    assert JointLosses(ANATOMY, hinge_losses(1, there), None).distinguishes(WEAK, [STIFF]).all()
    assert not JointLosses(ANATOMY, hinge_losses(1, elsewhere), None).distinguishes(WEAK, [STIFF])
    assert not JointLosses(ANATOMY, hinge_losses(1, there), None).distinguishes(STIFF, [WEAK])


def test_a_hypothesis_without_evidence_on_a_joint_is_not_distinguished_by_it():
    broken = said(f"break:{KNEE}")
    joints = JointLosses(ANATOMY, hinge_losses(1, {KNEE: {broken: np.nan}}), None)

    assert list(joints.distinguishes(WEAK, [broken])) == [False]
    assert list(joints.distinguishes(broken, [WEAK])) == [False]
    assert len(joints.distinguishes(WEAK, [])) == 0


@pytest.mark.parametrize(("pieces", "better"), [(MIN_PIECES - 1, False), (MIN_PIECES, True)])
def test_a_few_pieces_are_no_evidence(pieces: int, *, better: bool):
    one = np.full(PIECES, np.nan)
    one[:pieces] = np.linspace(0.1, 0.2, pieces)

    assert joint_is_better(one, np.linspace(1, 2, PIECES)) == better
    assert not joint_is_better(np.linspace(1, 2, PIECES), one)


def test_a_diverged_hypothesis_is_worse_and_never_better():
    finite, diverged = np.ones(PIECES), np.full(PIECES, np.inf)

    assert joint_is_better(finite, diverged)
    assert not joint_is_better(diverged, finite)
    assert not joint_is_better(diverged, diverged)


def test_the_loss_of_a_joint_of_several_hinges_is_their_mean():
    anatomy = ROBOTS["hexapod"].robot().anatomy
    joint = next(joint for joint in anatomy.joints if len(joint.hinges) > 1)
    first = anatomy.hinges.index(joint.hinges[0])

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        rows = np.zeros((len(hypotheses), PIECES, len(anatomy.hinges)))
        rows[:, :, first] = 1.0
        return rows

    assert np.all(
        JointLosses(anatomy, losses, None).of(joint.name, [INTACT]) == 1 / len(joint.hinges)
    )
