"""The sensors that the controller needs: the angle of each driven hinge, touch of each limb."""

from collections.abc import Sequence
from xml.etree import ElementTree as ET  # of texts that were checked

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import unknown_name
from selfmodel.robot.anatomy_reader import driven_joints
from selfmodel.robot.mjcf.document import Document
from selfmodel.robot.mjcf.expand import numbers
from selfmodel.robot.mjcf.ground import meets_ground, touches_anything
from selfmodel.robot.mjcf.names import Taken
from selfmodel.robot.mjcf.settings import MjcfSettings

_HINGE = mujoco.mjtJoint.mjJNT_HINGE
_MARGIN = 0.005
"""How far a site reaches beyond the geoms whose contacts it feels, m."""


def add_sensors(document: Document, model: mujoco.MjModel, settings: MjcfSettings) -> None:
    """Adds the sensors that are missing, and takes out those that a controller could not use.

    Raises:
        InputError: The settings name a joint or body that there is not.
    """
    _drop_useless(document, model)
    sensors = document.section("sensor")
    taken = Taken(sensor.get("name") for sensor in document.children("sensor"))
    felt = _angles(document, model, settings)
    for joint in felt:
        found = {"name": taken.new(f"{joint}_angle"), "joint": joint}
        ET.SubElement(sensors, "jointpos", found)
    limbs = _limbs(document, model, settings)
    sites = Taken(model.site(s).name for s in range(model.nsite))
    bodies = {body.get("name"): body for body in document.bodies()}
    for limb in limbs:
        name = taken.new(f"{limb}_touch")
        site = _site(model, model.body(limb).id) | {"name": sites.new(name)}
        ET.SubElement(bodies[limb], "site", site)
        ET.SubElement(sensors, "touch", {"name": name, "site": site["name"]})
    if felt or limbs:
        document.notes.append(
            f"{len(felt)} angle sensors and {len(limbs)} touch sensors were added"
        )


def _driven_hinges(model: mujoco.MjModel) -> list[int]:
    return [j for j in sorted(driven_joints(model)) if model.jnt_type[j] == _HINGE]


def _drop_useless(document: Document, model: mujoco.MjModel) -> None:
    """Takes out sensors of what no motor drives, and of what is no hinge."""
    hinges = {model.joint(j).name for j in _driven_hinges(model)}
    moving = {model.site(s).name for s in range(model.nsite) if _moves(model, s)}
    for part in document.root.findall("sensor"):
        for sensor in list(part):
            useless = (sensor.tag == "jointpos" and sensor.get("joint") not in hinges) or (
                sensor.tag == "touch" and sensor.get("site") not in moving
            )
            if useless:
                part.remove(sensor)
                document.notes.append(f"the sensor {sensor.get('name')} is of no use, and left out")


def _moves(model: mujoco.MjModel, site: int) -> bool:
    return bool(model.body_weldid[model.site_bodyid[site]])


def _angles(document: Document, model: mujoco.MjModel, settings: MjcfSettings) -> list[str]:
    hinges = [model.joint(j).name for j in _driven_hinges(model)]
    measured = {s.get("joint") for s in document.children("sensor") if s.tag == "jointpos"}
    return _chosen("joint with a motor", settings.angle, hinges, hinges, measured)


def _limbs(document: Document, model: mujoco.MjModel, settings: MjcfSettings) -> list[str]:
    """The last body of each limb that can meet the ground, by name."""
    if not touches_anything(model):
        return []
    meeting = {int(model.geom_bodyid[geom]) for geom in meets_ground(model)}
    inner = {ancestor for body in meeting for ancestor in _ancestors(model, body)[1:]}
    driven = {int(model.jnt_bodyid[joint]) for joint in driven_joints(model)}
    limbs = [b for b in sorted(meeting - inner) if driven & set(_ancestors(model, b))]
    sites = {model.site(s).name: int(model.site_bodyid[s]) for s in range(model.nsite)}
    touching = [sites[str(s.get("site"))] for s in document.children("sensor") if s.tag == "touch"]
    # What is rigidly joined is one limb.
    felt = {int(model.body_weldid[body]) for body in touching}
    names = [model.body(b).name for b in limbs if model.body_weldid[b] not in felt]
    every = [model.body(b).name for b in sorted(meeting)]
    has = {model.body(b).name for b in touching}
    return _chosen("body that can meet the ground", settings.touch, names, every, has)


def _chosen(
    what: str,
    wanted: Sequence[str] | None,
    default: list[str],
    known: list[str],
    has: set[str | None] | set[str],
) -> list[str]:
    names = default if wanted is None else list(wanted)
    for name in names:
        if name not in known:
            raise unknown_name(what, name, known)
    return [name for name in names if name not in has]


def _ancestors(model: mujoco.MjModel, body: int) -> list[int]:
    """The body and all that carry it, up to the world without it."""
    found = []
    while body:
        found.append(body)
        body = int(model.body_parentid[body])
    return found


def _site(model: mujoco.MjModel, body: int) -> dict[str, str]:
    """A box around the geoms of a body that can touch something."""
    corners = [
        corner
        for geom in meets_ground(model)
        if model.geom_bodyid[geom] == body
        for corner in _corners(model, geom)
    ]
    lowest, highest = np.min(corners, axis=0), np.max(corners, axis=0)
    return {
        "type": "box",
        "pos": numbers((lowest + highest) / 2),
        "quat": "1 0 0 0",
        "size": numbers((highest - lowest) / 2 + _MARGIN),
        "rgba": "0 0 0 0",
        "group": "4",
    }


def _corners(model: mujoco.MjModel, geom: int) -> list[FloatArray]:
    """The corners of the box around a geom, with its margin, in the frame of its body."""
    center, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
    corners = []
    for signs in np.ndindex(2, 2, 2):
        within = center + (2 * np.array(signs) - 1) * (half + model.geom_margin[geom])
        corner = np.empty(3)
        mujoco.mju_rotVecQuat(corner, within, model.geom_quat[geom])
        corners.append(model.geom_pos[geom] + corner)
    return corners
