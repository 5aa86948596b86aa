"""Promises of the repair of a study: names are checked, and the default search has its name."""

import pytest

from selfmodel.errors import InputError
from selfmodel.experiments.study.repairs import check_repair, repair_parameters, score_name


@pytest.mark.parametrize(
    ("repair", "search", "message"),
    [
        ("papers", None, "unknown repair 'papers': did you mean paper"),
        ("robust", "cma", "unknown search 'cma'"),
        ("paper", "cma-es", "the paper's repair has its own EA"),
        ("robust", "repertoire", "a study of many has none.*give --search cma-es or ea"),
    ],
)
def test_a_name_that_a_study_cannot_have_is_refused(repair: str, search: str | None, message: str):
    with pytest.raises(InputError, match=message):
        check_repair(repair, search)


def test_every_other_pair_of_names_is_accepted():
    for repair, search in (("paper", "ea"), ("robust", "ea"), ("robust", "cma-es")):
        check_repair(repair, search)
        check_repair(repair, None)


def test_the_default_search_is_the_same_parameter_as_its_name():
    assert repair_parameters("robust", None) == repair_parameters("robust", "cma-es")
    assert repair_parameters("paper", None) == {"repair": "paper", "search": "ea"}


def test_the_score_is_that_of_the_repair_unless_it_is_given():
    assert [score_name(repair, None) for repair in ("paper", "robust")] == [
        *("displacement", "upright"),
    ]
    assert score_name("robust", "energy") == "energy"
