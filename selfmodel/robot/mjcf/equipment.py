"""Motors and sensors of an MJCF: physics of joints, servos, command ranges, sensors."""

from collections import Counter
from collections.abc import Collection, Sequence
from itertools import product
from xml.etree import ElementTree as ET  # of checked texts

import mujoco
import numpy as np

from selfmodel.errors import InputError, check_name, listed
from selfmodel.robot.actuators import ancestors, command_range, command_ranges
from selfmodel.robot.anatomy_reader import driven_joints
from selfmodel.robot.contacts import contacts_enabled, ground_contact_geoms
from selfmodel.robot.mjcf.settings import MIN_CONTROL_TIMESTEP, check_patterns, value_of
from selfmodel.robot.mjcf.work import UniqueNames, Work, format_numbers

_JOINT = int(mujoco.mjtTrn.mjTRN_JOINT)
_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)
_NO_BIAS, _AFFINE = int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE)

_INHERITING = ("position", "intvelocity")
"""Actuators that may have the range of their joint as command range."""

MIN_PERIOD = 10
"""Physics steps of the undamped oscillation of a servo, below which there is a note. Of 80 random
gaits of a hexapod with 18 servos, the best lost 41 % of its displacement at a quarter of the time
step with servos of 8 steps, 21 % with 17."""

_MAX_LISTED = 6
"""Joints that a note names."""

_SITE_MARGIN = 0.005
"""Distance by which a touch site extends beyond the geoms of its body, m."""


def _drives_hinge(model: mujoco.MjModel, motor: int, bias: int) -> bool:
    """Returns whether a motor acts on a hinge with a fixed gain and a bias of some type."""
    return (
        int(model.actuator_trntype[motor]) == _JOINT
        and int(model.jnt_type[model.actuator_trnid[motor, 0]]) == _HINGE
        and int(model.actuator_gaintype[motor]) == int(mujoco.mjtGain.mjGAIN_FIXED)
        and int(model.actuator_biastype[motor]) == bias
    )


def _hinges(model: mujoco.MjModel) -> list[str]:
    return [model.joint(int(joint)).name for joint in np.flatnonzero(model.jnt_type == _HINGE)]


def set_physics(work: Work) -> None:
    """Sets the time step, the contacts and the hinges to the values of the settings."""
    settings, hinges = work.settings, _hinges(work.model)
    world = work.section("worldbody")
    joints = [joint for joint in world.iter("joint") if joint.get("name") in hinges]
    for attribute, values in (
        ("armature", settings.armature),
        ("damping", settings.damping),
        ("frictionloss", settings.friction),
    ):
        check_patterns(values, hinges)
        for joint in joints:
            value = value_of(values, joint.get("name", ""))
            if value is not None:  # the rest of a damping grows with the speed
                rest = joint.get(attribute, "").split()[1:]
                joint.set(attribute, " ".join([repr(value), *rest]))
    if settings.timestep is not None:
        work.section("option").set("timestep", repr(settings.timestep))
    if settings.solref is not None:
        pairs = work.root.findall("contact/pair")
        for element in (*world.iter("geom"), *pairs):
            element.set("solref", format_numbers(np.array(settings.solref)))


def note_stiff_servos(work: Work) -> None:
    """Adds a note on the servos that are too stiff for the physics time step."""
    model = work.model
    timestep, periods, lacking = model.opt.timestep, dict[str, float](), 0.0
    for motor in range(model.nu):
        stiffness = -model.actuator_biasprm[motor, 1] * model.actuator_gear[motor, 0] ** 2
        if not (_drives_hinge(model, motor, _AFFINE) and stiffness > 0):
            continue
        joint = int(model.actuator_trnid[motor, 0])
        inertia = model.dof_M0[model.jnt_dofadr[joint]]
        period = 2 * np.pi * np.sqrt(inertia / stiffness) / timestep
        if period < MIN_PERIOD:
            periods[model.joint(joint).name] = period
            lacking = max(lacking, inertia * ((MIN_PERIOD / period) ** 2 - 1))
    if periods:
        least = min(periods.values())
        control = work.settings.control_timestep or MIN_CONTROL_TIMESTEP
        shorter = control / np.ceil(control / (timestep * least / MIN_PERIOD))
        work.notes.append(
            f"servos of {listed([*periods], _MAX_LISTED)} are stiff for a physics time step of "
            f"{timestep:g} s: they oscillate within {least:.1f} steps, and the motion may depend "
            f"on the step; set timestep to {shorter:.6g}, or armature, the inertia of the rotors "
            f"at their joints, to {1.05 * lacking:.2g} kg m² more"
        )


def add_servos(work: Work) -> None:
    """Makes a position servo of each torque motor that drives a hinge with gains in the settings.

    A torque motor has a torque proportional to its command. The torque of the servo is
    kp (command - angle) - kd (angular velocity), within the same limits. Its command range is the
    range of the hinge, or ``reach`` on both sides of the initial pose for a hinge without a range.
    """
    model, settings = work.model, work.settings
    check_patterns({**settings.kp, **settings.kd}, _hinges(model))
    converted = Counter[tuple[float, float]]()
    for motor, element in enumerate(work.children("actuator")):
        dynamic = int(model.actuator_dyntype[motor]) != int(mujoco.mjtDyn.mjDYN_NONE)
        if dynamic or not _drives_hinge(model, motor, _NO_BIAS):
            continue
        joint = int(model.actuator_trnid[motor, 0])
        name = model.joint(joint).name
        kp, kd = value_of(settings.kp, name), value_of(settings.kd, name)
        if kp is None and kd is None:
            continue
        if kp is None or kd is None:
            raise InputError(
                f"expected kp and kd for the joint {name}, got one of them: a position servo needs "
                f"both, such as kp = 40 and kd = 1"
            )
        travel = _travel(model, joint, value_of(settings.reach, name))
        element.tag = "general"
        element.attrib = {
            "name": element.get("name", ""),
            "joint": name,
            "gear": "1",
            "dyntype": "none",
            "gaintype": "fixed",
            "biastype": "affine",
            "gainprm": format_numbers(np.array((kp, 0.0, 0.0))),
            "biasprm": format_numbers(np.array((0.0, -kp, -kd))),
            "ctrllimited": "true",
            "ctrlrange": format_numbers(travel),
            **_torque_limits(model, motor),
        }
        converted[kp, kd] += 1
    if not converted:
        raise InputError(
            "expected a motor with a torque as its command for kp and kd, got none: the motors of "
            "these joints are servos already, or drive no hinge; remove kp and kd"
        )
    work.notes.extend(
        f"{count} torque motors are position servos with kp={kp:g} and kd={kd:g}, and the same "
        f"torque limits"
        for (kp, kd), count in converted.items()
    )


def _travel(model: mujoco.MjModel, joint: int, reach: float | None) -> np.ndarray:
    if model.jnt_limited[joint]:
        return np.array(model.jnt_range[joint])
    if reach is None:
        raise InputError(
            f"expected a range of the joint {model.joint(joint).name} for the commands of its "
            f'servo, got none: give the joint a range in the MJCF, such as range="-1 1", or set '
            f"reach=0.5, the largest distance of all commands from the initial pose, rad"
        )
    centre = model.qpos0[model.jnt_qposadr[joint]]
    return np.array([centre - reach, centre + reach])


def _torque_limits(model: mujoco.MjModel, motor: int) -> dict[str, str]:
    """Returns the limits of a servo as attributes: the torques of a motor at its joint, N m."""
    gain, gear = float(model.actuator_gainprm[motor, 0]), float(model.actuator_gear[motor, 0])
    limits = []
    if model.actuator_ctrllimited[motor]:
        limits.append(gain * model.actuator_ctrlrange[motor])
    if model.actuator_forcelimited[motor]:
        limits.append(np.array(model.actuator_forcerange[motor]))
    if not limits:
        return {"forcelimited": "false"}
    torques = np.sort(gear * np.array(limits), axis=1)
    ends = np.array([torques[:, 0].max(), torques[:, 1].min()])
    return {"forcelimited": "true", "forcerange": format_numbers(ends)}


def limit_reach(work: Work) -> None:
    """Limits the command range of each position servo of a hinge with a reach in the settings.

    The new range is the part of the old range within the reach of the angle of the hinge in the
    initial pose, or of the end of the old range that is closest to this angle.
    """
    model = work.model
    check_patterns(work.settings.reach, _hinges(model))
    limited = Counter[float]()
    for motor, element in enumerate(work.children("actuator")):
        joint = int(model.actuator_trnid[motor, 0])
        # Of a position servo, the command is the angle of the hinge, rad.
        stiffness = model.actuator_biasprm[motor, 1]
        measures_angle = model.actuator_gear[motor, 0] == 1.0
        is_servo = stiffness and stiffness == -model.actuator_gainprm[motor, 0]
        if not (_drives_hinge(model, motor, _AFFINE) and measures_angle and is_servo):
            continue
        reach = value_of(work.settings.reach, model.joint(joint).name)
        if reach is None:
            continue
        centre, half = command_ranges(model)[motor]
        low, high = centre - half, centre + half
        initial = min(max(float(model.qpos0[model.jnt_qposadr[joint]]), low), high)
        ends = np.array([max(initial - reach, low), min(initial + reach, high)])
        element.attrib.update(ctrlrange=format_numbers(ends), ctrllimited="true")
        if element.tag in _INHERITING:
            element.set("inheritrange", "0")  # MuJoCo refuses both ranges, also if one is a default
        limited[reach] += 1
    if not limited:
        raise InputError(
            "expected a position servo of a hinge for reach, got none: set kp=40 and kd=1 to "
            "make position servos of torque motors, or remove the setting reach"
        )
    work.notes.extend(
        f"the commands of {count} position servos are limited to {reach:g} rad from the initial "
        f"pose"
        for reach, count in limited.items()
    )


def add_command_ranges(work: Work) -> None:
    """Adds the ``ctrlrange`` of the settings to each motor without a command range."""
    model, ctrlrange = work.model, work.settings.ctrlrange
    if ctrlrange is not None:
        for motor, element in enumerate(work.children("actuator")):
            if command_range(model, motor) is None:
                ends = f"{ctrlrange[0]!r} {ctrlrange[1]!r}"
                element.attrib.update(ctrlrange=ends, ctrllimited="true")
    try:
        command_ranges(work.model)
    except InputError as error:
        raise InputError(
            f"{error}; or set ctrlrange=[-1, 1] for all motors without a command range"
        ) from error


def add_sensors(work: Work) -> None:
    """Adds the missing angle and touch sensors, and removes sensors that measure no driven limb."""
    model = work.model
    driven = [j for j in sorted(driven_joints(model)) if model.jnt_type[j] == _HINGE]
    hinges = [model.joint(j).name for j in driven]
    site_bodies = {model.site(s).name: int(model.site_bodyid[s]) for s in range(model.nsite)}
    moving = {name for name, body in site_bodies.items() if model.body_weldid[body]}
    for part in work.root.findall("sensor"):
        for sensor in list(part):
            if (sensor.tag == "jointpos" and sensor.get("joint") not in hinges) or (
                sensor.tag == "touch" and sensor.get("site") not in moving
            ):
                part.remove(sensor)
                work.notes.append(
                    f"the sensor {sensor.get('name')} is removed: it measures no driven limb"
                )
    given = work.children("sensor")
    measured = {sensor.get("joint") for sensor in given if sensor.tag == "jointpos"}
    joints = _chosen("joint with a motor", work.settings.angle, hinges, hinges, measured)
    felt = {site_bodies[str(sensor.get("site"))] for sensor in given if sensor.tag == "touch"}
    limbs = _limbs_to_feel(work, felt)
    sensors = work.section("sensor")
    names = UniqueNames(sensor.get("name") for sensor in given)
    for joint in joints:
        ET.SubElement(sensors, "jointpos", {"name": names.new(f"{joint}_angle"), "joint": joint})
    sites, bodies = UniqueNames(site_bodies), work.named_bodies()
    for limb in limbs:
        name = names.new(f"{limb}_touch")
        site = _touch_site(model, model.body(limb).id) | {"name": sites.new(name)}
        ET.SubElement(bodies[limb], "site", site)
        ET.SubElement(sensors, "touch", {"name": name, "site": site["name"]})
    if joints or limbs:
        work.notes.append(f"{len(joints)} angle sensors and {len(limbs)} touch sensors were added")


def _limbs_to_feel(work: Work, felt: Collection[int]) -> list[str]:
    """Returns the bodies that get a touch sensor, by default the end of each limb.

    ``felt`` are the ids of the bodies with one.
    """
    model = work.model
    if not contacts_enabled(model):
        return []
    touching = {int(model.geom_bodyid[geom]) for geom in ground_contact_geoms(model)}
    inner = {ancestor for body in touching for ancestor in ancestors(model, body)[1:]}
    driven = {int(model.jnt_bodyid[joint]) for joint in driven_joints(model)}
    limbs = [b for b in sorted(touching - inner) if driven.intersection(ancestors(model, b))]
    # Bodies that are welded together are one limb.
    felt_limbs = {int(model.body_weldid[body]) for body in felt}
    default = [model.body(b).name for b in limbs if model.body_weldid[b] not in felt_limbs]
    known = [model.body(b).name for b in sorted(touching)]
    has = {model.body(b).name for b in felt}
    kind = "body that can touch the ground"
    return _chosen(kind, work.settings.touch, default, known, has)


def _chosen(
    kind: str,
    wanted: Sequence[str] | None,
    default: list[str],
    known: list[str],
    has: Collection[str | None],
) -> list[str]:
    names = default if wanted is None else wanted
    for name in names:
        check_name(kind, name, known)
    return [name for name in names if name not in has]


def _touch_site(model: mujoco.MjModel, body: int) -> dict[str, str]:
    """Returns the attributes of a box site around the geoms of a body that can touch the ground."""
    corners = []
    for geom in ground_contact_geoms(model):
        if model.geom_bodyid[geom] != body:
            continue
        center, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
        for signs in product((-1, 1), repeat=3):
            corner = np.empty(3)
            within = center + np.array(signs) * (half + model.geom_margin[geom])
            mujoco.mju_rotVecQuat(corner, within, model.geom_quat[geom])
            corners.append(model.geom_pos[geom] + corner)
    lowest, highest = np.min(corners, axis=0), np.max(corners, axis=0)
    return {
        "type": "box",
        "pos": format_numbers((lowest + highest) / 2),
        "quat": "1 0 0 0",
        "size": format_numbers((highest - lowest) / 2 + _SITE_MARGIN),
        "rgba": "0 0 0 0",
        "group": "4",
    }
