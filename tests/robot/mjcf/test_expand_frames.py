"""Tests of ``<frame>`` elements: afterwards every part is where MuJoCo puts it."""

from pathlib import Path
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pytest

from selfmodel.robot.mjcf.document import Document
from selfmodel.robot.mjcf.expand import expand
from selfmodel.robot.mjcf.load import load_mjcf
from tests.robot.mjcf.awkward import LEGS, MOTORS, mjcf

FRAMES = """<mujoco><default><default class="c"><geom type="capsule" size=".01"
fromto="0 0 0 0 0 .3"/><site pos="1 0 0"/><joint pos="0 0 1" axis="1 0 0"/></default></default>
<asset><mesh name="m" vertex="1 0 0 2 0 0 0 1 0 0 0 3"/></asset><worldbody>
<frame pos="0 0 3"><geom size=".1"/></frame><body name="a"><freejoint/><geom size=".1"/>
<frame pos="1 0 0" euler="0 0 70" childclass="c"><geom/><geom class="main" size=".1"/>
  <geom type="mesh" mesh="m" pos="0 1 0" euler="10 20 30" class="main"/>
  <site name="s"/><camera pos="0 0 1" xyaxes="0 1 0 0 0 1"/><light pos="0 1 1" dir="1 0 0"/>
  <body name="b" pos="0 1 0" euler="5 0 0"><frame euler="0 30 0"><joint name="j"/></frame>
    <geom fromto="0 0 0 0 1 0"/><frame pos="0 0 1"><body name="d"><geom/></body></frame></body>
  <frame pos="0 0 2" axisangle="0 1 0 40"><body name="e"><geom/></body></frame></frame></body>
<replicate count="2" offset=".1 0 0" euler="0 0 10"><geom size=".01"/></replicate>
</worldbody></mujoco>"""


def test_every_part_of_a_frame_keeps_its_place():
    before = mujoco.MjModel.from_xml_string(FRAMES)
    document = Document(ET.fromstring(FRAMES))  # noqa: S314  # the text is above

    expand(document)
    after = mujoco.MjModel.from_xml_string(document.text)

    assert "<frame" not in document.text
    for kind in ("body", "geom", "site", "cam"):
        for part in ("pos", "quat"):
            old, new = (getattr(model, f"{kind}_{part}") for model in (before, after))
            assert np.allclose(old, new, atol=1e-5), (kind, part)
    for name in ("jnt_pos", "jnt_axis", "light_pos", "light_dir", "geom_size", "geom_type"):
        assert np.allclose(getattr(before, name), getattr(after, name), atol=1e-5), name


@pytest.mark.parametrize("keyframe", ["", "<keyframe><key name='home' qpos='{}'/></keyframe>"])
def test_limbs_in_frames_are_driven_named_and_started_in_a_keyframe(tmp_path: Path, keyframe: str):
    legs = f'<frame pos="0 .1 .01" euler="0 0 5">{LEGS}</frame>'
    pose = "0 0 .4 1 0 0 0 .3 -.3"
    (tmp_path / "robot.xml").write_text(
        mjcf(legs=legs, motors=MOTORS, more=keyframe.format(pose)), encoding="utf-8"
    )

    robot = load_mjcf(tmp_path / "robot.xml")

    assert robot.anatomy.hinges == ("left_hip", "right_hip")
    assert "<frame" not in robot.mjcf
