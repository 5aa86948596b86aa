"""The quadruped of ``go1`` in the layout and with the conventions of MuJoCo Menagerie.

Its visual meshes are in group 2 and do not collide; its collision geoms are in group 3; its files
are in ``go/xml`` and ``go/meshes``; its first keyframe is not ``home``.
"""

from pathlib import Path

import numpy as np

from tests.helpers.robots.go1 import FLOOR, TRUNK, go1

_ASSETS = """<asset><mesh name="trunk" file="trunk.stl"/>
<mesh file="thigh.stl" scale="0.001 0.001 0.001"/>
<mesh file="calf.stl" refpos="0 0 0.07"/></asset>"""
_CLASS = '<default class="visual"><geom type="mesh" group="2"/></default>'
_MESH = '<geom class="collision" type="mesh" mesh="{0}"/>'
_SEEN = '<geom class="visual" mesh="{0}"/>'

SCENE = """<mujoco model="go scene">
  <include file="go.xml"/>
  <statistic center="0 0 0.1" extent="0.8"/>
  <visual><headlight diffuse="0.6 0.6 0.6"/><global azimuth="-130" elevation="-20"/></visual>
  <asset>
    <texture type="skybox" builtin="gradient" rgb1="0.3 0.5 0.7" rgb2="0 0 0" width="512"
      height="3072"/>
    <texture type="2d" name="grid" builtin="checker" rgb1="0.2 0.3 0.4" rgb2="0.1 0.2 0.3"
      width="300" height="300"/>
    <material name="grid" texture="grid" texuniform="true" texrepeat="5 5"/>
  </asset>
  <worldbody>
    <light pos="0 0 1.5" dir="0 0 -1" directional="true"/>
    <geom name="floor" size="0 0 0.05" type="plane" material="grid" contype="1" condim="3"/>
  </worldbody>
</mujoco>
"""


def menagerie(folder: Path, rings: int = 6, *, meshes_collide: bool = False) -> Path:
    """Writes the robot's package and returns its folder.

    Args:
        folder: Folder in which the package is made.
        rings: Detail of the meshes: each has ``2 * rings**2`` triangles, of 50 bytes.
        meshes_collide: Whether trunk and calves collide with meshes instead of primitives.
    """
    package = folder / "go"
    for part in ("xml", "meshes"):
        (package / part).mkdir(parents=True)
    for name, (centre, radii) in _SHAPES.items():
        (package / "meshes" / f"{name}.stl").write_bytes(stl(ellipsoid(centre, radii, rings)))
    (package / "xml" / "go.xml").write_text(_robot(meshes_collide=meshes_collide), encoding="utf-8")
    (package / "xml" / "scene.xml").write_text(SCENE, encoding="utf-8")
    return package


_SHAPES = {
    "trunk": ((0.0, 0.0, 0.0), (0.2, 0.08, 0.05)),
    "thigh": ((0.0, 0.0, -70.0), (20.0, 20.0, 80.0)),
    "calf": ((0.0, 0.0, 0.0), (0.012, 0.012, 0.08)),
}


def _robot(*, meshes_collide: bool) -> str:
    text = go1(option='<option timestep="0.004" cone="elliptic" impratio="100"/>')
    down = f'<key name="down" qpos="0 0 0.1 1 0 0 0 {"0 1.4 -2.3 " * 4}"/>'
    thigh, foot = '<geom class="collision" size="0.015"', 'class="foot"/>'
    trunk, calf = (_MESH, _MESH.removeprefix("<geom ")) if meshes_collide else (TRUNK, foot)
    for old, new in {
        FLOOR: "",
        "<compiler ": '<compiler meshdir="../meshes/" ',
        "<default>\n    <joint": f"{_ASSETS}<default>{_CLASS}<joint",
        "<keyframe>": f"<keyframe>{down}",
        TRUNK: f"{_SEEN}{trunk}".format("trunk"),
        thigh: _SEEN.format("thigh") + thigh,
        foot: f"{calf}{_SEEN}".format("calf"),
    }.items():
        assert old in text
        text = text.replace(old, new)
    return text


def ellipsoid(
    centre: tuple[float, float, float], radii: tuple[float, float, float], rings: int
) -> np.ndarray:
    """Returns the triangles of an ellipsoid, ``(2 * rings**2, 3, 3)``."""
    polar, around = np.meshgrid(
        np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, rings + 1), indexing="ij"
    )
    unit = np.stack(
        [np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=-1
    )
    points = np.asarray(centre) + np.asarray(radii) * unit
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    return np.concatenate([np.stack([a, b, c], 2), np.stack([a, c, d], 2)]).reshape(-1, 3, 3)


def stl(triangles: np.ndarray) -> bytes:
    """Returns triangles, ``(n, 3, 3)``, as a binary STL file."""
    record = np.zeros(len(triangles), dtype=[("n", "<3f4"), ("v", "<f4", (3, 3)), ("a", "<u2")])
    record["v"] = triangles
    return bytes(80) + len(triangles).to_bytes(4, "little") + record.tobytes()
