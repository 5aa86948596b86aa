"""Mutations of URDF: those of XML, with elements of URDF."""

import numpy as np

from tests.fuzz.mutate import xmls

FRAGMENTS = {
    "robot": (
        '<link name="extra"/>',
        '<link name="left_foot"/>',
        '<link name="world"/>',
        '<joint name="loop" type="fixed"><parent link="left_foot"/><child link="trunk"/></joint>',
        '<joint name="x" type="prismatic"><parent link="trunk"/><child link="extra"/></joint>',
        '<joint name="y" type="floating"><parent link="extra"/><child link="trunk"/></joint>',
        '<joint name="z" type="fixed"><parent link="world"/><child link="trunk"/></joint>',
        '<joint name="self" type="continuous"><parent link="trunk"/><child link="trunk"/></joint>',
        '<mujoco><compiler meshdir="/etc" discardvisual="false"/><option timestep="9"/></mujoco>',
        '<gazebo reference="trunk"><plugin filename="x.so"/></gazebo>',
        '<transmission name="t"/>',
        '<material name="red"><color rgba="1 0 0 1"/></material>',
        '<material name="m"><texture filename="/etc/passwd"/></material>',
        '<include file="/etc/passwd"/>',
        '<worldbody><body name="b"><freejoint/></body></worldbody>',
    ),
    "link": (
        '<inertial><mass value="0"/></inertial>',
        '<inertial><mass value="1e9"/><inertia ixx="1" iyy="-1" izz="1e-300"/></inertial>',
        '<inertial><origin rpy="1e9 1 1"/><mass value="1"/></inertial>',
        '<collision><geometry><mesh filename="foot.obj" scale="0 0 0"/></geometry></collision>',
        '<collision><geometry><mesh filename="foot.obj" scale="-1 1 1e9"/></geometry></collision>',
        '<collision><geometry><mesh filename="package://a/foot.obj"/></geometry></collision>',
        '<visual><geometry><mesh filename="file:///etc/passwd"/></geometry></visual>',
        '<visual><geometry><mesh filename="../../x.dae"/></geometry></visual>',
        '<visual><geometry><capsule radius="1" length="-1"/></geometry></visual>',
        '<collision><geometry><sphere radius="1e9"/></geometry></collision>',
        '<collision><geometry><box size="0 0 0"/></geometry></collision>',
        "<collision><geometry/></collision>",
        "<collision/>",
        '<visual><geometry><box size="1 1 1"/></geometry><material name="red"/></visual>',
        '<mimic joint="left_hip" multiplier="1e9"/>',
        '<limit lower="1" upper="-1" effort="0" velocity="0"/>',
        '<origin xyz="1e10 0 0" rpy="0 0 0"/>',
    ),
}
"""New elements, by the element that they go into."""


def mutated(data: bytes, rng: np.random.Generator) -> tuple[bytes, str]:
    """Returns a URDF with one to three mutations, and their names."""
    return xmls.mutated(data, rng, FRAGMENTS)
