"""Structural mismatch: differences that no parameter of the self-model can represent."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from selfmodel.robot.robot import Robot

BACKLASH_RANGE = (0.005, 0.02)
"""Range of the backlash of a worn gear to either side, rad."""

BEND_RANGE = (0.02, 0.06)
"""Range of the deflection of a soft limb under ``BENDING_TORQUE``, rad."""

BENDING_TORQUE = 5.0
"""Typical torque of a hinge of a walking robot, N m."""

FOOT_RADIUS_FACTORS = (0.7, 1.4)
"""Range of the factor of a foot's radius."""

WEAK_MOTOR_FACTOR = 0.6
"""Factor of the torque limit of a weak motor."""

OUTPUT_ARMATURE = 0.001
"""Inertia of a gear's output side, kg m^2: an added hinge without inertia is unstable."""

TIMESTEP_DIVISOR = 5
"""Physics steps of the physical robot per physics step of the self-model. Backlash of 0.01 rad is
crossed within a step of 5 ms, so its limits would have no effect: the mean penetration of a limit
was 1 to 4 mrad at 5 ms (maximum 70), and 0.1 mrad at 1 ms (maximum 7)."""

OUTPUT_DAMPING = 0.05
"""Damping of an added hinge, N m s/rad: grease, and internal friction of a soft limb."""

BACKLASH_SUFFIX, BEND_SUFFIX = "_play", "_bend"


@dataclass(frozen=True)
class StructuralMismatch:
    """One draw of the structural mismatch of a physical robot.

    Attributes:
        play: Backlash of each driven hinge to either side, rad, by hinge name.
        soft: Hinge of the soft limb, which bends about the axis of the hinge.
        stiffness: Bending stiffness of the soft limb, N m/rad.
        foot: Body of the foot with a different radius; "" for a robot without round feet.
        foot_factor: Factor of the radius of the foot.
        weak: Motor that saturates early; "" for a robot without torque limits.
        saturation: Factor of the torque limits of the weak motor.
    """

    play: Mapping[str, float]
    soft: str
    stiffness: float
    foot: str
    foot_factor: float
    weak: str
    saturation: float

    def as_dict(self) -> dict[str, Any]:
        """Returns the attributes as plain values, for a log."""
        return dataclasses.asdict(self)


def draw_structural_mismatch(robot: Robot, rng: np.random.Generator) -> StructuralMismatch:
    """Returns a random structural mismatch for a robot: the affected parts and their parameters.

    Args:
        robot: The robot as its model describes it.
        rng: Random numbers of the mismatch.
    """
    hinges = [hinge for joint in robot.anatomy.joints for hinge in joint.hinges]
    play = rng.uniform(*BACKLASH_RANGE, len(hinges)).tolist()
    # The hinges of the lower limbs.
    distal = [joint.hinges[-1] for joint in robot.anatomy.joints if len(joint.bodies) == 1]
    feet = [
        sensor.body
        for sensor in robot.anatomy.sensors
        if sensor.kind == "touch" and _round_geoms(robot.model, sensor.body)
    ]
    limited = [
        motor
        for motor in robot.anatomy.motors
        if robot.model.actuator_forcelimited[robot.model.actuator(motor).id]
    ]

    def chosen(names: list[str]) -> str:
        draw = rng.random()
        return names[int(draw * len(names))] if names else ""

    return StructuralMismatch(
        play=dict(zip(hinges, play, strict=True)),
        soft=chosen(distal or hinges),
        stiffness=float(BENDING_TORQUE / rng.uniform(*BEND_RANGE)),
        foot=chosen(feet),
        foot_factor=float(rng.uniform(*FOOT_RADIUS_FACTORS)),
        weak=chosen(limited),
        saturation=WEAK_MOTOR_FACTOR,
    )


def add_structural_mismatch(spec: mujoco.MjSpec, structure: StructuralMismatch) -> None:
    """Adds a structural mismatch to the model of a physical robot.

    Backlash is an additional hinge of the same body, between the geared motor with its angle sensor
    and the limb, that rotates freely within its limits. Compliance is an additional hinge with a
    spring. The added degrees of freedom are not logged; their names end in ``_play`` and ``_bend``.
    The physics time step is shortened.

    Args:
        spec: Model of the healthy robot; it is changed.
        structure: The structural mismatch.
    """
    spec.option.timestep /= TIMESTEP_DIVISOR
    for hinge, play in structure.play.items():
        added = _add_hinge_in_series(spec, hinge, BACKLASH_SUFFIX)
        added.limited = mujoco.mjtLimited.mjLIMITED_TRUE
        added.range = [-play, play]
        # The stiffest limit that is stable at the time step.
        added.solref_limit = [2 * spec.option.timestep, 1.0]
        added.solimp_limit[:3] = [0.99, 0.99, 0.001]
    _add_hinge_in_series(spec, structure.soft, BEND_SUFFIX).stiffness[0] = structure.stiffness
    if structure.foot:
        body = spec.body(structure.foot)
        geoms = [geom for geom in body.geoms if int(geom.type) in ROUND_GEOMS]
        growth = max(geom.size[0] for geom in geoms) * (structure.foot_factor - 1)
        for geom in geoms:
            geom.size[0] *= structure.foot_factor
        # The site of a touch sensor encloses the foot, so the site grows with the foot.
        touch_sites = {sensor.objname for sensor in spec.sensors if sensor.type == TOUCH_SENSOR}
        for site in body.sites:
            if site.name in touch_sites:
                site.size[: SITE_SIZES.get(site.type, 3)] += growth
    if structure.weak:
        motor = spec.actuator(structure.weak)
        motor.forcerange = np.array(motor.forcerange) * structure.saturation


TOUCH_SENSOR = mujoco.mjtSensor.mjSENS_TOUCH

SITE_SIZES = {
    mujoco.mjtGeom.mjGEOM_SPHERE: 1,
    mujoco.mjtGeom.mjGEOM_CAPSULE: 1,
    mujoco.mjtGeom.mjGEOM_CYLINDER: 2,
}
"""Number of size parameters that grow, by the type of a site; 3 for a box and an ellipsoid. The
radius of a capsule is also the radius of its ends."""

ROUND_GEOMS = (int(mujoco.mjtGeom.mjGEOM_SPHERE), int(mujoco.mjtGeom.mjGEOM_CAPSULE))
"""Types of geoms whose first size is a radius in all directions."""


def _add_hinge_in_series(spec: mujoco.MjSpec, hinge: str, suffix: str) -> mujoco.MjsJoint:
    """Adds a hinge about the same axis, between a hinge and its limb."""
    driven = spec.joint(hinge)
    return driven.parent.add_joint(
        name=hinge + suffix,
        type=mujoco.mjtJoint.mjJNT_HINGE,
        pos=driven.pos,
        axis=driven.axis,
        armature=OUTPUT_ARMATURE,
        damping=OUTPUT_DAMPING,
        limited=mujoco.mjtLimited.mjLIMITED_FALSE,
    )


def _round_geoms(model: mujoco.MjModel, body: str) -> list[int]:
    first, count = int(model.body(body).geomadr[0]), int(model.body(body).geomnum[0])
    return [g for g in range(first, first + count) if int(model.geom_type[g]) in ROUND_GEOMS]
