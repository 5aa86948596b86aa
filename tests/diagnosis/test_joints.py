"""Promises of the search for faults of single joints, on synthetic losses without physics.

The total loss hardly depends on the faults. The loss of a joint is a bowl around the true fault.
"""

from collections.abc import Sequence

import numpy as np
import pytest

from selfmodel.diagnosis.joints import excesses, lead_at_joints, with_joint_faults
from selfmodel.diagnosis.losses import LossFunction as Losses
from selfmodel.diagnosis.search import LocalSearch
from selfmodel.diagnosis.significance import MIN_Z
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.registry import KINDS
from selfmodel.tasks import ROBOTS
from tests.diagnosis.synthetic import HingeLosses, Synthetic
from tests.diagnosis.test_search import ANATOMY, said

PIECES = 80
KNEE, SHOULDER = "front_left_knee", "front_left_shoulder"
KINDS_OF_A_JOINT = ("break", "jam", "motor", "damping", "joint-friction", "encoder-offset")
SPACE = HypothesisSpace(ANATOMY, tuple(KINDS[name] for name in KINDS_OF_A_JOINT))


def bowl(truth: Hypothesis, seed: int = 0, steepness: float = 1.0) -> HingeLosses:
    """Losses of hinges that are least for the true fault of each joint.

    A wrong kind costs 0.5, a severity its distance from the true one; a broken joint has no
    evidence.
    """
    rng = np.random.default_rng(seed)
    noise = rng.exponential(0.1, (PIECES, len(ANATOMY.hinges)))
    ripple = rng.uniform(0.5, 1.5, (PIECES, len(ANATOMY.hinges)))

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        rows = []
        for hypothesis in hypotheses:
            row = noise.copy()
            for joint in ANATOMY.joints:
                off = distance(hypothesis, truth, joint.name)
                for hinge in joint.hinges:
                    column = ANATOMY.hinges.index(hinge)
                    row[:, column] += steepness * off * ripple[:, column]
            rows.append(row)
        return np.array(rows)

    return losses


def distance(hypothesis: Hypothesis, truth: Hypothesis, joint: str) -> float:
    """How wrong a hypothesis is about a joint; NaN if it breaks the joint."""
    faults, real = (
        {
            fault.kind.name: fault.severity
            for fault in one.faults
            if fault.part == joint and fault.kind.name in KINDS_OF_A_JOINT
        }
        for one in (hypothesis, truth)
    )
    if "break" in faults:
        return np.nan
    if faults.keys() != real.keys():
        return 0.5
    return sum(abs(faults[kind] - real[kind]) / (1 + real[kind]) for kind in real)


def total(of_faults: float = 0.0, required: str = "intact") -> Losses:
    """Total losses that vary at random with the hypothesis.

    Args:
        of_faults: Further loss of every hypothesis with faults.
        required: Faults without which the loss is larger.
    """
    needed = set(said(required).faults)

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        rows = []
        for hypothesis in hypotheses:
            rng = np.random.default_rng(list(str(hypothesis).encode()))
            more = of_faults * bool(hypothesis) + len(needed - set(hypothesis.faults))
            rows.append(rng.normal(1.0, 0.02, PIECES) + more)
        return np.array(rows)

    return losses


def searched(
    start: str,
    truth: str,
    *,
    losses: Losses | None = None,
    healthy: HingeLosses | None = None,
    most: int = 4,
    steepness: float = 1.0,
) -> Hypothesis:
    return of_hinges(
        start,
        bowl(said(truth), steepness=steepness),
        losses=losses,
        healthy=bowl(INTACT, seed=1) if healthy is None else healthy,
        most=most,
    )


def of_hinges(
    start: str,
    hinges: HingeLosses,
    *,
    losses: Losses | None = None,
    healthy: HingeLosses | None,
    most: int = 4,
) -> Hypothesis:
    problem = Synthetic(SPACE, losses or total(), most=most, hinges=hinges, hinges_before=healthy)
    return with_joint_faults(said(start), LocalSearch(problem))


def terms(hypothesis: Hypothesis) -> dict[str, float]:
    return {f"{fault.kind.name} {fault.part}": fault.severity for fault in hypothesis.faults}


@pytest.mark.parametrize(
    "truth", [f"motor:{KNEE}=0.37", f"damping:{KNEE}=8.0", f"joint-friction:{SHOULDER}=0.23"]
)
def test_a_fault_that_only_the_joint_shows_is_found_with_its_severity(truth: str):
    found, real = searched("intact", truth), said(truth)

    assert terms(found) == pytest.approx(terms(real), rel=0.05)


def test_one_fault_takes_the_place_of_two_that_imitate_it():
    truth = f"motor:{KNEE}=0.3"
    two = f"damping:{KNEE}=3.0+joint-friction:{KNEE}=0.1"
    of_one = bowl(said(truth))

    def damaged(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        return of_one([said(truth) if one == said(two) else one for one in hypotheses])

    found = of_hinges(two, damaged, healthy=bowl(INTACT, seed=1))

    assert terms(found) == pytest.approx(terms(said(truth)), rel=0.05)


def test_a_hypothesis_has_at_most_the_given_number_of_faults():
    truth = f"damping:{KNEE}=8.0+motor:{SHOULDER}=0.2"

    assert len(searched("intact", truth, most=1)) == 1


def test_a_fault_of_another_part_that_the_trials_require_is_kept():
    lost = "break:back_left_knee"
    found = searched(lost, f"{lost}+damping:{KNEE}=8.0", losses=total(required=lost))

    assert said(lost).faults[0] in found.faults
    assert terms(found) == pytest.approx(terms(said(f"{lost}+damping:{KNEE}=8.0")), rel=0.05)


def test_a_broken_joint_has_no_evidence_and_stays_broken():
    assert searched(f"break:{KNEE}", f"motor:{KNEE}=0.2") == said(f"break:{KNEE}")


def test_a_fault_that_makes_the_trials_worse_is_not_taken():
    assert searched("intact", f"damping:{KNEE}=8.0", losses=total(of_faults=1.0)) == INTACT


def test_a_fault_that_healthy_trials_show_too_is_model_error():
    truth = f"damping:{KNEE}=8.0"

    assert searched("intact", truth, healthy=bowl(said(truth), seed=1)) == INTACT


def test_without_healthy_trials_a_kind_is_replaced_and_no_fault_added():
    def found(start: str) -> Hypothesis:
        return of_hinges(start, bowl(said(f"damping:{KNEE}=8.0")), healthy=None)

    assert found("intact") == INTACT
    assert terms(found(f"motor:{KNEE}=0.6")) == pytest.approx({f"damping {KNEE}": 8.0}, rel=0.05)


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


def losses_of_joints(after: HingeLosses, before: HingeLosses | None) -> Synthetic:
    return Synthetic(SPACE, total(), hinges=after, hinges_before=before)


def test_the_joint_with_the_largest_excess_is_the_first():
    joints = losses_of_joints(
        hinge_losses(1, {KNEE: {INTACT: 0.3}, SHOULDER: {INTACT: 0.1}}), hinge_losses(5)
    )

    excess = excesses(INTACT, joints)

    assert list(excess)[:2] == [KNEE, SHOULDER]
    assert set(excess) == {joint.name for joint in ANATOMY.joints}
    assert list(excess.values()) == sorted(excess.values(), reverse=True)
    assert excess[KNEE] > 10
    assert max(z for name, z in excess.items() if name not in (KNEE, SHOULDER)) < 3


def test_hypotheses_are_distinguished_at_the_joints_where_their_faults_differ():
    elsewhere = {SHOULDER: {STIFF: 0.3}}
    there = {KNEE: {STIFF: 0.3}}

    def is_worse(one: Hypothesis, best: Hypothesis, after: HingeLosses) -> bool:
        return lead_at_joints(best, one, losses_of_joints(after, None)) >= MIN_Z

    assert is_worse(STIFF, WEAK, hinge_losses(1, there))
    assert not is_worse(STIFF, WEAK, hinge_losses(1, elsewhere))
    assert not is_worse(WEAK, STIFF, hinge_losses(1, there))
    broken = said(f"break:{KNEE}")
    unknown = hinge_losses(1, {KNEE: {broken: np.nan}})
    assert not is_worse(broken, WEAK, unknown)


def test_the_loss_of_a_joint_of_several_hinges_is_their_mean():
    anatomy = ROBOTS["hexapod"].robot().anatomy
    joint = next(joint for joint in anatomy.joints if len(joint.hinges) > 1)
    first = anatomy.hinges.index(joint.hinges[0])

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        rows = np.zeros((len(hypotheses), PIECES, len(anatomy.hinges)))
        rows[:, :, first] = 1.0
        return rows

    problem = Synthetic(HypothesisSpace(anatomy, ()), losses, hinges=losses)
    assert np.all(problem.of_joint(joint.name, [INTACT]) == 1 / len(joint.hinges))


def test_the_second_joint_is_searched_where_no_fault_explains_the_first():
    """The largest excess is that of a joint that no searched fault explains."""
    steep = bowl(said(f"jam:{SHOULDER}+encoder-offset:{SHOULDER}=0.7"), steepness=4.0)
    shallow = bowl(said(f"damping:{KNEE}=8.0"))
    column = ANATOMY.hinges.index(ANATOMY.joint(SHOULDER).hinges[0])

    def damaged(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        rows = shallow(hypotheses)
        rows[:, :, column] = steep(hypotheses)[:, :, column]
        return rows

    healthy = bowl(INTACT, seed=1)
    found = of_hinges("intact", damaged, healthy=healthy)
    problem = Synthetic(SPACE, total(), hinges=damaged, hinges_before=healthy)

    assert next(iter(excesses(INTACT, problem))) == SHOULDER
    assert terms(found) == pytest.approx({f"damping {KNEE}": 8.0}, rel=0.05)
