"""A four-legged robot in the layout and with the conventions of MuJoCo Menagerie.

Its visual meshes are in group 2 and do not collide; its collision geoms are in group 3; its files
are in ``go/xml`` and ``go/meshes``; its first keyframe is not ``home``.
"""

from pathlib import Path

import numpy as np

_LEG = """
<body name="{0}_thigh" pos="{1} {2} 0">
  <inertial pos="0 0 -0.07" mass="0.6" diaginertia="0.002 0.002 0.0005"/>
  <joint name="{0}_hip" class="hip"/>
  <geom class="visual" mesh="thigh"/>
  <geom class="collision" type="capsule" size="0.015" fromto="0 0 0 0 0 -0.13"/>
  <body name="{0}_calf" pos="0 0 -0.15">
    <inertial pos="0 0 -0.07" mass="0.3" diaginertia="0.001 0.001 0.0002"/>
    <joint name="{0}_knee" class="knee"/>
    <geom class="visual" mesh="calf"/>
    <geom class="{3}" {4}/>
  </body>
</body>"""

_ROBOT = """<mujoco model="go">
  <compiler angle="radian" meshdir="../meshes/" autolimits="true"/>
  <option timestep="0.004" cone="elliptic" impratio="100"/>
  <default>
    <default class="go">
      <joint axis="0 1 0" damping="0.5" armature="0.01"/>
      <position kp="30" forcerange="-24 24" inheritrange="1"/>
      <default class="hip"><joint range="-0.6 1.6"/></default>
      <default class="knee"><joint range="-2.4 -0.4"/></default>
      <default class="visual">
        <geom type="mesh" contype="0" conaffinity="0" group="2" material="dark"/>
      </default>
      <default class="collision">
        <geom group="3"/>
        <default class="foot"><geom type="sphere" size="0.02" pos="0 0 -0.15"/></default>
      </default>
    </default>
  </default>
  <asset>
    <material name="dark" rgba="0.2 0.2 0.2 1"/>
    <mesh class="go" name="trunk" file="trunk.stl"/>
    <mesh class="go" file="thigh.stl" scale="0.001 0.001 0.001"/>
    <mesh class="go" file="calf.stl" refpos="0 0 0.07"/>
  </asset>
  <worldbody>
    <body name="trunk" pos="0 0 0.4" childclass="go">
      <inertial pos="0 0 0" mass="5" diaginertia="0.02 0.07 0.08"/>
      <freejoint name="free"/>
      <geom class="visual" mesh="trunk"/>
      <geom class="collision" type="{trunk}"/>
      {legs}
    </body>
  </worldbody>
  <actuator>{motors}</actuator>
  <keyframe>
    <key name="down" qpos="0 0 0.1 1 0 0 0 1.4 -2.3 1.4 -2.3 1.4 -2.3 1.4 -2.3"/>
    <key name="home" qpos="0 0 0.27 1 0 0 0 0.6 -1.2 0.6 -1.2 0.6 -1.2 0.6 -1.2"/>
  </keyframe>
</mujoco>
"""

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
    <geom name="floor" size="0 0 0.05" type="plane" material="grid"/>
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
    foot = ("collision", 'type="mesh" mesh="calf"') if meshes_collide else ("foot", "")
    places = {"fl": (0.18, 0.1), "fr": (0.18, -0.1), "bl": (-0.18, 0.1), "br": (-0.18, -0.1)}
    return _ROBOT.format(
        trunk='mesh" mesh="trunk' if meshes_collide else 'box" size="0.18 0.07 0.04',
        legs="".join(_LEG.format(leg, *place, *foot) for leg, place in places.items()),
        motors="".join(
            f'<position class="{joint}" name="{leg}_{joint}" joint="{leg}_{joint}"/>'
            for leg in places
            for joint in ("hip", "knee")
        ),
    )


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
