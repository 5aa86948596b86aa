"""Where feet met the ground: felt by touch, and known by the joints and the base above it."""

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot.robot import Robot
from selfmodel.robot.state_access import bind_data, state_writer
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.rotation import directions
from selfmodel.trials.state_estimation import STATE, estimated_states

FAR = 10.0
"""How far a foot may be from where the model has its level ground, m."""


def felt_points(robot: Robot, behaviour: Behaviour) -> FloatArray:
    """Returns where something with a touch sensor met the ground.

    It is the place of a body that is lowest, at each step at which the sensor of that body said
    that it touches. A sensor that errs gives points in the air.

    Args:
        robot: The robot with nothing wrong.
        behaviour: What was observed in a trial.

    Returns:
        ``(n, 3)`` in the world's frame, m, read only; none where the model has no level ground.
    """
    model = robot.model
    ground, feet = _level_ground(model), _feet(robot)
    if ground is None or not feet:
        return np.empty((0, 3))
    states = estimated_states(behaviour, STATE)
    known = np.logical_and.reduce([np.isfinite(values).all(axis=1) for values in states.values()])
    data = mujoco.MjData(model)
    write = state_writer(robot, bind_data(data))
    points: list[FloatArray] = []
    for step in np.flatnonzero(known & (behaviour["sensors"][:, list(feet)] == 1).any(axis=1)):
        write({signal: values[[step]] for signal, values in states.items()})
        mujoco.mj_kinematics(model, data)
        for column, geoms in feet.items():
            if behaviour["sensors"][step, column] == 1:
                points += _lowest(model, data, ground, geoms)
    felt = np.array(points).reshape(-1, 3)
    felt.flags.writeable = False  # it is remembered
    return felt


def _level_ground(model: mujoco.MjModel) -> int | None:
    """The plane of the world that lies most level, if there is one."""
    planes = (model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE) & (model.geom_bodyid == 0)
    numbers = np.flatnonzero(planes)
    if not len(numbers):
        return None
    upward = directions(model.geom_quat[numbers])[:, -1]
    return int(numbers[np.argmax(upward)])


def _feet(robot: Robot) -> dict[int, list[int]]:
    """For the column of each touch sensor the geoms of its body that can touch something."""
    model = robot.model
    solid = (model.geom_contype | model.geom_conaffinity) != 0
    feet = {}
    for column, sensor in enumerate(robot.anatomy.sensors):
        if sensor.kind == "touch":
            site = int(model.sensor(sensor.name).objid[0])
            geoms = np.flatnonzero(solid & (model.geom_bodyid == model.site_bodyid[site]))
            feet[column] = geoms.tolist()
    return {column: geoms for column, geoms in feet.items() if geoms}


def _lowest(
    model: mujoco.MjModel, data: mujoco.MjData, ground: int, geoms: list[int]
) -> list[FloatArray]:
    """The point of some geoms that is nearest to the level ground; none where all are far."""
    nearest, between = FAR, np.empty(6)
    lowest: list[FloatArray] = []
    for geom in geoms:
        distance = mujoco.mj_geomDistance(model, data, ground, geom, FAR, between)
        if distance < nearest:
            nearest, lowest = distance, [between[3:].copy()]
    return lowest
