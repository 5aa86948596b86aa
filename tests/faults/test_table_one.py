"""Promises of the failures that are made for any body: Table I's for the paper's two robots."""

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
    """Ours, the suite's, and an ant."""
    return BODIES["ant"]() if request.param == "ant" else entry(request.param).robot()


@pytest.mark.parametrize("name", sorted(ROBOTS))
def test_for_the_papers_robots_they_are_table_one(name: str):
    assert dict(cases_of(ROBOTS[name].robot().anatomy)) == dict(ROBOTS[name].cases)


def test_each_has_as_many_faults_as_it_says_and_no_two_are_alike(body: Robot):
    cases = cases_of(body.anatomy)
    meant = {number: parse(text, body.anatomy) for number, text in cases.items()}

    assert list(cases) == sorted(cases)
    assert len(set(meant.values())) == len(cases)
    for number, hypothesis in meant.items():
        # What hangs on a lost limb cannot fail beside it: nothing is absorbed.
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
    swimmer = cases_of(entry("suite-swimmer-swimmer6").robot().anatomy)  # one, and no touch
    assert list(swimmer) == [1, 2, 5, 6, 9, 10]


def test_the_limbs_of_a_humanoid_are_its_legs_and_arms_and_begin_at_the_hip():
    cases = cases_of(entry("suite-humanoid-walk").robot().anatomy)

    assert cases[1] == "break:right_ankle"
    assert cases[2] == "break:right_hip"
    assert cases[3] == "sensor:right_right_foot_touch"
