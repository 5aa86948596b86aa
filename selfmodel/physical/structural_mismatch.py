"""Mismatches of structure: what no parameter of the self-model can absorb."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from selfmodel.robot.robot import Robot

PLAY = (0.005, 0.02)
"""How far the output of a worn gear turns freely to either side, rad."""

BEND = (0.02, 0.06)
"""How far a soft limb bends, rad, under ``BENDING_TORQUE``."""

BENDING_TORQUE = 5.0
"""N m, of the size that walking takes."""

FOOT = (0.7, 1.4)
"""Times the nominal radius of a foot."""

SATURATION = 0.6
"""Part of its torque limit at which a weak motor saturates."""

OUTPUT_ARMATURE = 0.001
"""Inertia of a gear's output side, kg m^2: what an added hinge needs to be stable."""

FINER = 5
"""How many steps such a robot's physics takes in one of the self-model's. Play of a hundredth of a
radian is crossed within a step of 5 ms, so that its limits would be none: at 5 ms they gave way by
1 to 4 mrad on the mean and by up to 70, at 1 ms by 0.1 and by up to 7."""

OUTPUT_DAMPING = 0.05
"""Damping of an added hinge, N m s/rad: grease, and the inner friction of a soft limb."""

PLAY_SUFFIX, SOFT_SUFFIX = "_play", "_bend"


@dataclass(frozen=True)
class Structure:
    """One drawing of the mismatches of structure of a physical robot.

    Attributes:
        play: Backlash to either side, rad, by the hinge: each that a motor drives.
        soft: The hinge at whose body's root the limb bends, in the plane in which the hinge turns.
        stiffness: Of that limb, N m/rad.
        foot: The body whose foot has another size; "" where there are no round feet.
        foot_factor: Its radius by the nominal one.
        weak: The motor that saturates early; "" where no motor has a limit.
        saturation: Its torque limits by the nominal ones.
    """

    play: Mapping[str, float]
    soft: str
    stiffness: float
    foot: str
    foot_factor: float
    weak: str
    saturation: float

    def as_values(self) -> dict[str, Any]:
        """Returns its numbers as plain values, for a log."""
        return dataclasses.asdict(self)


def draw_structure(robot: Robot, rng: np.random.Generator) -> Structure:
    """Returns mismatches of structure drawn for a robot: which parts they strike, and how far.

    Args:
        robot: The robot as its model describes it.
        rng: Where everything is drawn from.
    """
    hinges = [hinge for joint in robot.anatomy.joints for hinge in joint.hinges]
    play = rng.uniform(*PLAY, len(hinges)).tolist()
    # The outermost hinges: their bodies are the lower limbs.
    outer = [joint.hinges[-1] for joint in robot.anatomy.joints if len(joint.bodies) == 1]
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
        pick = rng.random()
        return names[int(pick * len(names))] if names else ""

    return Structure(
        play=dict(zip(hinges, play, strict=True)),
        soft=chosen(outer or hinges),
        stiffness=float(BENDING_TORQUE / rng.uniform(*BEND)),
        foot=chosen(feet),
        foot_factor=float(rng.uniform(*FOOT)),
        weak=chosen(limited),
        saturation=SATURATION,
    )


def add_structure(spec: mujoco.MjSpec, structure: Structure) -> None:
    """Works mismatches of structure into the model of a physical robot.

    Backlash is an added hinge of the same body, between the geared motor with its angle sensor and
    the limb, that turns freely up to its limits; compliance one with a spring. Both add degrees of
    freedom, and no parts that anybody sees: their names end in ``_play`` and ``_bend``. The time
    step becomes shorter.

    Args:
        spec: The model with nothing wrong, changed.
        structure: What is different.
    """
    spec.option.timestep /= FINER
    for hinge, play in structure.play.items():
        added = _in_series(spec, hinge, PLAY_SUFFIX)
        added.limited = mujoco.mjtLimited.mjLIMITED_TRUE
        added.range = [-play, play]
        # As hard as the time step allows.
        added.solref_limit = [2 * spec.option.timestep, 1.0]
        added.solimp_limit[:3] = [0.99, 0.99, 0.001]
    _in_series(spec, structure.soft, SOFT_SUFFIX).stiffness[0] = structure.stiffness
    if structure.foot:
        body = spec.body(structure.foot)
        geoms = [geom for geom in body.geoms if int(geom.type) in ROUND]
        wider = max(geom.size[0] for geom in geoms) * (structure.foot_factor - 1)
        for geom in geoms:
            geom.size[0] *= structure.foot_factor
        # The zone in which touch is felt is the foot's, so it grows as the foot does.
        felt = {sensor.objname for sensor in spec.sensors if sensor.type == TOUCH}
        for site in body.sites:
            if site.name in felt:
                site.size[: EXTENTS.get(site.type, 3)] += wider
    if structure.weak:
        motor = spec.actuator(structure.weak)
        motor.forcerange = np.array(motor.forcerange) * structure.saturation


TOUCH = mujoco.mjtSensor.mjSENS_TOUCH

EXTENTS = {
    mujoco.mjtGeom.mjGEOM_SPHERE: 1,
    mujoco.mjtGeom.mjGEOM_CAPSULE: 1,
    mujoco.mjtGeom.mjGEOM_CYLINDER: 2,
}
"""The sizes of a site that are its own; a box and an ellipsoid have three. A capsule's ends are
round, so it grows all around by its radius."""

ROUND = (int(mujoco.mjtGeom.mjGEOM_SPHERE), int(mujoco.mjtGeom.mjGEOM_CAPSULE))
"""The shapes of geoms whose first size is a radius all around."""


def _in_series(spec: mujoco.MjSpec, hinge: str, suffix: str) -> mujoco.MjsJoint:
    """Adds a hinge about the same axis, on the limb's side."""
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
    return [g for g in range(first, first + count) if int(model.geom_type[g]) in ROUND]
