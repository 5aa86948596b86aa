"""A hexapod of 18 position servos as a URDF, with effort and velocity limits."""

import math

BODY, COXA, FEMUR, TIBIA = 1.8, 0.04, 0.1, 0.1
"""Masses of the trunk and of the links of a leg, kg."""

LENGTHS = (0.05, 0.1, 0.14)
"""Lengths of coxa, femur and tibia, m."""

EFFORT, VELOCITY = 10.0, 6.0
"""Limits of each servo, N m and rad/s."""

LEGS = ("left_front", "left_middle", "left_back", "right_front", "right_middle", "right_back")
PLACES = ((0.12, 0.06), (0.0, 0.1), (-0.12, 0.06))
DIRECTIONS = (45, 90, 135)


def _link(name: str, mass: float, length: float, *, foot: bool = False) -> str:
    moment, along = mass * (length**2 + 0.03**2) / 12, mass * 0.03**2 / 6
    foot_shape = (
        f'<collision><origin xyz="{length} 0 0"/><geometry><sphere radius="0.012"/></geometry>'
        "</collision>"
    )
    return f"""<link name="{name}"><inertial><origin xyz="{length / 2} 0 0"/><mass value="{mass}"/>
    <inertia ixx="{along}" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"/></inertial>
    {foot_shape if foot else ""}</link>"""


def _joint(
    name: str, ends: tuple[str, str], place: str, axis: str, span: tuple[float, float]
) -> str:
    return f"""<joint name="{name}" type="revolute"><parent link="{ends[0]}"/>
    <child link="{ends[1]}"/><origin {place}/><axis xyz="{axis}"/>
    <limit lower="{span[0]}" upper="{span[1]}" effort="{EFFORT}" velocity="{VELOCITY}"/></joint>"""


def _leg(name: str, x: float, y: float, yaw: float) -> str:
    coxa, femur, tibia = (f"{name}_{part}" for part in ("coxa", "femur", "tibia"))
    return (
        _link(coxa, COXA, LENGTHS[0])
        + _link(femur, FEMUR, LENGTHS[1])
        + _link(tibia, TIBIA, LENGTHS[2], foot=True)
        + _joint(
            f"{name}_yaw",
            ("trunk", coxa),
            f'xyz="{x} {y} 0" rpy="0 0 {yaw}"',
            "0 0 1",
            (-0.6, 0.6),
        )
        + _joint(f"{name}_hip", (coxa, femur), f'xyz="{LENGTHS[0]} 0 0"', "0 1 0", (-0.9, 0.9))
        + _joint(
            f"{name}_knee",
            (femur, tibia),
            f'xyz="{LENGTHS[1]} 0 0" rpy="0 1.3 0"',
            "0 1 0",
            (-0.9, 0.9),
        )
    )


def hexapod_urdf() -> str:
    """Returns the URDF."""
    box = '<collision><geometry><box size="0.26 0.12 0.06"/></geometry></collision>'
    trunk = f"""<link name="trunk"><inertial><mass value="{BODY}"/>
    <inertia ixx="0.003" iyy="0.011" izz="0.013" ixy="0" ixz="0" iyz="0"/></inertial>{box}</link>"""
    legs = []
    for number, name in enumerate(LEGS):
        sign = 1 if number < 3 else -1
        (x, y), angle = PLACES[number % 3], DIRECTIONS[number % 3]
        legs.append(_leg(name, x, sign * y, sign * math.radians(angle)))
    return f'<robot name="hexapod">{trunk}{"".join(legs)}</robot>'
