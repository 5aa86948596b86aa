"""Promises of the record of a diagnosis: readable, serialisable, a table."""

import dataclasses
import json
import math

import pytest
from hypothesis import given, strategies as st

from selfmodel.diagnosis.diagnosis import (
    OLD_KEYS,
    Candidate,
    Change,
    DetectableSeverity,
    Diagnosis,
    Fit,
    Residual,
    UnsearchedFault,
    diagnosis_from_dict,
    output_of,
    to_json,
)
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.tasks import ROBOTS

SPACE = HypothesisSpace(ROBOTS["quadruped"].robot().anatomy, PAPER_KINDS)
BEST, OTHER = "break:front_left_knee", "jam:back_left_knee"


FOUND = Diagnosis(
    ranked=(Candidate(SPACE.parse(BEST), 0.5), Candidate(SPACE.parse(OTHER), math.inf)),
    trials=1,
    intact_distance=2.0,
    indistinguishable=(SPACE.parse(OTHER),),
    verdict="ambiguous",
    test="by hand",
    unsearched=UnsearchedFault(SPACE.parse(f"{BEST}+friction=0.4"), "friction"),
    undetectable=(SPACE.parse(f"{BEST}+sensor:back_left_touch"),),
)


def test_the_repr_has_the_verdict_the_ranking_and_the_alternatives():
    assert repr(FOUND).splitlines() == [
        f"<Diagnosis of 1 trial: {BEST}, ambiguous",
        f"      0.5000  {BEST}",
        f"         inf  {OTHER}",
        f"  indistinguishable: {OTHER}",
        f"  undetectable: {BEST}+sensor:back_left_touch",
        f"  unsearched: {BEST}+friction=0.4 (friction)>",
    ]


NUMBERS = st.just(math.inf) | st.floats(0, 1e9)
FITS = st.builds(
    Fit, NUMBERS, NUMBERS, st.none(), st.none(), st.just(5.0), has_faults=st.booleans()
) | st.builds(
    Fit, NUMBERS, NUMBERS, st.floats(0, 1e9), NUMBERS, st.just(5.0), has_faults=st.booleans()
)
RESIDUAL = Residual({"sensors": 0.2, "base_position": 0.1}, "02-recovery", 3.2, 4.1)
CHANGE = Change("02-recovery", 1, 4.92, 4.8, 5.04, INTACT, SPACE.parse(BEST))
DETECTABLE = (
    DetectableSeverity("motor", "back_left_knee", below=0.7, above=None),
    DetectableSeverity("friction", "", below=0.5, above=1.25),
)


@given(
    FITS,
    st.sampled_from([None, CHANGE]),
    st.sampled_from([(), DETECTABLE]),
    st.sampled_from([None, RESIDUAL]),
)
def test_a_diagnosis_survives_json_and_the_output_of_the_command_line(
    fit: Fit,
    change: Change | None,
    detectable: tuple[DetectableSeverity, ...],
    residual: Residual | None,
):
    whole = dataclasses.replace(
        FOUND,
        detectable=detectable,
        fit=fit,
        change=change,
        residual=residual,
        probability={BEST: 0.9, OTHER: 0.05},
        also_searched=("grip",),
        left_out=(SPACE.parse(OTHER),),
    )
    for values in (whole.to_dict(), {**output_of(whole), "trials": whole.trials}):
        text = json.dumps(values, allow_nan=False)
        assert diagnosis_from_dict(json.loads(text), SPACE.parse) == whole


@pytest.mark.parametrize(
    ("key", "values"),
    [
        ("fit", {"loss": "much"}),
        ("fit", {"loss": 0.1}),
        ("probability", {BEST: 7.0}),
        ("probability", {BEST: -0.1}),
        ("change", {**to_json(CHANGE), "before": "break:nose"}),
        ("change", {**to_json(CHANGE), "time": "late"}),
        ("detectable", [{"kind": "motor", "part": "", "below": "none", "above": None}]),
    ],
)
def test_wrong_values_of_a_file_are_refused(key: str, values: object):
    with pytest.raises((ValueError, KeyError)):
        diagnosis_from_dict({**FOUND.to_dict(), key: values}, SPACE.parse)


def test_the_output_has_the_names_of_python_and_keys_of_0_1_are_read():
    values = output_of(FOUND)

    assert set(values) == {
        *("diagnosis", "verdict", "indistinguishable", "undetectable", "test", "unsearched"),
        *("intact_distance", "reason", "fit", "change", "residual", "doubt", "detectable"),
        *("probability", "also_searched", "left_out", "cost"),
    }
    assert values["undetectable"] == [f"{BEST}+sensor:back_left_touch"]
    assert values["reason"] is values["fit"] is values["change"] is values["residual"] is None
    assert values["diagnosis"][1] == {"hypothesis": OTHER, "distance": None}
    early = {old: values[key] for old, key in OLD_KEYS.items()} | {"trials": 1}
    early["unseen"] = ["sensor:back_left_touch"]  # without the best hypothesis in a result of 0.1
    common = ("diagnosis", "verdict", "test", "intact_distance")
    early |= {key: values[key] for key in common}
    assert diagnosis_from_dict(early, SPACE.parse) == FOUND
