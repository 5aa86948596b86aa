"""Tests of the derived failures: Table I for the paper's robots, and its rules for any robot."""

import re

import pytest

from selfmodel.faults.notation import parse
from selfmodel.faults.table_one import cases_of
from selfmodel.robot.robot import Robot
from selfmodel.tasks import ROBOTS, entry, suite_bodies
from tests.helpers.bodies import BODIES

SUITE = [suite_bodies.name(domain, tasks[0]) for domain, tasks in suite_bodies.DOMAINS.items()]


@pytest.fixture(scope="module", params=[*ROBOTS, *SUITE, "ant"])
def body(request: pytest.FixtureRequest) -> Robot:
    """The built-in robots, bodies of the suite, and an ant."""
    return BODIES["ant"]() if request.param == "ant" else entry(request.param).robot()


TABLE_ONE = {
    1: "break:front_left_knee",
    2: "break:front_left_{upper}",
    3: "sensor:front_left_touch",
    4: "break:front_left_{upper}+sensor:front_right_touch",
    5: "sensor:front_left_angle",
    6: "jam:front_left_{upper}",
    7: "break:front_left_{upper}+jam:{next}_left_{upper}",
    8: "break:front_left_{upper}+jam:{next}_left_{upper}+sensor:back_right_angle",
    9: "intact",
    10: "neuron:0",
}
"""The failures of Table I of the paper."""


@pytest.mark.parametrize(
    ("name", "upper", "next_leg"), [("quadruped", "shoulder", "back"), ("hexapod", "hip", "middle")]
)
def test_for_the_papers_robots_they_are_table_one(name: str, upper: str, next_leg: str):
    expected = {
        number: text.format(upper=upper, next=next_leg) for number, text in TABLE_ONE.items()
    }

    assert list(ROBOTS[name].cases.items()) == list(expected.items())


def test_each_has_as_many_faults_as_it_says_and_no_two_are_alike(body: Robot):
    cases = cases_of(body.anatomy)
    meant = {number: parse(text, body.anatomy) for number, text in cases.items()}

    assert list(cases) == sorted(cases)
    assert len(set(meant.values())) == len(cases)
    for number, hypothesis in meant.items():
        # No fault is at a part of the lost limb, so none is absorbed.
        assert len(hypothesis.faults) == {9: 0, 4: 2, 7: 2, 8: 3}.get(number, 1)


def test_a_limb_is_lost_whole_and_leaves_the_others(body: Robot):
    cases, anatomy = cases_of(body.anatomy), body.anatomy
    joints = {joint.name for joint in anatomy.joints}
    if 1 in cases:
        outermost, whole = (anatomy.joint(cases[n].removeprefix("break:")) for n in (1, 2))
        assert outermost.name in whole.descendants
        assert not outermost.descendants & joints
    for number in {4, 7, 8} & cases.keys():
        lost, *others = re.findall(r":(\w+)", cases[number])
        assert not set(others) & anatomy.joint(lost).descendants


def test_what_a_body_cannot_have_is_left_out():
    assert 4 not in cases_of(entry("suite-hopper-hop").robot().anatomy)  # one limb
    assert 8 not in cases_of(entry("suite-walker-walk").robot().anatomy)  # two limbs
    swimmer = cases_of(
        entry("suite-swimmer-swimmer6").robot().anatomy
    )  # one limb, without touch sensors
    assert list(swimmer) == [1, 2, 5, 6, 9, 10]


def test_the_limbs_of_a_humanoid_are_its_legs_and_arms_and_begin_at_the_hip():
    cases = cases_of(entry("suite-humanoid-walk").robot().anatomy)

    assert cases[1] == "break:right_ankle"
    assert cases[2] == "break:right_hip"
    assert cases[3] == "sensor:right_right_foot_touch"
