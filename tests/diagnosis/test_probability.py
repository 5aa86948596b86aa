"""Promises of the probabilities of hypotheses."""

import dataclasses
import math

import pytest

from selfmodel.diagnosis.diagnosis import Fit
from selfmodel.diagnosis.probability import UNKNOWN, probabilities, unlikeness
from selfmodel.diagnosis.significance import MIN_Z
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.tasks import ROBOTS

ANATOMY = ROBOTS["quadruped"].robot().anatomy
JAM, OTHER = (parse(f"jam:{leg}_knee", ANATOMY) for leg in ("front_left", "back_left"))
FIT = Fit(0.1, 0.5, 0.1, 0.0, 3.5, has_faults=True)


def test_what_the_trials_tell_apart_has_all_of_the_probability_but_the_unknown_part():
    found = probabilities(JAM, {OTHER: math.inf, INTACT: 40.0}, FIT, misses=False)

    assert found == {str(JAM): pytest.approx(1 - UNKNOWN, abs=1e-4), str(OTHER): 0.0, "intact": 0.0}


def test_a_smaller_lead_is_a_larger_probability_and_none_is_half():
    leads = (0.0, 1.0, MIN_Z, 2 * MIN_Z)
    found = [probabilities(JAM, {OTHER: lead}, FIT, misses=False) for lead in leads]

    others = [one[str(OTHER)] for one in found]
    assert others == sorted(others, reverse=True)
    assert others[0] == found[0][str(JAM)] == pytest.approx((1 - UNKNOWN) / 2)


def test_loss_that_is_left_is_a_probability_of_another_fault():
    losses = (0.1, 0.24, 0.26, 0.5)  # of which 0.26 is the limit
    fits = [dataclasses.replace(FIT, loss=loss, excess=20.0) for loss in losses]
    known = [probabilities(JAM, {}, fit, misses=False)[str(JAM)] for fit in fits]

    assert known == sorted(known, reverse=True)
    assert known[2] == pytest.approx((1 - UNKNOWN) / 2)
    assert known[3] < 0.05
    assert probabilities(JAM, {}, FIT, misses=True) == {str(JAM): 0.0}


def test_without_healthy_trials_no_loss_is_too_high():
    assert unlikeness(dataclasses.replace(FIT, healthy_loss=None, excess=None)) == 0.0
