"""A detached limb that stays on the ground, where the robot meets it."""

import mujoco
import numpy as np


def leave(spec: mujoco.MjSpec, body: str) -> None:
    """Adds a free body with the geoms of a limb, where the limb is in the initial pose.

    Its bodies are rigidly connected, as those of a limb whose motors hold it.

    Args:
        spec: Specification of the robot, before the limb is deleted from it.
        body: Name of the limb's first body.
    """
    whole = spec.copy()
    model = whole.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    root = model.body(body).id
    debris = spec.worldbody.add_body(name="debris", pos=data.xpos[root], quat=data.xquat[root])
    debris.add_freejoint()
    for geom in whole.body(body).find_all(mujoco.mjtObj.mjOBJ_GEOM):
        _add(debris, model, data, geom.id, root)


def _add(
    debris: mujoco.MjsBody,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    geom: int,
    root: int,
) -> None:
    """Adds a copy of a geom with its share of its body's mass, in the frame of a body."""
    place, turned, orientation, inverse = np.empty(3), np.empty(4), np.empty(4), np.empty(4)
    mujoco.mju_negQuat(inverse, data.xquat[root])
    mujoco.mju_rotVecQuat(place, data.geom_xpos[geom] - data.xpos[root], inverse)
    mujoco.mju_mat2Quat(turned, data.geom_xmat[geom])
    mujoco.mju_mulQuat(orientation, inverse, turned)
    owner = int(model.geom_bodyid[geom])
    debris.add_geom(
        type=mujoco.mjtGeom(int(model.geom_type[geom])),
        size=model.geom_size[geom],
        pos=place,
        quat=orientation,
        mass=float(model.body_mass[owner] / model.body_geomnum[owner]),
        friction=model.geom_friction[geom],
        contype=int(model.geom_contype[geom]),
        conaffinity=int(model.geom_conaffinity[geom]),
    )
