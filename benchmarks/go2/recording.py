"""The recording of a Unitree Go2 on a stand: its model, its trials, and what predicts it.

The recording and the model are in ``../shared/samples/go2-stand`` (see its README). The model has
motors of torque, and the robot's controller is a position servo, so the motors become servos with
the gains of that README.
"""

import copy
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.comparators.segment_prediction import SegmentPrediction
from selfmodel.controllers.playback import played_back
from selfmodel.diagnosis.losses import LossTable
from selfmodel.diagnosis.significance import is_better
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.joints import WEAK_MOTOR
from selfmodel.faults.kind import Fault
from selfmodel.robot.anatomy import split_delay
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.mjcf.settings import checked_settings
from selfmodel.robot.robot import Robot
from selfmodel.simulation.model_factors import with_model
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial, TrialPlan

SAMPLE = Path(__file__).parents[3] / "shared" / "samples" / "go2-stand"
RATE = 200
"""Control steps per second."""

FITTED, ALL = 10 * RATE, 15 * RATE
"""Steps that the model is fitted to, and all steps."""

_SETTINGS = {"base": "fixed", "control_timestep": 1 / RATE}
SERVOS = {"kp": 20.0, "kd": 1.5}
"""Gains of the robot's own controller by the repository, N m/rad and N m s/rad."""

_PHYSICS_TIMESTEP = 0.0025
"""Physics time step, s: a control step of the recording is a multiple of it."""


def robot_on_stand(sample: Path = SAMPLE, servos: Mapping[str, float] = SERVOS) -> Robot:
    """Returns the robot of the recording, with its base fixed and with position servos."""
    text = (sample / "go2.xml").read_text(encoding="utf-8")
    text = text.replace("<option ", f'<option timestep="{_PHYSICS_TIMESTEP}" ', 1)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "go2-stand.xml"
        path.write_text(text, encoding="utf-8")
        return load_mjcf(path, checked_settings({**_SETTINGS, **servos}))


def positions_and_commands(robot: Robot, sample: Path = SAMPLE) -> tuple[FloatArray, FloatArray]:
    """Returns measured joint positions and commands, rad, ``(steps, hinges)`` each."""
    with np.load(sample / "go2-stand.npz", allow_pickle=False) as data:
        order = [data["joint_names"].tolist().index(name) for name in robot.anatomy.hinges]
        found = [data[name].astype(np.float64)[:, order] for name in ("position", "command")]
    return found[0], found[1]


def trial_of(
    robot: Robot, positions: FloatArray, commands: FloatArray, first: int = 0, last: int = ALL
) -> Trial:
    """Returns a part of the recording as a trial; it has joint positions and commands only."""
    names, steps = robot.anatomy.names, last - first
    signals = {signal: np.full((steps, names.width(signal)), np.nan) for signal in SIGNALS}
    signals["joint_positions"] = positions[first:last]
    signals["commands"] = commands[first:last]
    time = np.arange(steps) / RATE
    controller = played_back(robot.anatomy.motors, commands[first:last])
    return Trial(
        TrialPlan("go2", "single", controller, steps, 0),
        robot.name,
        Trajectory(names, time, signals),
        f"go2-{first}-{last}",
    )


def simulated(robot: Robot, positions: FloatArray, commands: FloatArray) -> FloatArray:
    """Returns the simulated joint positions of the whole recording, ``(steps, hinges)``.

    The simulation begins at the first measured positions, at rest, and continues to the end.
    """
    model = robot.model
    data = mujoco.MjData(model)
    hinges = [int(model.joint(name).qposadr[0]) for name in robot.anatomy.hinges]
    data.qpos[hinges] = positions[0]
    whole, part = split_delay(robot.control_delay, robot.substeps)
    found = [positions[0]]
    for step in range(len(commands) - 1):
        data.ctrl[:] = commands[max(step - whole - 1, 0)]
        mujoco.mj_step(model, data, part) if part else None
        data.ctrl[:] = commands[max(step - whole, 0)]
        mujoco.mj_step(model, data, robot.substeps - part)
        found.append(data.qpos[hinges].copy())
    return np.array(found)


def robot_of(robot: Robot, fit: dict[str, Any]) -> Robot:
    """Returns the robot with the parameters and the delay of a fit."""
    model = copy.copy(robot.model)
    fields = {"damping": "dof_damping", "dry friction": "dof_frictionloss"}
    fields["armature"] = "dof_armature"
    for row in fit["parameters"]:
        if row["quantity"] == "gain":
            motor = model.actuator(row["name"]).id
            model.actuator_gainprm[motor] *= row["value"]
            model.actuator_biasprm[motor] *= row["value"]
        else:
            dof = model.joint(row["name"]).dofadr[0]
            getattr(model, fields[row["quantity"]])[dof] = row["value"]
    return with_model(robot, model, fit["delay"])


def better_hypotheses(robot: Robot, threads: int) -> dict[str, Any]:
    """Returns the weak-motor hypotheses that predict the healthy robot better than ``INTACT``."""
    evidence = LossTable(Simulator(robot, threads), SegmentPrediction("segment-prediction"))
    trial = trial_of(robot, *positions_and_commands(robot), FITTED, ALL)
    hypotheses = [
        Hypothesis((Fault(WEAK_MOTOR, joint.name, torque),))
        for joint in robot.anatomy.joints
        for torque in (0.95, 0.9, 0.7, 0.5, 0.0)
    ]
    intact, *rows = evidence.losses([INTACT, *hypotheses], [trial])
    return {
        "hypotheses": len(hypotheses),
        "smaller loss": sum(bool(row.mean() < intact.mean()) for row in rows),
        "significantly better": sum(is_better(row, intact) for row in rows),
    }
