"""Root body of a robot: the floating body, or the static body that carries the driven joints."""

import mujoco
import numpy as np

_FREE, _SLIDE, _HINGE = (
    int(mujoco.mjtJoint.mjJNT_FREE),
    int(mujoco.mjtJoint.mjJNT_SLIDE),
    int(mujoco.mjtJoint.mjJNT_HINGE),
)


def joints_of_body(model: mujoco.MjModel, body: int) -> list[int]:
    """Returns the ids of the joints between a body and its parent."""
    first = int(model.body_jntadr[body])
    return list(range(first, first + int(model.body_jntnum[body])))


def find_root_body(model: mujoco.MjModel, driven: frozenset[int]) -> int:
    """Returns the id of the root body of a robot.

    The root body is the body with a free joint or with slide joints. Without such a body the base
    is fixed, and the root body is the static body that carries all driven joints: of several, the
    one nearest to the joints.

    Args:
        model: A compiled MJCF.
        driven: Ids of the joints that motors move.

    Raises:
        ValueError: The model has several floating bases; or none, and slide joints on a body of the
            world, or no static body below the world that carries all driven joints.
    """
    floating = floating_bodies(model, driven)
    if len(floating) > 1:
        names = ", ".join(model.body(body).name or f"number {body}" for body in floating)
        raise ValueError(
            f"expected one root body that moves freely, got {names}: keep the robot, and remove "
            f"the other bodies or fix them to the world"
        )
    if floating:
        return floating[0]
    if not driven:
        raise ValueError("the motors drive no joint: give the joints of the limbs motors")
    _check_hinged(model)
    carrier = common_carrier(model, driven)
    if not carrier:
        raise ValueError(
            "the driven joints are on several bodies of the world, or directly on one, and the "
            "base is fixed: put them into one <body>, which is the root body"
        )
    return carrier


def floating_bodies(model: mujoco.MjModel, driven: frozenset[int]) -> list[int]:
    """Returns the ids of the bodies that can be a floating base.

    Args:
        model: A compiled MJCF.
        driven: Ids of the joints that motors move.
    """
    free = [int(model.jnt_bodyid[j]) for j in np.flatnonzero(model.jnt_type == _FREE)]
    return free or [
        body
        for body in np.flatnonzero(model.body_parentid == 0).tolist()
        if body and _is_sliding_base(model, body, driven)
    ]


def common_carrier(model: mujoco.MjModel, joints: frozenset[int]) -> int:
    """Returns the id of the static body nearest to some joints that carries all of them.

    Args:
        model: A compiled MJCF.
        joints: Ids of at least one joint.

    Returns:
        The id of the body; 0, the world, if no other static body carries all the joints.
    """
    chains = [_static_chain(model, int(model.jnt_bodyid[joint])) for joint in joints]
    return max(set(chains[0]).intersection(*chains[1:]))


def _static_chain(model: mujoco.MjModel, body: int) -> list[int]:
    """Returns the ids of the static bodies that carry a body, with the world."""
    chain = []
    while body:
        body = int(model.body_parentid[body])
        if not model.body_weldid[body]:
            chain.append(body)
    return chain


def _check_hinged(model: mujoco.MjModel) -> None:
    """Refuses bodies of a world that have a slide or ball joint and are no floating base."""
    for joint in range(model.njnt):
        parent = int(model.body_parentid[model.jnt_bodyid[joint]])
        if model.jnt_type[joint] != _HINGE and not model.body_weldid[parent]:
            raise ValueError(
                f"the model needs a root body with a free joint, with slide joints and then at "
                f"most one hinge that no motor moves, or without a joint (its base is fixed), and "
                f"the body {model.body(model.jnt_bodyid[joint]).name or 'without a name'} has "
                f"other joints: give the root body a <freejoint/>, or only hinges to its parent"
            )


def _is_sliding_base(model: mujoco.MjModel, body: int, driven: frozenset[int]) -> bool:
    joints = joints_of_body(model, body)
    kinds = [int(model.jnt_type[j]) for j in joints]
    slides = kinds.count(_SLIDE)
    if not slides or kinds not in ([_SLIDE] * slides, [_SLIDE] * slides + [_HINGE]):
        return False
    independent = np.linalg.matrix_rank(model.jnt_axis[joints[:slides]]) == slides
    return bool(independent) and not driven.intersection(joints)
