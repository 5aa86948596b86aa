"""Tests of the reader of URDF files: what is kept, left out and refused."""

import pytest

from selfmodel.errors import InputError
from tests.robot.urdf.samples import BALL, WALKER, joint, link, read, urdf


def test_elements_of_simulators_are_left_out_with_a_note():
    extras = '<transmission name="t"/><gazebo><plugin filename="evil.so"/></gazebo><gazebo/>'

    document = read(WALKER.replace("</robot>", f"{extras}</robot>"))

    assert {element.tag for element in document.root} == {"link", "joint"}
    assert any("2 <gazebo>, 1 <transmission>" in note for note in document.notes)


def test_unknown_attributes_and_elements_never_reach_mujocos_importer():
    text = urdf(
        '<mujoco><compiler meshdir="/etc"/></mujoco>',
        '<link name="a" file="x"><include file="/etc/passwd"/><visual name="v"/></link>',
    )

    document = read(text)

    assert document.text.count("file") == document.text.count("mujoco") == 0


@pytest.mark.parametrize(
    "text",
    [
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="m"/></robot>',
        urdf('<link name="${prefix}_a"/>'),
    ],
)
def test_a_xacro_is_refused_with_the_command_that_expands_it(text: str):
    with pytest.raises(InputError, match=r"xacro robot\.urdf\.xacro > robot\.urdf"):
        read(text)


def test_the_declaration_of_xacros_namespace_alone_is_no_xacro():
    declared = WALKER.replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ')

    assert read(declared).text == read(WALKER).text


def test_a_floating_joint_on_an_empty_root_is_left_out():
    floating = joint("float", "odom", "trunk", kind="floating")

    document = read(WALKER.replace("</robot>", f"{link('odom', 0)}{floating}</robot>"))

    assert document.text == read(WALKER).text
    assert "the link odom and the joint float are left out" in document.notes


def test_a_floating_joint_elsewhere_is_refused():
    text = urdf(link("a"), link("b"), joint("j", "a", "b", kind="floating"))

    with pytest.raises(InputError, match="only the root link moves freely"):
        read(text)


def test_of_elements_that_a_urdf_has_once_the_first_counts():
    text = WALKER.replace('<axis xyz="0 1 0"/>', '<axis xyz="0 1 0"/><axis xyz="1 0 0"/>')

    assert read(text).text == read(WALKER).text


def test_shapes_of_size_zero_are_left_out_with_a_note():
    document = read(WALKER.replace(BALL, BALL + BALL.replace("0.03", "0.0")))

    assert document.text == read(WALKER).text
    assert "2 shapes of size 0 are left out" in document.notes


def test_a_revolute_joint_with_a_range_of_zero_width_is_fixed_with_a_note():
    text = urdf(link("a"), link("b"), joint("locked", "a", "b", low=0, high=0))

    document = read(text)

    assert [element.get("type") for element in document.root.iter("joint")] == ["fixed"]
    assert any("locked" in note and "is fixed" in note for note in document.notes)


@pytest.mark.parametrize(
    ("low", "sentence"),
    [
        ("2", "lower below upper"),
        ("nan", "1 number in lower"),
        ("x", "'x'"),
        ("1 2", "1 number in lower"),
    ],
)
def test_a_revolute_joint_without_a_range_is_refused(low: str, sentence: str):
    text = urdf(link("a"), link("b"), joint("j", "a", "b"))

    with pytest.raises(InputError, match=sentence):
        read(text.replace('lower="-1.0"', f'lower="{low}"'))
