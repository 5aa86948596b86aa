"""Adds a ground plane to an MJCF that has no ground."""

from xml.etree import ElementTree as ET  # of checked texts

import mujoco
import numpy as np

from selfmodel.errors import InputError
from selfmodel.robot.anatomy_reader import driven_joints, floating_bodies
from selfmodel.robot.contacts import contacts_enabled, ground_contact_geoms, joined_mask
from selfmodel.robot.mjcf.document.document import Document
from selfmodel.robot.mjcf.document.expand import format_numbers
from selfmodel.robot.mjcf.document.names import UniqueNames
from selfmodel.robot.mujoco_errors import compile_model

_MAX_DISTANCE = 1e6
"""Largest measured distance of a geom from the ground plane, m."""


def add_ground(document: Document, model: mujoco.MjModel) -> None:
    """Adds a plane under the lowest point of a robot that could touch no static geom.

    Models without contacts, models of swimmers and robots with a fixed base get no ground.

    Args:
        document: The MJCF, edited in place.
        model: The compiled document.

    Raises:
        InputError: No geom of the robot could touch a ground.
    """
    if not contacts_enabled(model) or ground_contact_geoms(model) or _swims(model):
        return
    if not floating_bodies(model, driven_joints(model)):
        return
    moving = model.body_weldid[model.geom_bodyid] != 0
    contype, conaffinity = (
        joined_mask(mask[moving]) for mask in (model.geom_contype, model.geom_conaffinity)
    )
    if not contype | conaffinity:
        raise InputError(
            "no geom of the robot can touch anything: give the geoms of its limbs a contype of 1, "
            "or <option> a density or viscosity if the robot swims or flies"
        )
    plane = {
        "name": UniqueNames(model.geom(g).name for g in range(model.ngeom)).new("ground"),
        "type": "plane",
        "size": "0 0 1",
        "contype": str(conaffinity or 1),
        "conaffinity": str(contype),
        "condim": "3",
        "friction": "1 0.005 0.0001",
        "pos": "0 0 0",
        "quat": "1 0 0 0",
    }
    element = ET.Element("geom", plane)
    document.section("worldbody").insert(0, element)
    grounded = compile_model(document.text, document.assets)
    data = mujoco.MjData(grounded)
    mujoco.mj_kinematics(grounded, data)
    height = lowest_point(grounded, data)
    element.set("pos", format_numbers(np.array([0.0, 0.0, height])))
    document.notes.append(f"a ground plane is added at a height of {height:.3g} m")


def _swims(model: mujoco.MjModel) -> bool:
    return bool(model.opt.density or model.opt.viscosity)


def lowest_point(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Returns the height of the lowest moving geom above geom 0, a plane at height 0, in m.

    Args:
        model: A model with geoms that can touch the plane.
        data: Positions of the geoms.
    """
    distances = (
        mujoco.mj_geomDistance(model, data, 0, geom, _MAX_DISTANCE, None)
        for geom in ground_contact_geoms(model)
    )
    return float(min(distances))
