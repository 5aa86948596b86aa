"""Adds the sensors of a controller: an angle per driven hinge, touch per limb."""

from collections.abc import Sequence
from xml.etree import ElementTree as ET  # of checked texts

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import unknown_name
from selfmodel.robot.anatomy_reader import driven_joints
from selfmodel.robot.contacts import contacts_enabled, ground_contact_geoms
from selfmodel.robot.mjcf.document import Document, format_numbers
from selfmodel.robot.mjcf.names import UniqueNames
from selfmodel.robot.mjcf.settings import MjcfSettings

_HINGE = mujoco.mjtJoint.mjJNT_HINGE
_SITE_MARGIN = 0.005
"""Distance by which a touch site extends beyond the geoms of its body, m."""


def add_sensors(document: Document, settings: MjcfSettings) -> None:
    """Adds the missing angle and touch sensors, and removes sensors that measure no driven limb.

    Args:
        document: The MJCF, edited in place.
        settings: Settings with the joints and bodies that get sensors.

    Raises:
        InputError: The settings name a joint or body that the model does not have.
    """
    model = document.model
    _remove_unused(document, model)
    sensors = document.section("sensor")
    names = UniqueNames(sensor.get("name") for sensor in document.children("sensor"))
    joints = _joints_to_measure(document, model, settings)
    for joint in joints:
        ET.SubElement(sensors, "jointpos", {"name": names.new(f"{joint}_angle"), "joint": joint})
    limbs = _limbs_to_measure(document, model, settings)
    sites = UniqueNames(model.site(s).name for s in range(model.nsite))
    bodies = document.named_bodies()
    for limb in limbs:
        name = names.new(f"{limb}_touch")
        site = _touch_site(model, model.body(limb).id) | {"name": sites.new(name)}
        ET.SubElement(bodies[limb], "site", site)
        ET.SubElement(sensors, "touch", {"name": name, "site": site["name"]})
    if joints or limbs:
        document.notes.append(
            f"{len(joints)} angle sensors and {len(limbs)} touch sensors were added"
        )


def _driven_hinges(model: mujoco.MjModel) -> list[int]:
    return [j for j in sorted(driven_joints(model)) if model.jnt_type[j] == _HINGE]


def _remove_unused(document: Document, model: mujoco.MjModel) -> None:
    """Removes angle sensors except of driven hinges, and touch sensors of static sites."""
    hinges = {model.joint(j).name for j in _driven_hinges(model)}
    moving = {model.site(s).name for s in range(model.nsite) if _moves(model, s)}
    for part in document.root.findall("sensor"):
        for sensor in list(part):
            unused = (sensor.tag == "jointpos" and sensor.get("joint") not in hinges) or (
                sensor.tag == "touch" and sensor.get("site") not in moving
            )
            if unused:
                part.remove(sensor)
                document.notes.append(
                    f"the sensor {sensor.get('name')} is removed: it measures no driven limb"
                )


def _moves(model: mujoco.MjModel, site: int) -> bool:
    return bool(model.body_weldid[model.site_bodyid[site]])


def _joints_to_measure(
    document: Document, model: mujoco.MjModel, settings: MjcfSettings
) -> list[str]:
    """Returns the names of the joints that get an angle sensor."""
    hinges = [model.joint(j).name for j in _driven_hinges(model)]
    measured = {s.get("joint") for s in document.children("sensor") if s.tag == "jointpos"}
    return _chosen("joint with a motor", settings.angle, hinges, hinges, measured)


def _limbs_to_measure(
    document: Document, model: mujoco.MjModel, settings: MjcfSettings
) -> list[str]:
    """Returns the names of the bodies that get a touch sensor, by default the end of each limb."""
    if not contacts_enabled(model):
        return []
    touching = {int(model.geom_bodyid[geom]) for geom in ground_contact_geoms(model)}
    inner = {ancestor for body in touching for ancestor in _ancestors(model, body)[1:]}
    driven = {int(model.jnt_bodyid[joint]) for joint in driven_joints(model)}
    limbs = [b for b in sorted(touching - inner) if driven & set(_ancestors(model, b))]
    sites = {model.site(s).name: int(model.site_bodyid[s]) for s in range(model.nsite)}
    measured = [sites[str(s.get("site"))] for s in document.children("sensor") if s.tag == "touch"]
    # Bodies that are welded together are one limb.
    measured_limbs = {int(model.body_weldid[body]) for body in measured}
    default = [model.body(b).name for b in limbs if model.body_weldid[b] not in measured_limbs]
    known = [model.body(b).name for b in sorted(touching)]
    has = {model.body(b).name for b in measured}
    return _chosen("body that can touch the ground", settings.touch, default, known, has)


def _chosen(
    kind: str,
    wanted: Sequence[str] | None,
    default: list[str],
    known: list[str],
    has: set[str | None] | set[str],
) -> list[str]:
    """Returns the wanted names, or the default names, except names of parts with a sensor.

    Args:
        kind: Kind of the parts in an error message.
        wanted: Names in the settings; None for the default.
        default: Names of the parts without settings.
        known: Names that the settings may have.
        has: Names of the parts that have a sensor.
    """
    names = default if wanted is None else list(wanted)
    for name in names:
        if name not in known:
            raise unknown_name(kind, name, known)
    return [name for name in names if name not in has]


def _ancestors(model: mujoco.MjModel, body: int) -> list[int]:
    """Returns a body and its ancestors, without the world."""
    ancestors = []
    while body:
        ancestors.append(body)
        body = int(model.body_parentid[body])
    return ancestors


def _touch_site(model: mujoco.MjModel, body: int) -> dict[str, str]:
    """Returns the attributes of a box site around the geoms of a body that can touch the ground."""
    corners = [
        corner
        for geom in ground_contact_geoms(model)
        if model.geom_bodyid[geom] == body
        for corner in _corners(model, geom)
    ]
    lowest, highest = np.min(corners, axis=0), np.max(corners, axis=0)
    return {
        "type": "box",
        "pos": format_numbers((lowest + highest) / 2),
        "quat": "1 0 0 0",
        "size": format_numbers((highest - lowest) / 2 + _SITE_MARGIN),
        "rgba": "0 0 0 0",
        "group": "4",
    }


def _corners(model: mujoco.MjModel, geom: int) -> list[FloatArray]:
    """Returns the corners of a geom's bounding box plus its margin, ``(3,)`` m, body frame."""
    center, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
    corners = []
    for signs in np.ndindex(2, 2, 2):
        within = center + (2 * np.array(signs) - 1) * (half + model.geom_margin[geom])
        corner = np.empty(3)
        mujoco.mju_rotVecQuat(corner, within, model.geom_quat[geom])
        corners.append(model.geom_pos[geom] + corner)
    return corners
