"""Ground for a robot whose file has none."""

from xml.etree import ElementTree as ET  # of texts that were checked

import mujoco
import numpy as np

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.document import Document
from selfmodel.robot.mjcf.expand import numbers
from selfmodel.robot.mjcf.mujoco_errors import compiled
from selfmodel.robot.mjcf.names import Taken


def can_touch(model: mujoco.MjModel, geom: int, contype: int, conaffinity: int) -> bool:
    """Returns whether a geom can touch others with these two masks."""
    mine = int(model.geom_contype[geom]), int(model.geom_conaffinity[geom])
    return bool(mine[0] & conaffinity or mine[1] & contype)


def touches_anything(model: mujoco.MjModel) -> bool:
    """Returns whether contacts are simulated at all: a swimmer's may be switched off."""
    off = mujoco.mjtDisableBit
    return not model.opt.disableflags & (off.mjDSBL_CONTACT | off.mjDSBL_CONSTRAINT)


def world_masks(model: mujoco.MjModel) -> tuple[int, int]:
    """Returns the ``contype`` and ``conaffinity`` of all that stands still, joined."""
    still = model.body_weldid[model.geom_bodyid] == 0
    return _joined(model.geom_contype[still]), _joined(model.geom_conaffinity[still])


def meets_ground(model: mujoco.MjModel) -> list[int]:
    """Returns the moving geoms that can touch what stands still."""
    masks = world_masks(model)
    moves = model.body_weldid[model.geom_bodyid] != 0
    paired = {
        one
        for pair in pairs(model)
        for one, other in (pair, pair[::-1])
        if moves[one] and not moves[other]
    }
    moving = map(int, np.flatnonzero(moves))
    return [geom for geom in moving if geom in paired or can_touch(model, geom, *masks)]


def pairs(model: mujoco.MjModel) -> list[tuple[int, int]]:
    """Returns the geoms that can touch each other by a ``<pair>``, whatever their masks."""
    return list(zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True))


def add_ground(document: Document, model: mujoco.MjModel) -> None:
    """Adds a plane under the robot's lowest point, where nothing in its world can be touched.

    Raises:
        InputError: Nothing of the robot could touch a ground.
    """
    if not touches_anything(model) or meets_ground(model) or _swims(model):
        return
    moving = model.body_weldid[model.geom_bodyid] != 0
    contype, conaffinity = (
        _joined(mask[moving]) for mask in (model.geom_contype, model.geom_conaffinity)
    )
    if not contype | conaffinity:
        raise InputError(
            "no geom of the robot can touch anything: give those of its limbs a contype of 1, or "
            "its <option> a density or viscosity if it swims or flies"
        )
    plane = {
        "name": Taken(model.geom(g).name for g in range(model.ngeom)).new("ground"),
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
    height = _lowest(compiled(document.text, document.assets))
    element.set("pos", numbers(np.array([0.0, 0.0, height])))
    document.notes.append(f"it had no ground: there is a plane at a height of {height:.3g} m")


def _swims(model: mujoco.MjModel) -> bool:
    return bool(model.opt.density or model.opt.viscosity)


def _joined(masks: np.ndarray) -> int:
    return int(np.bitwise_or.reduce(masks, initial=0))


def _lowest(model: mujoco.MjModel) -> float:
    """Height of the lowest point of what can touch the first geom, a plane at height 0."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    far = 1e6
    distances = (
        mujoco.mj_geomDistance(model, data, 0, geom, far, None) for geom in meets_ground(model)
    )
    return float(min(distances))
