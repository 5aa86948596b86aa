"""Tests of the canonical form: equal hypotheses have equal effects, with the fewest faults."""

import pytest
from hypothesis import given, strategies as st

from selfmodel.faults.hypothesis import canonical
from selfmodel.faults.kind import Fault
from selfmodel.faults.notation import parse
from selfmodel.faults.world import PAYLOAD
from selfmodel.tasks import ROBOTS
from tests.helpers.strategies import faults

ANATOMIES = {name: entry.robot().anatomy for name, entry in ROBOTS.items()}


@pytest.mark.parametrize("name", ANATOMIES)
@given(data=st.data())
def test_canonical_form_is_a_fixed_point(name: str, data: st.DataObject):
    anatomy = ANATOMIES[name]
    chosen = data.draw(st.lists(faults(anatomy, graded=True), max_size=6))
    once = canonical(chosen, anatomy)

    assert canonical(once.faults, anatomy) == once


@pytest.mark.parametrize(
    ("said", "meant"),
    [
        ("break:front_left_shoulder+break:front_left_knee", "break:front_left_shoulder"),
        ("break:front_left_shoulder+jam:front_left_knee", "break:front_left_shoulder"),
        ("break:front_left_shoulder+jam:front_left_shoulder", "break:front_left_shoulder"),
        ("break:front_left_knee+sensor:front_left_touch", "break:front_left_knee"),
        ("break:front_left_shoulder+sensor:front_left_angle", "break:front_left_shoulder"),
        ("jam:front_left_shoulder+sensor:front_left_angle", "jam:front_left_shoulder"),
        ("jam:front_left_shoulder+sensor:front_left_angle=gain0.2", "jam:front_left_shoulder"),
        ("break:front_left_knee+jam:front_left_knee=0.2", "break:front_left_knee"),
        ("break:front_left_shoulder+motor:front_left_knee=0.5", "break:front_left_shoulder"),
        ("break:front_left_knee+motor:front_left_knee=0.5", "break:front_left_knee"),
        (
            "break:front_left_shoulder+sensor:front_left_angle=noise0.1",
            "break:front_left_shoulder",
        ),
        ("jam:front_left_knee+motor:front_left_knee=0.5", "jam:front_left_knee"),
        ("jam:front_left_knee=0.2+motor:front_left_knee=0.5", "jam:front_left_knee=0.2"),
        ("sensor:back_left_angle+sensor:back_left_angle=gain0.5", "sensor:back_left_angle"),
        ("sensor:back_left_angle=gain0", "sensor:back_left_angle"),
        ("sensor:back_left_angle=gain0+sensor:back_left_angle", "sensor:back_left_angle"),
        (
            "sensor:back_left_angle=gain0+sensor:back_left_angle=bias0.3",
            "sensor:back_left_angle=bias0.3+sensor:back_left_angle=gain0.0",
        ),
        ("sensor:back_left_angle+sensor:back_left_angle=bias0.5", "sensor:back_left_angle"),
        ("sensor:back_left_angle=noise0.5+sensor:back_left_angle", "sensor:back_left_angle"),
        ("jam:front_left_knee+damping:front_left_knee=8", "jam:front_left_knee"),
        ("break:front_left_knee+joint-friction:front_left_knee=0.4", "break:front_left_knee"),
        ("motor:front_left_knee=0+servo-gain:front_left_knee=0.5", "motor:front_left_knee=0.0"),
        ("motor:front_left_knee=off0.1+motor:front_left_knee=0.5", "motor:front_left_knee=off0.1"),
        ("jam:front_left_knee+motor:front_left_knee=off0.1", "jam:front_left_knee"),
        ("break:front_left_knee+servo-gain:front_left_knee=0.5", "break:front_left_knee"),
        ("break:front_left_shoulder+grip:front_left_knee=0.2", "break:front_left_shoulder"),
        ("break:front_left_knee+encoder-offset:front_left_knee=slip0.1", "break:front_left_knee"),
    ],
)
def test_what_another_fault_leaves_without_effect_is_absorbed(said: str, meant: str):
    assert str(parse(said, ANATOMIES["quadruped"])) == meant


@pytest.mark.parametrize(
    "said",
    [
        "break:front_left_knee+jam:front_left_shoulder",
        "break:front_left_knee+sensor:front_left_angle",
        "break:front_left_shoulder+sensor:front_right_touch",
        "jam:front_left_knee+sensor:front_left_touch",
        "jam:front_left_shoulder=0.3+sensor:front_left_angle",
        "jam:front_left_shoulder=0.3+sensor:front_left_angle=gain0.2",
        "jam:front_left_shoulder+sensor:front_left_angle=bias0.2",
        "jam:front_left_shoulder+motor:front_left_knee=0.2",
        "break:front_left_knee+motor:front_left_shoulder=0.2",
        "sensor:front_left_angle=gain0.5+sensor:front_left_angle=bias0.2",
        "break:front_left_shoulder+friction=0.4",
        "wind=5+crosswind=5",
    ],
)
def test_faults_that_both_matter_are_both_kept(said: str):
    assert len(parse(said, ANATOMIES["quadruped"])) == 2


PAYLOADS = [
    Fault(PAYLOAD, part, severity)
    for part in PAYLOAD.parts(ANATOMIES["quadruped"])
    for severity in (0.2, 0.4)
]


@given(
    payloads=st.lists(st.sampled_from(PAYLOADS), min_size=1, unique_by=lambda one: one.part),
    others=st.lists(faults(ANATOMIES["quadruped"], graded=False), max_size=3),
    data=st.data(),
)
def test_of_a_single_kind_the_first_part_is_kept_in_any_order(
    payloads: list[Fault], others: list[Fault], data: st.DataObject
):
    order = data.draw(st.permutations([*payloads, *others]))
    found = canonical(order, ANATOMIES["quadruped"])

    assert found == canonical([*payloads, *others], ANATOMIES["quadruped"])
    assert [fault for fault in found.faults if fault.kind == PAYLOAD] == [min(payloads)]
