"""Promises of the record of a diagnosis: readable, serialisable, a table."""

import json
import math
import sys
from types import SimpleNamespace

import pytest

from selfmodel.diagnosis.diagnosis import Candidate, Diagnosis, UnsearchedFault
from selfmodel.diagnosis.serialization import confidence_to_dict, diagnosis_from_dict
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.tasks import ROBOTS

SPACE = HypothesisSpace(ROBOTS["quadruped"].robot().anatomy, PAPER_KINDS)
BEST, OTHER = "break:front_left_knee", "jam:back_left_knee"


@pytest.fixture
def found() -> Diagnosis:
    both = SPACE.parse(f"{BEST}+sensor:back_left_touch")
    return Diagnosis(
        ranked=(Candidate(SPACE.parse(BEST), 0.5), Candidate(SPACE.parse(OTHER), math.inf)),
        trials=1,
        intact_distance=2.0,
        indistinguishable=(SPACE.parse(OTHER),),
        verdict="ambiguous",
        test="by hand",
        unsearched=UnsearchedFault(SPACE.parse(f"{BEST}+friction=0.4"), "friction"),
        undetectable=(both,),
    )


def test_the_repr_has_the_verdict_the_ranking_and_the_alternatives(found: Diagnosis):
    assert repr(found).splitlines() == [
        f"<Diagnosis of 1 trial: {BEST}, ambiguous",
        f"      0.5000  {BEST}",
        f"         inf  {OTHER}",
        f"  indistinguishable: {OTHER}",
        f"  undetectable: {BEST}+sensor:back_left_touch",
        f"  unsearched: {BEST}+friction=0.4 (friction)>",
    ]


def test_a_diagnosis_survives_json(found: Diagnosis):
    text = json.dumps(found.to_dict(), allow_nan=False)

    assert diagnosis_from_dict(json.loads(text), SPACE.parse) == found


def test_the_command_line_lists_only_the_extra_fault(found: Diagnosis):
    assert confidence_to_dict(found)["unseen"] == ["sensor:back_left_touch"]
    assert found.to_dict()["unseen"] == [f"{BEST}+sensor:back_left_touch"]


def test_a_table_without_pandas_is_refused_with_the_remedy(
    found: Diagnosis, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setitem(sys.modules, "pandas", None)

    with pytest.raises(InputError, match=r"pip install 'selfmodel\[tables\]'"):
        found.to_pandas()


def test_a_table_has_a_row_per_hypothesis(found: Diagnosis, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(DataFrame=list))

    assert found.to_pandas() == [
        {"hypothesis": BEST, "distance": 0.5},
        {"hypothesis": OTHER, "distance": None},
    ]
