"""A quadruped after the Unitree Go1 in MJX's models: position servos, and one solver iteration."""

import math

import numpy as np

from selfmodel.controllers.controller import CommandSource
from selfmodel.controllers.playback import played_back
from selfmodel.robot.robot import Robot

OPTION = (
    '<option iterations="1" ls_iterations="5" timestep="0.004" integrator="Euler">'
    '<flag eulerdamp="disable"/></option>'
)
HIP, KNEE = 0.9, -1.8
"""Angles of the keyframe ``home``, rad."""

HOME_HEIGHT = 0.272
"""Height of the trunk in the keyframe ``home``, m."""

FLOOR = '<geom name="floor" type="plane" size="0 0 1" contype="1" conaffinity="0" condim="3"/>'
TRUNK = '<geom class="collision" type="box" size="0.125 0.04 0.057"/>'
_LEG = """
<body name="{leg}_hip" pos="{x} {y} 0">
  <inertial pos="0 0 0" mass="0.68" diaginertia="5e-4 7e-4 5e-4"/>
  <joint name="{leg}_hip_joint" class="abduction"/>
  <body name="{leg}_thigh" pos="0 {out} 0">
    <inertial pos="0 0 -0.03" mass="1.0" diaginertia="5e-3 5e-3 1e-3"/>
    <joint name="{leg}_thigh_joint" class="hip"/>
    <geom class="collision" size="0.015" fromto="0 0 0 0 0 -0.2"/>
    <body name="{leg}_calf" pos="0 0 -0.213">
      <inertial pos="0 0 -0.1" mass="0.13" diaginertia="1e-3 1e-3 5e-5"/>
      <joint name="{leg}_calf_joint" class="knee"/>
      <geom name="{leg}" class="foot"/>
    </body>
  </body>
</body>"""

_MJCF = """
<mujoco model="go1">
  <compiler angle="radian" autolimits="true"/>
  {option}
  <default>
    <joint axis="0 1 0" armature="0.005" damping="0.5" frictionloss="0.3"/>
    <position kp="35" forcerange="-23.7 23.7" inheritrange="1"/>
    <geom condim="1" contype="0" conaffinity="0"/>
    <default class="abduction"><joint axis="1 0 0" range="-0.863 0.863"/></default>
    <default class="hip"><joint range="-0.686 4.501"/></default>
    <default class="knee">
      <joint range="-2.818 -0.888" frictionloss="1"/><position forcerange="-35.55 35.55"/>
    </default>
    <default class="collision"><geom group="3" type="capsule" conaffinity="1"/></default>
    <default class="foot">
      <geom group="3" size="0.023" pos="0 0 -0.213" condim="3" conaffinity="1"
            solimp="0.9 0.95 0.023" friction="0.8"/>
    </default>
  </default>
  <worldbody>
    {floor}
    <body name="trunk" pos="0 0 0.3">
      <freejoint/>
      <inertial pos="0.022 0 0" mass="5.2" diaginertia="0.017 0.063 0.072"/>
      {trunk}
      {legs}
    </body>
  </worldbody>
  <actuator>{motors}</actuator>
  <keyframe><key name="home" qpos="{home}"/></keyframe>
</mujoco>"""

_PLACES = {
    "FR": (0.188, -0.047),
    "FL": (0.188, 0.047),
    "RR": (-0.188, -0.047),
    "RL": (-0.188, 0.047),
}


def go1(option: str = OPTION) -> str:
    """Returns the MJCF of the quadruped.

    Args:
        option: The ``<option>`` element.
    """
    legs = "".join(
        _LEG.format(leg=leg, x=x, y=y, out=math.copysign(0.08, y))
        for leg, (x, y) in _PLACES.items()
    )
    motors = "".join(
        f'<position class="{kind}" name="{leg}_{part}" joint="{leg}_{part}_joint"/>'
        for leg in _PLACES
        for part, kind in (("hip", "abduction"), ("thigh", "hip"), ("calf", "knee"))
    )
    angles = f"0 {HIP} {KNEE} " * len(_PLACES)
    home = f"0 0 {HOME_HEIGHT} 1 0 0 0 {angles}"
    return _MJCF.format(
        option=option, floor=FLOOR, trunk=TRUNK, legs=legs, motors=motors, home=home
    )


def trot(robot: Robot, steps: int, stride: float = 0.12) -> CommandSource:
    """Returns the commands of a trot; a stride of 0 is the pose ``home``.

    Args:
        robot: The quadruped.
        steps: Control steps.
        stride: Amplitude of the hips, rad.
    """
    phase = 2 * np.pi * 2 * robot.control_timestep * np.arange(steps)
    columns = []
    for motor in robot.anatomy.motors:
        leg, part = motor.split("_")
        own = phase + (0 if leg in ("FR", "RL") else np.pi)
        lift = 1.5 * stride * np.maximum(0, np.cos(own))
        angles = {"hip": 0 * own, "thigh": HIP + stride * np.sin(own), "calf": KNEE - lift}
        columns.append(angles[part])
    return played_back(robot.anatomy.motors, np.stack(columns, axis=1))
