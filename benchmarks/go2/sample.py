"""The recording of a Unitree Go2 on a stand: its model, its trials, and faults put into it.

The recording and the model are in ``../shared/samples/go2-stand`` (see its README). The model has
motors of torque, and the robot's controller is a position servo, so the motors become servos with
the gains of that README.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.playback import played_back
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.robot.anatomy import split_delay
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.mjcf.settings import checked_settings
from selfmodel.robot.robot import Robot
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial, TrialPlan

SAMPLE = Path(__file__).parents[3] / "shared" / "samples" / "go2-stand"
RATE = 200
"""Control steps per second."""

_SETTINGS = {"base": "fixed", "kp": 20, "kd": 1.5, "control_timestep": 1 / RATE}
_PHYSICS_TIMESTEP = 0.0025
"""Physics time step, s: a control step of the recording is a multiple of it."""


def robot_on_stand(sample: Path = SAMPLE) -> Robot:
    """Returns the robot of the recording, with its base fixed and with position servos."""
    text = (sample / "go2.xml").read_text(encoding="utf-8")
    text = text.replace("<option ", f'<option timestep="{_PHYSICS_TIMESTEP}" ', 1)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "go2-stand.xml"
        path.write_text(text, encoding="utf-8")
        return load_mjcf(path, checked_settings(_SETTINGS))


def positions_and_commands(robot: Robot, sample: Path = SAMPLE) -> tuple[FloatArray, FloatArray]:
    """Returns measured joint positions and commands, rad, ``(steps, hinges)`` each."""
    with np.load(sample / "go2-stand.npz", allow_pickle=False) as data:
        order = [data["joint_names"].tolist().index(name) for name in robot.anatomy.hinges]
        found = [data[name].astype(np.float64)[:, order] for name in ("position", "command")]
    return found[0], found[1]


def trial_of(
    robot: Robot, positions: FloatArray, commands: FloatArray, first: int = 0, last: int = 3000
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


def simulated(
    robot: Robot,
    positions: FloatArray,
    commands: FloatArray,
    hypothesis: Hypothesis = INTACT,
) -> FloatArray:
    """Returns the simulated joint positions of the whole recording, ``(steps, hinges)``.

    The simulation begins at the first measured positions, at rest, and continues to the end.
    """
    model = build(robot, hypothesis).model
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


def with_fault(
    trial: Trial, robot: Robot, positions: FloatArray, commands: FloatArray, fault: Hypothesis
) -> Trial:
    """Returns the trial of the whole recording as if the robot had a fault.

    Simulated positions with the fault minus those without, both by the given model, are added to
    the measured positions: what the model does not explain remains in the trial.
    """
    change = simulated(robot, positions, commands, fault) - simulated(robot, positions, commands)
    trajectory = trial.trajectory
    signals = {**trajectory.signals, "joint_positions": positions + change}
    return replace(
        trial, trajectory=replace(trajectory, signals=signals), path=f"{trial.path} with {fault}"
    )
