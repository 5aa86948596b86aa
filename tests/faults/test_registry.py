"""Tests of the kinds of a search, and of the failures of Table I derived for any robot."""

import dataclasses
import re
from collections.abc import Mapping
from functools import partial

import pytest

from selfmodel.errors import InputError
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import ALL_KINDS, KIND_SETS, KINDS, PAPER_KINDS, cases_of
from selfmodel.robot.anatomy import Anatomy, Joint
from selfmodel.robot.contacts import reaches_ground
from selfmodel.robot.model_variant import ModelVariant
from selfmodel.robot.robot import Robot
from selfmodel.tasks import ROBOTS, entry
from selfmodel.testing import check_fault_kind
from tests.helpers.robots.arms import arm
from tests.helpers.robots.bodies import BODIES

ANGLES = (KINDS["break"], KINDS["jam-angle"])

BARE = """\
<mujoco><option timestep="0.005"/><worldbody>
  <geom type="plane" size="0 0 1"/>
  <body name="trunk" pos="0 0 0.5"><freejoint/><geom type="box" size="0.1 0.1 0.1"/>
    <body name="leg"><joint name="hip" axis="0 1 0" range="-60 60"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02"/></body></body>
</worldbody>
<actuator><position name="hip" joint="hip" kp="50" ctrlrange="-1 1"/></actuator></mujoco>
"""
"""A robot without sensors."""


def test_what_strikes_a_robot_stays_in_its_order_and_brings_its_other_names(robot: Robot):
    assert HypothesisSpace.of(PAPER_KINDS, robot.anatomy).kinds == PAPER_KINDS
    walking = tuple(kind for kind in ALL_KINDS if kind.base != "fixed")
    assert HypothesisSpace.of(ALL_KINDS, robot.anatomy).kinds == walking
    assert HypothesisSpace.of(ANGLES, robot.anatomy).kinds == (*ANGLES, KINDS["jam"])
    gains = (KINDS["sensor-gain"], KINDS["motor"])
    assert HypothesisSpace.of(gains, robot.anatomy).kinds == (*gains, KINDS["sensor"])


def test_a_kind_that_cannot_strike_a_robot_is_passed_over_and_alone_refused():
    anatomy = Robot("bare", BARE, 0.02).anatomy

    assert HypothesisSpace.of(PAPER_KINDS, anatomy).kinds == (KINDS["break"], KINDS["jam"])
    with pytest.raises(InputError, match="sensor, sensor-gain cannot affect any part"):
        HypothesisSpace.of((KINDS["sensor"], KINDS["sensor-gain"]), anatomy)


def test_the_kinds_of_a_set_are_those_of_the_robots_base_and_others_are_searched_if_named(
    quadruped: Robot,
):
    of_ground_and_air = {"friction", "slope", "wind", "crosswind", "roughness", "grip"}
    for kinds in (KIND_SETS["default"], ALL_KINDS, (*KIND_SETS["default"], KINDS["damping"])):
        names = {kind.name for kind in HypothesisSpace.of(kinds, arm().anatomy).kinds}
        assert names.isdisjoint({*of_ground_and_air, "payload"})
        assert "motor" in names
        assert ("load" in names) == (kinds == ALL_KINDS)  # in place of a weak servo on a real one
    assert KINDS["payload"].parts(arm().anatomy) == ()
    named = (KINDS["motor"], KINDS["wind"], KINDS["slope"])
    assert HypothesisSpace.of(named, arm().anatomy).kinds == named
    walking = HypothesisSpace.of(KIND_SETS["environment"], quadruped.anatomy).kinds
    assert {kind.name for kind in walking} == {"friction", "slope", "wind", "payload"}


def test_a_kind_that_no_diagnosis_may_propose_is_refused(robot: Robot):
    with pytest.raises(InputError, match="no diagnosis may propose neuron: leave neuron out"):
        HypothesisSpace.of((KINDS["break"], KINDS["neuron"]), robot.anatomy)


def test_kinds_that_a_fault_is_of_at_some_degree_can_be_named(quadruped: Robot):
    """Diagnoses in a journal are parsed with these kinds."""
    sticky = Stick(name="sticky")
    stick = Stick(
        name="stick", bounds=(0, 2), levels=(1.0, 2.0), degenerates_to={0.0: sticky, 0.5: None}
    )

    check_fault_kind(stick, quadruped)
    assert HypothesisSpace.of((stick,), quadruped.anatomy).kinds == (stick, sticky)
    assert str(HypothesisSpace(quadruped.anatomy, (stick,)).parse("stick=0")) == "sticky"
    for wrong in (KINDS["neuron"], KINDS["slope"]):
        with pytest.raises(ValueError, match=f"stick degenerates to {wrong.name}"):
            check_fault_kind(dataclasses.replace(stick, degenerates_to={0.0: wrong}), quadruped)


class Stick(FaultKind):
    """Friction in every joint."""

    def apply(self, variant: ModelVariant, _anatomy: Anatomy, fault: Fault) -> None:
        """Adds the friction."""
        variant.model.dof_frictionloss[6:] += 0.1 + fault.severity


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
        assert str(hypothesis) == own[number]


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


@pytest.mark.parametrize(
    ("name", "limbs"),
    [
        ("quadruped", "front_left front_right back_left back_right"),
        ("suite-walker-walk", "right left"),
        # Its arms and legs share no other words; the joints of these share none at all.
        ("suite-humanoid-walk", "right_hip left_hip right_shoulder left_shoulder"),
        ("suite-cheetah-run", "bthigh fthigh"),
    ],
)
def test_a_limb_has_the_name_that_its_joints_share(name: str, limbs: str):
    assert list(entry(name).robot().anatomy.limbs) == limbs.split()


def test_limbs_of_one_name_have_those_of_their_first_joints():
    def limb(*names: str) -> list[Joint]:
        joint = dataclasses.replace(entry("quadruped").robot().anatomy.joints[0])
        beyond = [frozenset(names[k + 1 :]) for k in range(len(names))]
        return [
            dataclasses.replace(joint, name=name, descendants=own)
            for name, own in zip(names, beyond, strict=True)
        ]

    joints = (*limb("a_1", "a_2"), *limb("a", "x"))
    anatomy = dataclasses.replace(entry("quadruped").robot().anatomy, joints=joints)
    assert list(anatomy.limbs) == ["a_1", "a"]


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
