"""Bodies that are not ours, with the sensors of a controller: dm_control's, and an ant."""

import importlib
import re
from collections.abc import Callable, Mapping
from functools import lru_cache, partial

import mujoco
import numpy as np
import pytest

from selfmodel.controllers.controller import CommandSource
from selfmodel.controllers.playback import played_back
from selfmodel.robot.robot import Robot

ANT = """
<mujoco model="ant">
  <compiler angle="degree" inertiafromgeom="true"/>
  <option integrator="RK4" timestep="0.01"/>
  <default>
    <joint armature="1" damping="1" limited="true"/>
    <geom conaffinity="0" density="5" friction="1 0.5 0.5" margin="0.01"/>
    <motor ctrlrange="-1 1" ctrllimited="true" gear="150"/>
  </default>
  <worldbody>
    <geom name="floor" type="plane" size="40 40 40" conaffinity="1"/>
    <body name="torso" pos="0 0 0.75">
      <freejoint name="root"/>
      <geom size="0.25"/>
      {legs}
    </body>
  </worldbody>
  <actuator>{motors}</actuator>
</mujoco>
"""
"""After the ant of Gymnasium: its hinges share no name with those beyond, and have ranges that are
not about 0."""

LEG = """
<body name="hip_{n}" pos="0 0 0">
  <geom type="capsule" size="0.08" fromto="0 0 0 {x} {y} 0"/>
  <body name="aux_{n}" pos="{x} {y} 0">
    <joint name="yaw_{n}" axis="0 0 1" range="-30 30"/>
    <geom type="capsule" size="0.08" fromto="0 0 0 {x} {y} 0"/>
    <body name="foot_{n}" pos="{x} {y} 0">
      <joint name="ankle_{n}" axis="{ax} {ay} 0" range="{low} {high}"/>
      <geom type="capsule" size="0.08" fromto="0 0 0 {fx} {fy} 0"/>
    </body>
  </body>
</body>
"""


def ant() -> str:
    """The MJCF of an ant."""
    legs = ""
    for n, (x, y, low) in enumerate(((1, 1, 30), (-1, 1, -70), (-1, -1, -70), (1, -1, 30))):
        sizes = {"x": 0.2 * x, "y": 0.2 * y, "fx": 0.4 * x, "fy": 0.4 * y}
        axis = {"ax": -1 if x == y else 1, "ay": 1, "low": low, "high": low + 40}
        legs += LEG.format(n=n, **sizes, **axis)
    motors = "".join(
        f'<motor name="{joint}_{n}" joint="{joint}_{n}"/>'
        for n in range(4)
        for joint in ("yaw", "ankle")
    )
    return ANT.format(legs=legs, motors=motors)


def sensed(
    name: str, mjcf: str, control_timestep: float, assets: Mapping[str, bytes] | None = None
) -> Robot:
    """A robot with a sensor on each hinge but the root's, and one that feels its last body."""
    spec = mujoco.MjSpec.from_string(mjcf, assets=dict(assets or {}))
    for part in (*spec.skins, *spec.keys, *spec.sensors, *spec.textures):
        spec.delete(part)
    size = np.full(3, 0.1)
    spec.bodies[-1].add_site(name="selfmodel_toe", size=size)
    spec.add_sensor(
        name="toe_touch",
        type=mujoco.mjtSensor.mjSENS_TOUCH,
        objtype=mujoco.mjtObj.mjOBJ_SITE,
        objname="selfmodel_toe",
    )
    for joint in spec.joints:
        if joint.type == mujoco.mjtJoint.mjJNT_HINGE and not joint.name.startswith("root"):
            spec.add_sensor(
                name=f"{joint.name}_angle",
                type=mujoco.mjtSensor.mjSENS_JOINTPOS,
                objtype=mujoco.mjtObj.mjOBJ_JOINT,
                objname=joint.name,
            )
    spec.compile()
    return Robot(name, spec.to_xml(), control_timestep, dict(assets or {}))


def from_suite(domain: str, control_timestep: float, *arguments: object) -> Robot:
    """A body of dm_control's suite, without what is only to be seen."""
    module = importlib.import_module(f"dm_control.suite.{domain}")
    if domain == "quadruped":
        mjcf, assets = module.make_model(), {}
    else:
        mjcf, assets = module.get_model_and_assets(*arguments)
    text = mjcf.decode() if isinstance(mjcf, bytes) else mjcf
    text = re.sub(r"<include [^>]*/>", "", text)
    text = re.sub(r'\s(material|texture)="[^"]*"', "", text)
    text = text.replace('<compiler settotalmass="14"/>', "")  # MuJoCo warns of it
    files = {name: data for name, data in assets.items() if name.endswith((".stl", ".obj"))}
    return sensed(domain, text, control_timestep, files)


BODIES: Mapping[str, Callable[[], Robot]] = {
    "walker": lru_cache(partial(from_suite, "walker", 0.025)),
    "cheetah": lru_cache(partial(from_suite, "cheetah", 0.01)),
    "hopper": lru_cache(partial(from_suite, "hopper", 0.02)),
    "swimmer": lru_cache(partial(from_suite, "swimmer", 0.03, 4)),
    "humanoid": lru_cache(partial(from_suite, "humanoid", 0.025)),
    "quadruped": lru_cache(partial(from_suite, "quadruped", 0.02)),
    "dog": lru_cache(partial(from_suite, "dog", 0.015, 10, True)),
    "ant": lru_cache(partial(sensed, "ant", ant(), 0.05)),
}
"""Each body by its name; built once."""

EVERY_BODY = [
    name if name in ("walker", "hopper", "ant") else pytest.param(name, marks=pytest.mark.bodies)
    for name in sorted(BODIES)
]
"""The names, for a test of every body: the fast tests keep three small ones."""


def swinging(robot: Robot, steps: int) -> np.ndarray:
    """Commands that move every motor over half its range, ``(steps, motors)``."""
    low, high = robot.model.actuator_ctrlrange.T
    rng = np.random.default_rng(0)
    phase = 9.0 * np.arange(steps)[:, np.newaxis] * robot.control_timestep
    wave = np.sin(phase + rng.uniform(0, 2 * np.pi, robot.model.nu))
    return (low + high) / 2 + (high - low) / 4 * wave


def swung(robot: Robot, steps: int) -> CommandSource:
    """A driver that gives these commands."""
    return played_back(robot.anatomy.motors, swinging(robot, steps))
