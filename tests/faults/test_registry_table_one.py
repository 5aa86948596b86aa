"""Tests of the derived failures: Table I for the paper's robots, and its rules for any robot."""

import re
from collections.abc import Mapping
from functools import partial

import pytest

from selfmodel.faults.notation import parse
from selfmodel.faults.registry import cases_of
from selfmodel.robot.contacts import reaches_ground
from selfmodel.robot.robot import Robot
from selfmodel.tasks import ROBOTS, entry
from tests.helpers.robots.bodies import BODIES

SUITE = ["suite-humanoid-walk", "suite-fish-swim", "suite-swimmer-swimmer6"]


def cases(robot: Robot) -> Mapping[int, str]:
    """Returns the failures of a robot whose legs reach the ground."""
    return cases_of(robot.anatomy, partial(reaches_ground, robot))


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
    own = cases(body)
    meant = {number: parse(text, body.anatomy) for number, text in own.items()}

    assert list(own) == sorted(own)
    assert len(set(meant.values())) == len(own)
    for number, hypothesis in meant.items():
        # No fault is at a part of the lost limb, so none is absorbed.
        assert len(hypothesis.faults) == {9: 0, 4: 2, 7: 2, 8: 3}.get(number, 1)


def test_a_limb_is_lost_whole_and_leaves_the_others(body: Robot):
    own, anatomy = cases(body), body.anatomy
    joints = {joint.name for joint in anatomy.joints}
    if 1 in own:
        outermost, whole = (anatomy.joint(own[n].removeprefix("break:")) for n in (1, 2))
        assert outermost.name in whole.descendants
        assert not outermost.descendants & joints
    for number in {4, 7, 8} & own.keys():
        lost, *others = re.findall(r":(\w+)", own[number])
        assert not set(others) & anatomy.joint(lost).descendants


def test_what_a_body_cannot_have_is_left_out():
    assert 4 not in cases(entry("suite-hopper-hop").robot())  # one limb
    assert 8 not in cases(entry("suite-walker-walk").robot())  # two limbs
    swimmer = cases(entry("suite-swimmer-swimmer6").robot())  # one limb, without touch sensors
    assert list(swimmer) == [1, 2, 5, 6, 9, 10]


def test_the_legs_of_a_humanoid_begin_at_the_hip_and_its_arms_are_no_legs():
    own = entry("suite-humanoid-walk").cases

    assert own[1] == "break:right_ankle"
    assert own[2] == "break:right_hip"
    assert own[3] == "sensor:right_right_foot_touch"
    assert own[7] == "break:right_hip+jam:left_hip"
    assert 8 not in own
