"""Promises of the search for faults of single joints, on synthetic losses without physics.

The total loss hardly depends on the faults. The loss of a joint is a bowl around the true fault.
"""

from collections.abc import Sequence

import numpy as np
import pytest

from selfmodel.diagnosis.joint_losses import HingeLosses, JointLosses
from selfmodel.diagnosis.loss_functions import Losses
from selfmodel.diagnosis.search.joint_faults import with_joint_faults
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.registry import KINDS
from tests.diagnosis.search.test_refine import ANATOMY, said

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
    joints = JointLosses(
        ANATOMY,
        damaged=bowl(said(truth), steepness=steepness),
        healthy=bowl(INTACT, seed=1) if healthy is None else healthy,
    )
    return with_joint_faults(said(start), SPACE, most, losses or total(), joints)


def terms(hypothesis: Hypothesis) -> dict[str, float]:
    return {f"{fault.kind.name} {fault.part}": fault.severity for fault in hypothesis.faults}


@pytest.mark.parametrize(
    "truth",
    [f"motor:{KNEE}=0.37", f"damping:{KNEE}=8.0", f"joint-friction:{SHOULDER}=0.23"],
)
def test_a_fault_that_only_the_joint_shows_is_found_with_its_severity(truth: str):
    found, real = searched("intact", truth), said(truth)

    assert terms(found) == pytest.approx(terms(real), rel=0.05)


def test_a_healthy_robot_stays_intact():
    assert searched("intact", "intact") == INTACT


def test_a_fault_of_the_wrong_kind_is_replaced():
    found = searched(f"motor:{KNEE}=0.6", f"joint-friction:{KNEE}=0.23")

    assert terms(found) == pytest.approx({f"joint-friction {KNEE}": 0.23}, rel=0.05)


def test_one_fault_takes_the_place_of_two_that_imitate_it():
    truth = f"motor:{KNEE}=0.3"
    two = said(f"damping:{KNEE}=3.0+joint-friction:{KNEE}=0.1")
    of_one = bowl(said(truth))

    def damaged(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        return of_one([said(truth) if one == two else one for one in hypotheses])

    joints = JointLosses(ANATOMY, damaged, bowl(INTACT, seed=1))
    found = with_joint_faults(two, SPACE, 4, total(), joints)

    assert terms(found) == pytest.approx(terms(said(truth)), rel=0.05)


def test_faults_of_two_joints_are_found():
    truth = f"damping:{KNEE}=8.0+motor:{SHOULDER}=0.2"

    assert terms(searched("intact", truth)) == pytest.approx(terms(said(truth)), rel=0.05)


def test_a_hypothesis_has_at_most_the_given_number_of_faults():
    truth = f"damping:{KNEE}=8.0+motor:{SHOULDER}=0.2"

    assert len(searched("intact", truth, most=1)) == 1


def test_a_fault_of_another_part_that_the_trials_require_is_kept():
    lost = "break:back_left_knee"
    found = searched(lost, f"{lost}+damping:{KNEE}=8.0", losses=total(required=lost))

    assert said(lost).faults[0] in found.faults
    assert terms(found) == pytest.approx(terms(said(f"{lost}+damping:{KNEE}=8.0")), rel=0.05)


def test_a_fault_that_imitated_that_of_a_joint_is_removed():
    assert terms(searched("break:back_left_knee", f"damping:{KNEE}=8.0")) == pytest.approx(
        {f"damping {KNEE}": 8.0}, rel=0.05
    )


def test_a_fault_of_the_same_part_that_is_not_about_its_motion_is_kept():
    grip = f"grip:{KNEE}=0.2"
    found = searched(grip, f"motor:{KNEE}=0.5", losses=total(required=grip))

    assert said(grip).faults[0] in found.faults
    assert len(found) == 2


def test_the_second_joint_is_searched_where_no_fault_explains_the_first():
    """The largest excess is that of a joint that no searched fault explains."""
    steep = bowl(said(f"jam:{SHOULDER}+encoder-offset:{SHOULDER}=0.7"), steepness=4.0)
    shallow = bowl(said(f"damping:{KNEE}=8.0"))
    column = ANATOMY.hinges.index(ANATOMY.joint(SHOULDER).hinges[0])

    def damaged(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        rows = shallow(hypotheses)
        rows[:, :, column] = steep(hypotheses)[:, :, column]
        return rows

    joints = JointLosses(ANATOMY, damaged, bowl(INTACT, seed=1))
    found = with_joint_faults(INTACT, SPACE, 4, total(), joints)

    assert next(iter(joints.excess(INTACT))) == SHOULDER
    assert terms(found) == pytest.approx({f"damping {KNEE}": 8.0}, rel=0.05)


def test_a_broken_joint_has_no_evidence_and_stays_broken():
    assert searched(f"break:{KNEE}", f"motor:{KNEE}=0.2") == said(f"break:{KNEE}")


def test_a_fault_that_makes_the_trials_worse_is_not_taken():
    assert searched("intact", f"damping:{KNEE}=8.0", losses=total(of_faults=1.0)) == INTACT


def test_a_fault_that_healthy_trials_show_too_is_model_error():
    truth = f"damping:{KNEE}=8.0"

    assert searched("intact", truth, healthy=bowl(said(truth), seed=1)) == INTACT


def test_an_error_that_no_fault_explains_adds_none():
    """The joint's loss is the same, and large, for every fault."""
    outside = bowl(said(f"jam:{KNEE}+encoder-offset:{KNEE}=0.7"), steepness=4.0)
    joints = JointLosses(ANATOMY, outside, bowl(INTACT, seed=1))

    assert with_joint_faults(INTACT, SPACE, 4, total(), joints) == INTACT


def test_without_healthy_trials_a_kind_is_replaced_and_no_fault_added():
    joints = JointLosses(ANATOMY, bowl(said(f"damping:{KNEE}=8.0")), None)

    def found(start: str) -> Hypothesis:
        return with_joint_faults(said(start), SPACE, 4, total(), joints)

    assert found("intact") == INTACT
    assert terms(found(f"motor:{KNEE}=0.6")) == pytest.approx({f"damping {KNEE}": 8.0}, rel=0.05)
