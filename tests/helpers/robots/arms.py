"""Robots with a fixed base: an arm with six joints, and the quadruped on a stand."""

from functools import lru_cache
from importlib.resources import files

from selfmodel.robot.mjcf.load import adapt_text
from selfmodel.robot.mjcf.settings import MjcfSettings
from selfmodel.robot.robot import Robot

_AXES = ("0 0 1", "0 1 0", "0 1 0", "0 1 0", "0 0 1", "0 1 0")
_LENGTHS = (0.15, 0.3, 0.3, 0.12, 0.1, 0.08)
_GAINS = (200, 200, 150, 60, 40, 20)
_TORQUES = (60, 60, 40, 15, 8, 4)
_LINK = """
<body name="link{n}" pos="0 0 {at}">
  <joint name="joint{n}" axis="{axis}" range="-2.5 2.5" damping="0.5" armature="0.02"/>
  <geom type="capsule" size="0.03" fromto="0 0 0 0 0 {length}"/>
  {beyond}
</body>
"""
_MOTOR = """
<position name="motor{n}" joint="joint{n}" kp="{gain}" kv="{damping}" ctrlrange="-1.5 1.5"
          forcerange="-{torque} {torque}"/>
"""
PEDESTAL = '<body name="pedestal" pos="0.2 0 0.4"><geom size="0.1"/>{arm}</body>'


def arm_mjcf(base: str = PEDESTAL) -> str:
    """Returns the MJCF of an arm with position servos, without contacts.

    Args:
        base: What carries the arm, with ``{arm}`` in its place.
    """
    arm, at = "", (0.1, *_LENGTHS)
    for n in range(6, 0, -1):
        arm = _LINK.format(n=n, at=at[n - 1], axis=_AXES[n - 1], length=_LENGTHS[n - 1], beyond=arm)
    motors = "".join(
        _MOTOR.format(n=n, gain=gain, damping=gain / 15, torque=torque)
        for n, (gain, torque) in enumerate(zip(_GAINS, _TORQUES, strict=True), 1)
    )
    return f"""
    <mujoco model="arm">
      <compiler angle="radian"/>
      <option timestep="0.002" integrator="implicitfast"/>
      <default><geom contype="0" conaffinity="0"/></default>
      <worldbody>{base.format(arm=arm)}</worldbody>
      <actuator>{motors}</actuator>
    </mujoco>"""


def robot_of(mjcf: str, **settings: object) -> Robot:
    """Returns the robot of an MJCF under settings."""
    return adapt_text("robot", mjcf, {}, MjcfSettings(**settings))


@lru_cache
def arm() -> Robot:
    """Returns an arm on a pedestal."""
    return robot_of(arm_mjcf())


@lru_cache
def quadruped_on_a_stand() -> Robot:
    """Returns the quadruped with its base fixed above the ground."""
    mjcf = files("selfmodel.tasks").joinpath("quadruped.xml").read_text()
    return robot_of(mjcf, base="fixed")
