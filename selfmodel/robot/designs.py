"""Controller designs for a robot, by name; ``controllers/controller.py`` says how to add one."""

from collections.abc import Callable, Mapping
from functools import partial

import mujoco
import numpy as np

from selfmodel.controllers.controller import Design
from selfmodel.controllers.cpg import Cpg
from selfmodel.controllers.network import HIDDEN_NEURONS, MAX_HIDDEN_NEURONS, Network
from selfmodel.errors import InputError, typed
from selfmodel.robot.actuators import command_ranges
from selfmodel.robot.robot import Robot
from selfmodel.rotation import directions


@typed
def network_for(robot: Robot, hidden: int | None = None, *, heading: bool = False) -> Network:
    """Returns the network that controls a robot, with the paper's number of neurons by default.

    Raises:
        InputError: The number of hidden neurons is out of range, a motor has no command range, or
            the robot cannot hold its heading.
    """
    neurons = HIDDEN_NEURONS if hidden is None else hidden
    if not 1 <= neurons <= MAX_HIDDEN_NEURONS:
        raise InputError(f"a network has 1 to {MAX_HIDDEN_NEURONS} hidden neurons, got {neurons}")
    names = _checked(robot, heading=heading).anatomy.names
    ranges = command_ranges(robot.model)
    return Network(names.sensors, names.motors, neurons, ranges=ranges, heading=heading)


@typed
def cpg_for(robot: Robot, hidden: int | None = None, *, heading: bool = False) -> Cpg:
    """Returns the CPG that controls a robot; it has no hidden neurons.

    Raises:
        InputError: A number of hidden neurons is given, a motor has no command range, or the robot
            cannot hold its heading.
    """
    if hidden is not None:
        raise InputError(
            f"a CPG has no hidden neurons, got --neurons {hidden}: leave --neurons out"
        )
    names = _checked(robot, heading=heading).anatomy.names
    ranges = command_ranges(robot.model)
    timestep = robot.control_timestep
    return Cpg(names.sensors, names.motors, timestep, ranges=ranges, heading=heading)


def _checked(robot: Robot, *, heading: bool) -> Robot:
    """Returns a robot that can hold its heading, if it is to."""
    model = robot.model
    joint = int(model.body(robot.root).jntadr[0])
    first = int(model.jnt_qposadr[joint]) + 3
    is_free = joint >= 0 and model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE
    ahead = directions(model.qpos0[first : first + 4])[:2] if is_free else np.zeros(2)
    if heading and not np.allclose(ahead, (1, 0), atol=0.01):
        raise InputError(
            f"expected a robot with a free base whose x axis points forward in its initial pose, "
            f"to hold its heading, got {robot.name}: leave +heading out"
        )
    return robot


DESIGNS: Mapping[str, Callable[[Robot, int | None], Design]] = {
    Network.name: network_for,
    Cpg.name: cpg_for,
    f"{Network.name}+heading": partial(network_for, heading=True),
    f"{Cpg.name}+heading": partial(cpg_for, heading=True),
}
"""Function from a robot and a number of hidden neurons (None: the default) to a design, by name."""
