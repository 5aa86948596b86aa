"""The recording of a Unitree Go2 on a stand: its model and its trials.

The recording and the model are in ``../shared/samples/go2-stand`` (see its README). The model has
motors of torque, and the robot's controller is a position servo, so the motors become servos with
the gains of that README.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from selfmodel.robot.mjcf.load import adapt_text
from selfmodel.robot.mjcf.settings import checked_settings
from selfmodel.robot.robot import Robot
from selfmodel.trials.trial import Trial

SAMPLE = Path(__file__).parents[3] / "shared" / "samples" / "go2-stand"
RATE = 200
"""Control steps per second."""

FITTED, ALL = 10 * RATE, 15 * RATE
"""Steps that the model is fitted to, and all steps."""

SERVOS = {"kp": 20.0, "kd": 1.5}
"""Gains of the robot's own controller by the repository, N m/rad and N m s/rad."""

_PHYSICS_TIMESTEP = 0.0025
"""Physics time step, s: a control step of the recording is a multiple of it."""


def robot_on_stand(servos: Mapping[str, float] = SERVOS) -> Robot:
    """Returns the robot of the recording, with its base fixed and with position servos."""
    text = (SAMPLE / "go2.xml").read_text(encoding="utf-8")
    text = text.replace("<option ", f'<option timestep="{_PHYSICS_TIMESTEP}" ', 1)
    settings = checked_settings({"base": "fixed", "control_timestep": 1 / RATE, **servos})
    return adapt_text("go2-stand", text, {}, settings)


def trial_of(robot: Robot, first: int, last: int) -> Trial:
    """Returns steps of the recording as a trial; it has joint positions and commands only."""
    with np.load(SAMPLE / "go2-stand.npz", allow_pickle=False) as data:
        order = [data["joint_names"].tolist().index(name) for name in robot.anatomy.hinges]
        arrays = (data[name][first:last, order] for name in ("position", "command"))
        return Trial.from_arrays(robot, *arrays, name=f"go2-{first}-{last}")
