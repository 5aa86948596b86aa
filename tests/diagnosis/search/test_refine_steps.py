"""Tests of the steps of a descent: a further fault has to be worth its place."""

from collections.abc import Sequence

import numpy as np
import pytest

from selfmodel.diagnosis.loss_functions import Losses
from selfmodel.diagnosis.search.refine import MIN_Z_OF_STEP
from selfmodel.diagnosis.verdicts.significance import is_better
from selfmodel.faults.hypothesis import Hypothesis, canonical
from tests.diagnosis.search.test_refine import ANATOMY, FAULTS, PIECES, centred, find, said

FEW = FAULTS[-5:]
"""Sensors, whose faults do not absorb each other."""


def step_of(z: float) -> tuple[Hypothesis, Losses]:
    """A pair of faults, and losses in which the second is better by z standard errors.

    With a third fault, the loss is smaller by far: a descent that takes the step reaches it, and no
    other descent does, because two decoys are better single faults.
    """
    first, second, third, *decoys = FEW
    one = canonical([first], ANATOMY)
    two, end = canonical([first, second], ANATOMY), canonical([first, third, second], ANATOMY)
    swing = np.resize([1.0, -1.0], PIECES)
    gain = 0.001 * (z + swing * np.sqrt(PIECES - 1))
    known = {one: np.full(PIECES, 0.5), two: 0.5 - gain, end: np.full(PIECES, 0.01)}
    known |= {canonical([decoy], ANATOMY): np.full(PIECES, 0.6) for decoy in decoys}

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        otherwise = np.full(PIECES, 0.9)
        return np.array(
            [
                known.get(each, otherwise + 0.01 * len(each) * (1 + 0.1 * swing))
                for each in hypotheses
            ]
        )

    return end, losses


@pytest.mark.parametrize(("z", "continues"), [(1.01, True), (0.99, False)])
def test_a_descent_continues_with_a_further_fault_only_from_two_standard_errors_on(
    z: float, *, continues: bool
):
    end, losses = step_of(z * MIN_Z_OF_STEP)
    found = find(losses, faults=FEW)

    assert (found == end) == continues


def test_a_descent_with_no_further_fault_takes_any_smaller_loss():
    """A replaced fault has no place to be worth: the smaller loss is enough."""
    start, better, end = (
        said(f"jam:back_left_knee+{other}")
        for other in ("sensor:front_left_angle", "jam:front_left_knee", "jam:front_right_knee")
    )
    tiny = 1e-4 * centred(np.random.default_rng(0)) - 1e-6
    far = said("jam:front_left_knee+jam:front_right_knee")
    known = {
        start: np.full(PIECES, 0.5),
        better: 0.5 + tiny,
        end: np.full(PIECES, 0.9),
        far: np.full(PIECES, 0.01),
    }

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        return np.array([known.get(one, np.linspace(0.89, 0.91, PIECES)) for one in hypotheses])

    assert not is_better(*losses([better, start]))
    assert find(losses, start) == far
