"""Tests of the bodies of a URDF as MJCF: the same as those of MuJoCo's importer."""

import mujoco
import numpy as np
from hypothesis import given, settings, strategies as st

from tests.robot.urdf.samples import WALKER, converted, elements, joint, link, urdf

NUMBER = st.floats(-1, 1).map(lambda value: round(value, 9))
VECTOR = st.lists(NUMBER, min_size=3, max_size=3).map(lambda v: " ".join(map(repr, v)))
AXIS = VECTOR.filter(lambda text: np.linalg.norm(np.fromstring(text, sep=" ")) > 0.1)
MOMENT = st.floats(1.0, 1.5).map(lambda value: round(value, 9))


@st.composite
def trees(draw: st.DrawFn) -> str:
    """A URDF with links at any place, joints of all kinds, and any inertia."""
    count = draw(st.integers(2, 7))
    parts = []
    for number in range(count):
        moments = "".join(f'{name}="{draw(MOMENT)}" ' for name in ("ixx", "iyy", "izz"))
        products = "".join(f'{name}="{draw(NUMBER) / 10}" ' for name in ("ixy", "ixz", "iyz"))
        parts.append(
            f'<link name="l{number}"><inertial><origin xyz="{draw(VECTOR)}" rpy="{draw(VECTOR)}"/>'
            f'<mass value="{draw(MOMENT)}"/><inertia {moments}{products}/></inertial>'
            f'<collision><origin xyz="{draw(VECTOR)}" rpy="{draw(VECTOR)}"/>'
            f'<geometry><cylinder radius="0.123456789" length="0.3"/></geometry></collision></link>'
        )
        if number:
            kind = draw(st.sampled_from(["revolute", "continuous", "fixed"]))
            parent = draw(st.integers(0, number - 1))
            parts.append(
                f'<joint name="j{number}" type="{kind}"><parent link="l{parent}"/>'
                f'<child link="l{number}"/><origin xyz="{draw(VECTOR)}" rpy="{draw(VECTOR)}"/>'
                f'<axis xyz="{draw(AXIS)}"/><dynamics damping="0.12" friction="0.034"/>'
                f'<limit lower="-1.23456789" upper="0.987654321" effort="3" velocity="5"/></joint>'
            )
    return urdf(*parts)


def imported(text: str) -> mujoco.MjModel:
    """Returns the model that MuJoCo makes of a URDF, with the links on fixed joints."""
    keep = '<mujoco><compiler fusestatic="false"/></mujoco>'
    return mujoco.MjModel.from_xml_string(text.replace("</robot>", f"{keep}</robot>"))


def posed(model: mujoco.MjModel, angles: dict[str, float]) -> mujoco.MjData:
    data = mujoco.MjData(model)
    for name, angle in angles.items():
        data.joint(name).qpos[0] = angle
    mujoco.mj_forward(model, data)
    return data


@settings(max_examples=25, deadline=None)
@given(trees(), st.integers(0, 2**31))
def test_any_tree_has_the_bodies_of_mujocos_importer_to_the_last_digits(text: str, seed: int):
    theirs = imported(text)
    ours = mujoco.MjModel.from_xml_string(converted(text, base="fixed").text)
    names = [theirs.joint(j).name for j in range(theirs.njnt)]
    angles = dict(zip(names, np.random.default_rng(seed).uniform(-2, 2, len(names)), strict=True))
    there, here = posed(theirs, angles), posed(ours, angles)

    assert [ours.joint(j).name for j in range(ours.njnt)] == names
    for field in ("jnt_range", "jnt_limited", "dof_damping", "dof_frictionloss", "body_mass"):
        np.testing.assert_allclose(getattr(ours, field), getattr(theirs, field), rtol=1e-12)
    np.testing.assert_allclose(here.xpos, there.xpos, atol=1e-12)
    np.testing.assert_allclose(here.xmat, there.xmat, atol=1e-12)
    np.testing.assert_allclose(here.xipos, there.xipos, atol=1e-12)
    # The inertia as a whole: its principal axes may be in another order.
    np.testing.assert_allclose(here.M, there.M, atol=1e-9)
    geoms = [sorted(map(tuple, np.round(data.geom_xpos, 9) + 0.0)) for data in (here, there)]
    assert geoms[0] == geoms[1]


def test_feet_on_fixed_joints_are_bodies_of_their_own():
    bodies = elements(converted(WALKER), ".//body")

    assert set(bodies) == {
        "trunk",
        *(f"{side}_{part}" for side in ("left", "right") for part in ("thigh", "shin", "foot")),
    }
    assert [geom.get("type") for geom in bodies["left_foot"].findall("geom")] == ["sphere"]
    assert bodies["left_foot"].find("joint") is None


def test_geoms_of_a_link_fixed_in_the_middle_of_a_limb_are_those_of_the_limb():
    guard = link(
        "guard", 0.2, '<collision><geometry><sphere radius="0.01"/></geometry></collision>'
    )
    fixed = joint("bolt", "left_thigh", "guard", kind="fixed", xyz="0.1 0 0.05")

    bodies = elements(converted(WALKER.replace("</robot>", f"{guard}{fixed}</robot>")), ".//body")

    assert bodies["guard"].find("geom") is None
    assert bodies["guard"].find("inertial").get("mass") == "0.2"
    (geom,) = bodies["left_thigh"].findall("geom")
    assert np.allclose(np.fromstring(geom.get("pos"), sep=" "), (0.1, 0, 0.05))


def test_a_massless_link_between_two_hinges_is_merged_into_one_body_with_both():
    text = urdf(
        link("a"),
        link("cross", 0),
        link("b"),
        joint("roll", "a", "cross", axis="1 0 0", xyz="0.1 0.2 0.3"),
        joint("pitch", "cross", "b", axis="0 1 0", xyz="0 0.05 0"),
    )

    ours = mujoco.MjModel.from_xml_string(converted(text, base="fixed").text)
    data = posed(ours, {"roll": 0.5, "pitch": -0.3})

    assert [ours.body(b).name for b in range(1, ours.nbody)] == ["a", "b"]
    expected = np.array([0.1, 0.2 + 0.05 * np.cos(0.5), 0.3 + 0.05 * np.sin(0.5)])
    np.testing.assert_allclose(data.body("b").xpos, expected, atol=1e-12)


def test_links_without_an_inertial_have_no_mass():
    text = urdf(
        link("a"), link("b", 0, '<collision><geometry><box size="1 1 1"/></geometry></collision>')
    )
    text = text.replace("</robot>", f"{joint('j', 'a', 'b', kind='fixed')}</robot>")

    model = mujoco.MjModel.from_xml_string(converted(text, base="fixed").text)

    assert model.body("b").mass[0] == 0


def test_an_inertia_of_no_rigid_body_is_replaced_with_a_note():
    text = WALKER.replace('ixx="0.04" iyy="0.04" izz="0.04"', 'ixx="0.1" iyy="0.01" izz="0.01"', 1)

    document = converted(text)
    model = mujoco.MjModel.from_xml_string(document.text)

    np.testing.assert_allclose(model.body("trunk").inertia, 0.04)
    assert any("inertia of trunk" in note for note in document.notes)


def test_visual_geoms_touch_nothing_and_hide_the_collisions_of_their_link():
    visual = '<visual><geometry><box size="1 1 1"/></geometry></visual>'
    text = WALKER.replace('<link name="trunk">', f'<link name="trunk">{visual}')

    trunk = elements(converted(text), ".//body")["trunk"]

    groups = {geom.get("group"): geom.get("contype") for geom in trunk.findall("geom")}
    assert groups == {"2": "0", "3": None}
