"""Tests of the notation: round trips, and messages that contain the malformed term."""

import pytest
from hypothesis import given, strategies as st

from selfmodel.errors import InputError
from selfmodel.faults.notation import parse
from selfmodel.tasks import ROBOTS
from tests.helpers.strategies import hypotheses

ANATOMIES = {name: entry.robot().anatomy for name, entry in ROBOTS.items()}


@pytest.mark.parametrize("name", ANATOMIES)
@given(data=st.data())
def test_what_a_hypothesis_prints_parses_back_to_it(name: str, data: st.DataObject):
    hypothesis = data.draw(hypotheses(ANATOMIES[name], graded=True))

    assert parse(str(hypothesis), ANATOMIES[name]) == hypothesis


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "cannot read the term ''"),
        ("break", "cannot read the term 'break'"),
        ("break:", "cannot read the term 'break:'"),
        (":front_left_knee", "cannot read the term ':front_left_knee'"),
        ("break:front_left_knee+", "cannot read the term ''"),
        ("intact+break:front_left_knee", "cannot read the term 'intact'"),
        ("brake:front_left_knee", "unknown kind of fault .*'brake': did you mean break?"),
        ("break:front_left_nee", "'front_left_nee': did you mean front_left_knee"),
        ("sensor:front_left_knee", "for sensor 'front_left_knee'"),
        ("neuron:100", "'neuron:100'"),
        ("jam:front_left_knee=", "needs a number from -0.5236 to 0.5236 rad after '=', got ''"),
        ("jam:front_left_knee=x", "got 'x'"),
        ("jam:front_left_knee=nan", "got 'nan'"),
        ("jam:front_left_knee=1", "got '1'"),
        ("break:front_left_knee=1", "break has none: write no '='"),
        ("friction", "cannot read the term 'friction'|needs a number from 0.01 to 3"),
        ("friction=", "needs a number from 0.01 to 3 .* after '=', got ''"),
        ("friction=-1", "got '-1'"),
        ("friction:ground=0.4", "friction has none: write no ':'"),
        ("break=0.4", "cannot read the term 'break=0.4'"),
        ("motor:front_left_knee", "needs a number from 0 to 1 of its torque after '=', got ''"),
        ("sensor:front_left_angle=0.2", "needs noise or gain or bias after '='"),
        ("sensor:front_left_angle=gain", "after '=gain', got ''"),
        ("sensor:front_left_angle=bias2", "after '=bias', got '2'"),
        ("sensor:front_left_touch=noise0.1", "for sensor 'front_left_touch'"),
        ("leg:front_lef=locked", "'front_lef': did you mean front_left"),
        ("leg:front_left=stuck", "needs locked after '='$"),
        ("leg:front_left=locked0.1", "for each of front_left_shoulder, front_left_knee, .* '0.1'"),
        ("leg:front_left=locked0.1/x", "front_left_knee' needs a number .* got 'x'"),
        ("leg:front_left=locked0.1/2", "front_left_knee' needs a number .* got '2'"),
        (
            "leg:front_left+leg:front_left=locked0.1/0",
            "two severities, .*=locked and .*/0.0:",
        ),
        ("slope=0.1+slope=0.2", "gives slope two severities, slope=0.1 and slope=0.2"),
        (
            "jam:front_left_knee+jam:front_left_knee=0.2",
            "two severities, jam:.* and .*=0.2:",
        ),
        (
            "jam:front_left_knee=0.1+jam:front_left_knee=0.2",
            "two severities, .*=0.1 and .*=0.2:",
        ),
    ],
)
def test_a_malformed_notation_says_which_term_and_why(text: str, said: str):
    with pytest.raises(InputError, match=said):
        parse(text, ANATOMIES["quadruped"])


@pytest.mark.parametrize(
    ("said", "printed"),
    [
        ("friction=0.4+break:front_left_knee", "break:front_left_knee+friction=0.4"),
        ("wind=-5", "wind=-5.0"),
        ("crosswind=3+roughness=.03", "crosswind=3.0+roughness=0.03"),
        ("motor:front_left_knee=0.50", "motor:front_left_knee=0.5"),
        ("sensor:front_left_angle=gain0.2", "sensor:front_left_angle=gain0.2"),
        ("sensor:front_left_angle=bias-1e-1", "sensor:front_left_angle=bias-0.1"),
        ("sensor:front_left_angle=noise1e-5", "sensor:front_left_angle=noise1e-05"),
        ("jam:front_left_knee=-0", "jam:front_left_knee"),
        ("leg:front_left", "leg:front_left=locked"),
        ("leg:front_left=locked.1/-2e-1", "leg:front_left=locked0.1/-0.2"),
        ("leg:front_left=locked+jam:front_left_knee=0.2", "leg:front_left=locked"),
        ("leg:front_left=locked+break:front_left_shoulder", "break:front_left_shoulder"),
        ("motor:front_left_knee=1", "intact"),
        ("slope=0+wind=-0.0+sensor:front_left_touch=gain1", "intact"),
    ],
)
def test_a_degree_is_printed_as_it_parses(said: str, printed: str):
    hypothesis = parse(said, ANATOMIES["quadruped"])

    assert str(hypothesis) == printed
    assert parse(printed, ANATOMIES["quadruped"]) == hypothesis


@pytest.mark.parametrize("rounded", ["-0.523599", "-0.5236", "0.52360"])
def test_a_severity_that_was_rounded_beyond_its_bound_is_the_bound(rounded: str):
    anatomy = ROBOTS["hexapod"].robot().anatomy
    (fault,) = parse(f"jam:front_left_knee={rounded}", anatomy).faults

    assert abs(fault.severity) == anatomy.joint("front_left_knee").limits[0][1]
    with pytest.raises(InputError, match=r"jam:front_left_knee=0\.524"):
        parse("jam:front_left_knee=0.524", anatomy)


@given(text=st.text(max_size=40))
def test_any_text_is_either_a_hypothesis_or_an_input_error(text: str):
    try:
        hypothesis = parse(text, ANATOMIES["quadruped"])
    except InputError:
        return
    assert parse(str(hypothesis), ANATOMIES["quadruped"]) == hypothesis


def test_a_long_notation_is_refused_and_a_repeated_term_is_one():
    anatomy = ROBOTS["quadruped"].robot().anatomy

    assert str(parse("+".join(["friction=0.4"] * 1000), anatomy)) == "friction=0.4"
    with pytest.raises(InputError, match="of at most 20000 characters, got 1299999") as caught:
        parse("+".join(["friction=0.4"] * 100_000), anatomy)
    assert len(str(caught.value)) < 200
