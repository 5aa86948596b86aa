"""Tests of keyframes: the one in which a robot starts becomes its reference pose."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.load import adapt, load_mjcf
from selfmodel.robot.mjcf.settings import MjcfSettings
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


def test_a_keyframe_is_chosen_by_name_or_none(tmp_path: Path):
    keys = "".join(f'<key name="{n}" qpos="0 0 {z} 1 0 0 0 0 0"/>' for n, z in (("a", 1), ("b", 2)))
    path = written(tmp_path, mjcf(more=f"<keyframe>{keys}</keyframe>"))

    heights = [
        load_mjcf(path, MjcfSettings(keyframe=name)).standing_height
        for name in ("", "a", "b", "none")
    ]

    assert heights == [1, 1, 2, 0.35]
    with pytest.raises(InputError, match=r"unknown keyframe 'c'.* a, b, none"):
        load_mjcf(path, MjcfSettings(keyframe="c"))


@pytest.mark.parametrize(
    ("names", "chosen"),
    [
        (("down", "home"), "home"),
        (("standing", "stand"), "stand"),
        (("down", "standing"), "standing"),
        (("down", "up"), "down"),
    ],
)
def test_a_robot_starts_in_the_usual_keyframe_or_the_first(
    names: tuple[str, ...], chosen: str, tmp_path: Path
):
    keys = "".join(
        f'<key name="{name}" qpos="0 0 .35 1 0 0 0 .{number} 0"/>'
        for number, name in enumerate(names)
    )
    path = written(tmp_path, mjcf(more=f"<keyframe>{keys}</keyframe>"))

    notes = adapt(path, MjcfSettings()).notes

    assert f"the initial pose is the keyframe {chosen}" in notes


def test_a_keyframe_that_breaks_an_equality_is_refused(tmp_path: Path):
    equality = '<equality><joint joint1="left_hip" joint2="right_hip"/></equality>'
    key = '<keyframe><key qpos="0 0 .4 1 0 0 0 {}"/></keyframe>'

    assert load_mjcf(written(tmp_path, mjcf(more=equality + key.format(".2 .2"))))
    with pytest.raises(InputError, match=r"equality constraints.*keyframe=none"):
        load_mjcf(written(tmp_path, mjcf(more=equality + key.format(".2 -.2"))))
