"""Tests of the initial pose: keyframes, bases on stands, and freed robots."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.mjcf.pose import STAND_CLEARANCE
from selfmodel.robot.mjcf.settings import MjcfSettings, checked_settings
from tests.helpers.robots.arms import PEDESTAL, arm_mjcf, robot_of
from tests.robot.mjcf.awkward import GROUND, LEGS, mjcf
from tests.robot.mjcf.motion import moved, theirs, written

SPRUNG = """<tendon><spatial name="band" stiffness="40"><site site="a"/><site site="b"/></spatial>
</tendon>"""
SPRUNG_LEGS = LEGS.replace("</body>", '<site name="a" pos="0 .02 -.2"/></body>', 1)

TINY = 1e-300
"""Smallest number that MuJoCo reads from an XML text."""


def angles(most: float) -> st.SearchStrategy[float]:
    return st.floats(-most, most).filter(lambda angle: angle == 0 or abs(angle) > TINY)


# The same examples in every run: a rare one leaves an error of 1.03e-5 m after the steps, from
# the six digits of numbers in an MJCF, and the bound is 1e-5 m.
@pytest.mark.search
@settings(derandomize=True)
@given(
    height=st.floats(2, 3),  # in the air: contacts are as soft as the reference pose makes them
    turn=st.tuples(*[angles(1)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1),
    hips=st.tuples(angles(0.6), angles(0.6)),
    unit=st.sampled_from(["", '<compiler angle="radian"/>']),
)
def test_a_robot_starts_and_moves_as_from_its_keyframe(
    tmp_path_factory: pytest.TempPathFactory,
    height: float,
    turn: tuple[float, ...],
    hips: tuple[float, float],
    unit: str,
):
    pose = " ".join(map(repr, (0.1, -0.2, height, *turn, *hips)))
    legs = SPRUNG_LEGS.replace('range="-40 40"', 'pos="0 0 .02" ref=".1" limited="false"')
    text = mjcf(
        more=f'{unit}{SPRUNG}<keyframe><key name="home" qpos="{pose}"/></keyframe>',
        world=GROUND + '<site name="b" pos="0 0 3"/>',
        legs=legs,
    )
    path = written(tmp_path_factory.mktemp("key"), text)
    model, robot = theirs(path), load_mjcf(path)
    key = model.key("home").qpos

    assert robot.model.nkey == 0
    assert np.allclose(robot.model.qpos0, key, atol=1e-9)
    before, after = (moved(m, q, 20) for m, q in ((model, key), (robot.model, robot.model.qpos0)))
    assert np.allclose(before.xpos, after.xpos, atol=1e-5)


@pytest.mark.parametrize(
    ("names", "wanted", "chosen"),
    [
        (("a", "b"), "", 0),
        (("a", "b"), "b", 1),
        (("a", "b"), "none", None),
        (("down", "home"), "", 1),
        (("standing", "stand"), "", 1),
        (("down", "standing"), "", 1),
    ],
)
def test_a_robot_starts_in_the_keyframe_of_the_settings_or_the_usual_one_or_the_first(
    names: tuple[str, ...], wanted: str, chosen: int | None, tmp_path: Path
):
    keys = "".join(f'<key name="{n}" qpos="0 0 {z} 1 0 0 0 0 0"/>' for z, n in enumerate(names, 1))
    path = written(tmp_path, mjcf(more=f"<keyframe>{keys}</keyframe>"))
    robot = load_mjcf(path, MjcfSettings(keyframe=wanted))
    note = "" if chosen is None else f"the initial pose is the keyframe {names[chosen]}"

    assert robot.standing_height == (0.35 if chosen is None else chosen + 1)
    assert [one for one in robot.notes if "keyframe" in one] == [note] * bool(note)
    with pytest.raises(InputError, match=rf"unknown keyframe 'c'.* {', '.join(names)}, none"):
        load_mjcf(path, MjcfSettings(keyframe="c"))


def test_a_keyframe_that_breaks_an_equality_is_refused(tmp_path: Path):
    equality = '<equality><joint joint1="left_hip" joint2="right_hip"/></equality>'
    key = '<keyframe><key qpos="0 0 .4 1 0 0 0 {}"/></keyframe>'

    assert load_mjcf(written(tmp_path, mjcf(more=equality + key.format(".2 .2"))))
    with pytest.raises(InputError, match=r"equality constraints.*keyframe=none"):
        load_mjcf(written(tmp_path, mjcf(more=equality + key.format(".2 -.2"))))


TWO_ARMS = '<body name="left" pos="0 1 0">{arm}</body><body name="table"><geom size=".1"/></body>'


def touches_floor(model: mujoco.MjModel, qpos: np.ndarray) -> bool:
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    return bool((data.contact.geom == model.geom("floor").id).any())


def test_an_arm_directly_on_the_world_gets_a_base_and_moves_as_before():
    bare, given = robot_of(arm_mjcf("{arm}")), mujoco.MjModel.from_xml_string(arm_mjcf("{arm}"))
    assert bare.root == "base"
    states = []
    for model in (given, bare.model):
        data = mujoco.MjData(model)
        data.ctrl[:] = 0.5
        for _ in range(100):
            mujoco.mj_step(model, data)
        states.append(data.qpos.copy())
    assert np.array_equal(*states)


def test_two_arms_on_two_bodies_of_the_world_are_one_robot():
    second = arm_mjcf("{arm}").split("<worldbody>")[1].split("</worldbody>")[0]
    for kind in ("link", "joint"):
        second = second.replace(f'name="{kind}', f'name="other_{kind}')
    both = arm_mjcf(TWO_ARMS + f'<body name="right" pos="0 -1 0">{second}</body>')
    motor = '<motor name="other" joint="other_joint1" ctrlrange="-1 1"/></actuator>'
    robot = robot_of(both.replace("</actuator>", motor))
    assert robot.root == "base"
    parents = {robot.model.body(name).parentid[0] for name in ("left", "right")}
    assert parents == {robot.model.body("base").id}
    assert robot.model.body("table").parentid[0] == 0


def test_a_robot_on_a_stand_touches_no_ground_at_any_joint_angles():
    robot = robot_of(mjcf(world=GROUND), base="fixed")
    assert robot.has_fixed_base
    rng = np.random.default_rng(0)
    poses = rng.uniform(-np.pi, np.pi, (200, robot.model.nq))
    low = robot_of(mjcf(world=GROUND), base="fixed", base_height=0.25)
    assert any(touches_floor(low.model, pose) for pose in poses)
    assert not any(touches_floor(robot.model, pose) for pose in poses)


def test_the_stand_is_as_low_as_the_reach_of_the_robot_permits():
    robot = robot_of(mjcf(world=GROUND), base="fixed")
    # A hip at (0.1, 0, -0.1), a thigh of 0.2 about a capsule's end of 0.03.
    reach = np.hypot(0.1, 0.1) + 0.2 + 0.03
    assert robot.standing_height == pytest.approx(reach + STAND_CLEARANCE)


def test_a_stand_is_above_the_top_of_other_ground():
    block = '<geom name="block" type="box" size="1 1 .1"/>'
    block, floor = (robot_of(mjcf(world=world), base="fixed") for world in (block, GROUND))
    assert block.standing_height - floor.standing_height == pytest.approx(0.1)


def test_the_height_of_a_stand_can_be_set():
    carried = '<body name="table" pos="0 0 .2"><geom size=".1"/>' + PEDESTAL + "</body>"
    for text in (mjcf(), arm_mjcf(), arm_mjcf(carried)):
        assert robot_of(text, base="fixed", base_height=2.5).standing_height == 2.5


def test_hips_that_overlap_the_base_do_not_touch_it_when_it_is_fixed():
    torso = '<geom type="box" size=".2 .1 .1"/>'
    for root in ("<freejoint/>", '<joint type="slide" axis="1 0 0"/>'):
        model = robot_of(mjcf(torso=torso, root=root), base="fixed").model
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        assert data.ncon == 0


def test_a_fixed_robot_can_be_freed_with_its_keyframe():
    key = '<keyframe><key name="home" qpos=".2 -.2" qvel="0 0"/></keyframe>'
    robot = robot_of(mjcf(root="", more=key), base="free")
    assert not robot.has_fixed_base
    assert robot.model.qpos0.tolist() == pytest.approx([0, 0, 0.35, 1, 0, 0, 0, 0.2, -0.2])


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"base": "hanging"}, "one of free, fixed, got 'hanging'"),
        ({"base": "fixed", "base_height": "high"}, "got 'high'"),
        ({"base_height": 1.0}, 'base = "fixed", got 1.0'),
    ],
)
def test_wrong_settings_of_the_base_are_refused(given: dict[str, object], sentence: str):
    with pytest.raises(InputError, match=sentence):
        checked_settings(given)
