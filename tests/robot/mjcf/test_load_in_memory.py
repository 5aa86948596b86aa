"""Tests of models in memory: dm_control's domains, and visual meshes."""

import struct
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np
import pytest
from dm_control.suite import dog, quadruped, swimmer

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.load import adapt_text, robot_from
from selfmodel.robot.mjcf.meshes import MAX_ASSET_BYTES
from selfmodel.robot.mjcf.settings import MjcfSettings
from selfmodel.robot.robot import Robot
from tests.robot.mjcf.awkward import CUBE, MESH, MESHED, TORSO, mjcf


def made(name: str, mjcf: str | bytes, files: Mapping[str, Any]) -> Robot:
    text = mjcf.decode() if isinstance(mjcf, bytes) else mjcf
    return robot_from(adapt_text(name, text, files, MjcfSettings()), name)


def test_domains_of_the_suite_are_robots():
    four_legs = made("quadruped", quadruped.make_model(floor_size=10), quadruped.common.ASSETS)
    snake = made("swimmer", *swimmer.get_model_and_assets(6))

    assert (len(four_legs.anatomy.joints), len(snake.anatomy.joints)) == (12, 5)
    assert sum(sensor.kind == "touch" for sensor in four_legs.anatomy.sensors) == 4


def test_visual_meshes_are_reduced_and_the_masses_stay():
    mjcf_text, files = dog.get_model_and_assets(floor_size=10, remove_ball=True)
    theirs = mujoco.MjModel.from_xml_string(mjcf_text, files)
    robot = made("dog", mjcf_text, files)

    assert sum(map(len, robot.assets.values())) <= MAX_ASSET_BYTES
    for name in (theirs.body(body).name for body in range(1, theirs.nbody)):
        mine, other = robot.model.body(name), theirs.body(name)
        assert np.allclose(mine.mass, other.mass)
        assert np.allclose(mine.inertia, other.inertia)
        assert np.allclose(mine.ipos, other.ipos, atol=1e-9)


def test_a_mesh_with_many_bytes_and_a_small_hull_is_no_reason_to_refuse():
    text = mjcf(more=MESH.format("m", "m.obj"), torso=TORSO + '<geom type="mesh" mesh="m"/>')
    large = CUBE + "# a comment of many bytes\n" * (MAX_ASSET_BYTES // 20)

    assert not made("cube", text, {"m.obj": large}).assets
    assert made("cube", text, {"m.obj": CUBE}).assets.keys() == {"m.obj"}


def test_too_large_height_fields_are_refused():
    side = 1100
    field = struct.pack("<2i", side, side) + bytes(4 * side**2)
    text = mjcf(
        more='<asset><hfield name="h" file="h.bin" size="2 2 .1 .1"/></asset>',
        world='<geom type="hfield" hfield="h"/>',
    )

    with pytest.raises(InputError, match=r"every trial's log contains them.*height fields"):
        made("hilly", text, {"h.bin": field})


def test_a_missing_file_is_refused_by_name():
    with pytest.raises(InputError, match=r"cube: the MJCF names .*'m\.obj'.* is not given: pass"):
        made("cube", mjcf(more=MESH.format("m", "m.obj"), torso=MESHED), {})
