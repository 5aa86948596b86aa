"""Tests of undetectable faults: the trials neither require them nor rule them out."""

from collections.abc import Mapping, Sequence

import numpy as np
import pytest

from selfmodel.diagnosis.diagnosis import Candidate, Diagnosis
from selfmodel.diagnosis.loss_functions import Losses, LossFunctions
from selfmodel.diagnosis.sentences import confidence_sentence
from selfmodel.diagnosis.serialization import confidence_to_dict, ranking_to_list
from selfmodel.diagnosis.verdicts.undetectable import undetectable_faults
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import ALL_KINDS, PAPER_KINDS
from selfmodel.robot.robot import Robot

PIECES = 60


def of(robot: Robot, means: Mapping[str, float], otherwise: float) -> Losses:
    """Losses with scatter: a mean per named hypothesis, another mean for the rest."""
    scatter = 0.01 * np.random.default_rng(0).normal(size=PIECES)
    known = {parse(text, robot.anatomy): mean for text, mean in means.items()}

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        rows = [known.get(one, otherwise) for one in hypotheses]
        return np.array([mean * (1 + scatter) for mean in rows])

    return losses


TOUCH, KNEE = "sensor:front_left_touch", "break:front_left_knee"


def test_what_makes_no_difference_is_unseen_and_what_makes_one_is_not(quadruped: Robot):
    losses = of(quadruped, {"intact": 1.0, TOUCH: 1.0, KNEE: 0.5}, otherwise=2.0)
    found = undetectable_faults(
        INTACT, HypothesisSpace(quadruped.anatomy, PAPER_KINDS), LossFunctions(losses, losses, None)
    )

    assert [str(one) for one in found] == [TOUCH]


def test_what_diverges_is_ruled_out(quadruped: Robot):
    losses = of(quadruped, {"intact": 1.0}, otherwise=np.inf)

    assert (
        undetectable_faults(
            INTACT,
            HypothesisSpace(quadruped.anatomy, PAPER_KINDS),
            LossFunctions(losses, losses, None),
        )
        == []
    )


def test_beside_what_diverges_nothing_is_unseen(quadruped: Robot):
    losses = of(quadruped, {}, otherwise=np.inf)

    assert (
        undetectable_faults(
            INTACT,
            HypothesisSpace(quadruped.anatomy, PAPER_KINDS),
            LossFunctions(losses, losses, None),
        )
        == []
    )


def test_the_closest_comes_first_and_each_says_one_fault_more(quadruped: Robot):
    best = parse(KNEE, quadruped.anatomy)
    # The difference is below NEGLIGIBLE_LOSS.
    means = {
        KNEE: 1.0,
        f"{KNEE}+sensor:back_left_touch": 1.0,
        f"{KNEE}+jam:back_left_knee": 1 - 1e-7,
    }
    losses = of(quadruped, means, otherwise=2.0)
    found = undetectable_faults(
        best, HypothesisSpace(quadruped.anatomy, PAPER_KINDS), LossFunctions(losses, losses, None)
    )

    assert [str(one) for one in found] == [
        "break:front_left_knee+jam:back_left_knee",
        "break:front_left_knee+sensor:back_left_touch",
    ]


def test_only_what_the_screen_cannot_tell_is_looked_at_closely(quadruped: Robot):
    asked: set[Hypothesis] = set()
    screen = of(quadruped, {"intact": 1.0, TOUCH: 1.0}, otherwise=2.0)

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        asked.update(hypotheses)
        return of(quadruped, {"intact": 1.0}, otherwise=2.0)(hypotheses)

    assert (
        undetectable_faults(
            INTACT,
            HypothesisSpace(quadruped.anatomy, PAPER_KINDS),
            LossFunctions(losses, screen, None),
        )
        == []
    )
    assert {str(one) for one in asked} == {"intact", TOUCH}


def test_faults_of_degree_are_left_out(quadruped: Robot):
    same = of(quadruped, {}, otherwise=1.0)
    found = undetectable_faults(
        INTACT, HypothesisSpace(quadruped.anatomy, ALL_KINDS), LossFunctions(same, same, None)
    )

    assert {fault.kind for one in found for fault in one.faults} == set(PAPER_KINDS)


@pytest.mark.parametrize(
    ("best", "besides"),
    [("intact", [TOUCH]), (KNEE, ["jam:back_left_knee", "sensor:back_left_touch"]), (KNEE, [])],
)
def test_a_report_names_what_is_unseen(quadruped: Robot, best: str, besides: list[str]):
    known = parse(best, quadruped.anatomy)
    more = [
        parse("+".join([best, one] if known.faults else [one]), quadruped.anatomy)
        for one in besides
    ]
    diagnosis = Diagnosis(
        (Candidate(known, 0.1),), 1, 0.2, (), "explained", "by eye", undetectable=tuple(more)
    )
    found = {"diagnosis": ranking_to_list(diagnosis.ranked), **confidence_to_dict(diagnosis)}

    assert found["unseen"] == besides
    sure = ", and no other hypothesis does as well." if not besides else "."
    more_said = f" Undetectable in these trials: {', '.join(besides)}." if besides else ""
    assert confidence_sentence(found) == f"Explained: {best} predicts the trials{sure}{more_said}"
