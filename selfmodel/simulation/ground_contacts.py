"""Ground contact points, reconstructed from touch sensors and forward kinematics."""

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import bind_data, state_writer, with_known_base
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.estimation import STATE, estimated_states, known_steps
from selfmodel.trials.rotation import directions

MAX_GROUND_DISTANCE = 10.0
"""Largest distance between a foot and the model's level ground, m."""


def ground_contact_points(robot: Robot, behaviour: Behaviour) -> FloatArray:
    """Returns the ground contact points of the bodies with touch sensors in a trial.

    A contact point is the lowest point of a body, at each step with a touch reading of 1. Wrong
    touch readings result in points in the air. A body beyond an unknown hinge has no contact point.

    Args:
        robot: The healthy robot.
        behaviour: The logged behaviour of the trial.

    Returns:
        ``(n, 3)``, world frame, m, read-only; ``(0, 3)`` for a model without level ground.
    """
    model = robot.model
    ground, feet = _level_ground(model), _feet(robot)
    if ground is None or not feet:
        return np.empty((0, 3))
    states = estimated_states(with_known_base(robot, behaviour), STATE)
    unknown = np.isnan(states["joint_positions"])
    chains = {column: _chain(robot, column) for column in feet}
    data = mujoco.MjData(model)
    write = state_writer(robot, bind_data(data))
    points: list[FloatArray] = []
    for step in np.flatnonzero(
        known_steps(states) & (behaviour["sensors"][:, list(feet)] == 1).any(axis=1)
    ):
        write({signal: values[[step]] for signal, values in states.items()})
        mujoco.mj_kinematics(model, data)
        for column, geoms in feet.items():
            if behaviour["sensors"][step, column] == 1 and not unknown[step, chains[column]].any():
                points += _lowest_point(model, data, ground, geoms)
    contacts = np.array(points).reshape(-1, 3)
    contacts.flags.writeable = False  # the simulator caches the array
    return contacts


def _level_ground(model: mujoco.MjModel) -> int | None:
    """Returns the most level plane of the world, or None without a plane."""
    planes = (model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE) & (model.geom_bodyid == 0)
    numbers = np.flatnonzero(planes)
    if not len(numbers):
        return None
    upward = directions(model.geom_quat[numbers])[:, -1]
    return int(numbers[np.argmax(upward)])


def _feet(robot: Robot) -> dict[int, list[int]]:
    """Returns the colliding geoms of each touch sensor's body, by the column of the sensor."""
    model = robot.model
    solid = (model.geom_contype | model.geom_conaffinity) != 0
    feet = {}
    for column, sensor in enumerate(robot.anatomy.sensors):
        if sensor.kind == "touch":
            site = int(model.sensor(sensor.name).objid[0])
            geoms = np.flatnonzero(solid & (model.geom_bodyid == model.site_bodyid[site]))
            feet[column] = geoms.tolist()
    return {column: geoms for column, geoms in feet.items() if geoms}


def _chain(robot: Robot, column: int) -> list[int]:
    """Returns the columns of the hinges between the root body and the body of a touch sensor."""
    model, hinges = robot.model, robot.anatomy.hinges
    site = int(model.sensor(robot.anatomy.sensors[column].name).objid[0])
    body, bodies = int(model.site_bodyid[site]), set[int]()
    while body:
        bodies.add(body)
        body = int(model.body_parentid[body])
    return [k for k, name in enumerate(hinges) if int(model.joint(name).bodyid[0]) in bodies]


def _lowest_point(
    model: mujoco.MjModel, data: mujoco.MjData, ground: int, geoms: list[int]
) -> list[FloatArray]:
    """Returns the point of some geoms nearest to the level ground; empty if all are too far."""
    nearest, segment = MAX_GROUND_DISTANCE, np.empty(6)
    lowest: list[FloatArray] = []
    for geom in geoms:
        distance = mujoco.mj_geomDistance(model, data, ground, geom, MAX_GROUND_DISTANCE, segment)
        if distance < nearest:
            nearest, lowest = distance, [segment[3:].copy()]
    return lowest
