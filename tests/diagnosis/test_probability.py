"""Promises of the probabilities of hypotheses."""

import dataclasses
import math

import pytest

from selfmodel.diagnosis.adequacy import unlikeness
from selfmodel.diagnosis.diagnosis import Fit
from selfmodel.diagnosis.significance import FAULTY_RATIO, LOSS_FLOOR, MIN_Z
from selfmodel.diagnosis.verdict import UNKNOWN, probabilities
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.tasks import ROBOTS

ANATOMY = ROBOTS["quadruped"].robot().anatomy
JAM, OTHER = (parse(f"jam:{leg}_knee", ANATOMY) for leg in ("front_left", "back_left"))
CLEAR = Fit(0.0, 0.5, 0.1, 0.0, 3.5, has_faults=True)


def test_what_the_trials_tell_apart_has_all_of_the_probability_but_the_unknown_part():
    found = probabilities(JAM, {OTHER: math.inf, INTACT: 40.0}, CLEAR, misses=False)

    assert found == pytest.approx({str(JAM): 1 - UNKNOWN, str(OTHER): 0.0, "intact": 0.0})


def test_a_smaller_lead_is_a_larger_probability_and_without_one_both_have_half():
    leads = (0.0, 1.0, MIN_Z, 2 * MIN_Z)
    found = [probabilities(JAM, {OTHER: lead}, CLEAR, misses=False) for lead in leads]

    others = [one[str(OTHER)] for one in found]
    assert others == sorted(others, reverse=True)
    assert others[0] == found[0][str(JAM)] == pytest.approx((1 - UNKNOWN) / 2)


def test_loss_that_is_left_is_a_probability_of_another_fault():
    limit = FAULTY_RATIO * 0.1 + LOSS_FLOOR
    fits = [
        dataclasses.replace(CLEAR, loss=times * limit, excess=20.0) for times in (0.0, 0.5, 1.0, 4)
    ]
    known = [probabilities(JAM, {}, fit, misses=False)[str(JAM)] for fit in fits]

    assert known == sorted(known, reverse=True)
    assert known[2] == pytest.approx(0.5)
    assert known[3] == pytest.approx(UNKNOWN, abs=0.01)
    assert probabilities(JAM, {}, CLEAR, misses=True) == {str(JAM): UNKNOWN}


def test_without_healthy_trials_no_loss_is_too_high():
    assert unlikeness(dataclasses.replace(CLEAR, healthy_loss=None, excess=None)) == 0.0
