"""How many hidden neurons a robot's network has, as its MJCF says."""

from dataclasses import replace
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import mujoco

from selfmodel.controller import HIDDEN_NEURONS
from selfmodel.errors import InputError

if TYPE_CHECKING:
    from selfmodel.robot import Robot

NEURONS = "selfmodel_hidden_neurons"
"""The custom numeric of an MJCF that says how many; without it, they are the paper's."""

MOST = 100
"""Hidden neurons that a network may have: a model may come from somebody's log."""


def hidden_neurons(model: mujoco.MjModel) -> int:
    """Returns how many hidden neurons a model says.

    Raises:
        ValueError: It is no whole number, or too large a one.
    """
    found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, NEURONS)
    said = float(model.numeric(found).data[0]) if found >= 0 else float(HIDDEN_NEURONS)
    if not (said.is_integer() and 1 <= said <= MOST):
        raise ValueError(f"{NEURONS} must be a whole number from 1 to {MOST}, got {said}")
    return int(said)


def with_neurons(robot: "Robot", neurons: int) -> "Robot":
    """Returns the robot with that many hidden neurons in its network.

    Its MJCF says so, and is otherwise the same to the digit, so that it moves the same to the bit.

    Raises:
        InputError: They are too many, or none.
    """
    if not 1 <= neurons <= MOST:
        raise InputError(f"a network has 1 to {MOST} hidden neurons, got {neurons}")
    if neurons == robot.anatomy.neurons:
        return robot
    root = ET.fromstring(robot.mjcf)  # noqa: S314  # a robot's own, which MuJoCo has read
    for custom in root.findall("custom"):
        for numeric in custom.findall("numeric"):
            if numeric.get("name") == NEURONS:
                custom.remove(numeric)
    ET.SubElement(ET.SubElement(root, "custom"), "numeric", name=NEURONS, data=str(neurons))
    return replace(robot, mjcf=ET.tostring(root, encoding="unicode"))
