"""Tests of the checks on the tree of links and joints."""

import time

import pytest

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.untrusted import parse_xml
from selfmodel.robot.urdf import MAX_LINK_DEPTH, check_tree, check_types
from tests.robot.urdf.samples import WALKER, joint, link, urdf


def checked(text: str) -> str:
    root = parse_xml(text.encode())
    main = check_tree(root)
    check_types(root)
    return main


def test_the_root_is_the_link_without_a_parent():
    assert checked(WALKER) == "trunk"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (urdf(), "no <link>"),
        (urdf(link("a"), link("a")), "a different name for each <link>"),
        (urdf('<link name=""/>'), "a different name for each <link>"),
        (
            urdf(link("a"), link("b"), link("c"), joint("j", "a", "b"), joint("j", "a", "c")),
            "a different name for each <joint>",
        ),
        (urdf(link("a"), joint("j", "a", "b")), "which the URDF does not have"),
        (urdf(link("a"), link("b"), '<joint name="j" type="fixed"/>'), "which the URDF does not"),
        (
            urdf(link("a"), link("b"), joint("i", "a", "b"), joint("j", "a", "b")),
            "has two parents",
        ),
        (urdf(link("a"), link("b")), "'a', 'b'"),
        (urdf(link("a"), link("b"), joint("i", "a", "b"), joint("j", "b", "a")), "circle"),
        (
            urdf(*map(link, "abc"), joint("i", "b", "c"), joint("j", "c", "b")),
            "circle through the link",
        ),
        (urdf(link("a"), link("b"), joint("j", "a", "b", kind="prismatic")), 'type="fixed"'),
        (urdf(link("a"), link("b"), joint("j", "a", "b", kind="ball")), "revolute, continuous"),
    ],
)
def test_links_that_form_no_tree_of_hinges_are_refused_with_the_place(text: str, sentence: str):
    with pytest.raises(InputError) as refusal:
        checked(text)

    assert sentence in str(refusal.value)


def test_a_chain_of_too_many_links_is_refused():
    names = [f"l{number}" for number in range(MAX_LINK_DEPTH + 1)]
    joints = [joint(f"j{n}", names[n], names[n + 1]) for n in range(MAX_LINK_DEPTH)]

    assert checked(urdf(*map(link, names[:-1]), *joints[:-1])) == "l0"
    for order in (names, names[::-1]):
        with pytest.raises(InputError, match="links in one chain"):
            checked(urdf(*map(link, order), *joints))


def test_thousands_of_links_take_a_time_that_is_proportional_to_their_number():
    names = [f"l{number}" for number in range(10_000)]
    joints = [joint(f"j{name}", "l0", name) for name in names[1:]]
    root = parse_xml(urdf(*map(link, names), *joints).encode())

    start = time.process_time()
    check_tree(root)

    assert time.process_time() - start < 0.4
