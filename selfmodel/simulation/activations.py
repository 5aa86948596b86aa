"""Actuator activations (MuJoCo's ``act``), computed from the commands.

Activations are not logged. The activation of a motor with the ``dyntype`` filter follows its
command with a time constant, and the activation of an integrator is the sum of its commands. Both
are zero at the start of a trial, so they follow from the commands since.
"""

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.robot.robot import Robot
from selfmodel.simulation.requests import Segments

_SAME_OPTIONS = ("timestep", "integrator", "disableflags", "disableactuator")
_SAME_MOTORS = ("dynprm", "ctrllimited", "ctrlrange", "actlimited", "actrange", "group")


def initial_activations(robot: Robot, segments: Segments, delay: int) -> FloatArray:
    """Returns the activations at the beginning of segments of a trial.

    Activations are zero when a trial begins. If the commands since then are not part of the
    segments, activations are assumed to be settled at the first known command.

    Args:
        robot: The healthy robot: no fault changes the activation dynamics.
        segments: Initial states and commands.
        delay: Control delay, control steps.

    Returns:
        ``(segments, na)``; ``(segments, 0)`` for a robot without activations.
    """
    if not robot.model.na:
        return np.zeros((len(segments.commands), 0))
    dynamics = _ActivationDynamics(robot)
    if segments.past is None:
        known = segments.commands[:, : max(segments.lead - delay, 0)]
        return np.array(
            [
                dynamics.run(dynamics.settled(own[0]), before)[-1]
                for own, before in zip(segments.commands, known, strict=True)
            ]
        )
    commands, starts = segments.past.commands, segments.past.starts
    # An unknown command is assumed to be the last known command before it; 0 at first.
    last_known = np.maximum.accumulate(
        np.where(np.isfinite(commands), np.arange(len(commands))[:, np.newaxis] + 1, 0)
    )
    from_rest = np.concatenate([np.zeros((1, commands.shape[1])), commands])
    filled = np.take_along_axis(from_rest, last_known, axis=0)
    arrived = np.concatenate([np.zeros((delay, commands.shape[1])), filled])
    end = int(starts.max(initial=0))
    return dynamics.run(np.zeros(robot.model.na), arrived[:end])[starts]


def activations_since_rest(robot: Robot, commands: FloatArray) -> FloatArray:
    """Returns the activations of a run with known commands since its start.

    Args:
        robot: The healthy robot.
        commands: Commands at the motors, after the control delay, ``(steps, motors)``.

    Returns:
        Activations before the command of each row, ``(steps, na)``.
    """
    if not robot.model.na:
        return np.zeros((len(commands), 0))
    # The last command has no row after it.
    return _ActivationDynamics(robot).run(np.zeros(robot.model.na), commands[:-1])


class _ActivationDynamics:
    """Activation dynamics of a robot, on a model that has only its motors.

    MuJoCo computes the activations, so that they are those of the robot's own model to the bit:
    where a solver switches its active constraints, a rounding error has visible effects.

    Args:
        robot: The healthy robot, with activations.
    """

    def __init__(self, robot: Robot) -> None:
        own = robot.model
        self._substeps = robot.substeps
        self._model = model = _motors_only(own)
        for name in _SAME_OPTIONS:
            setattr(model.opt, name, getattr(own.opt, name))
        for name in _SAME_MOTORS:
            getattr(model, f"actuator_{name}")[:] = getattr(own, f"actuator_{name}")
        kinds = own.actuator_dyntype
        self._motors: IndexArray = np.flatnonzero(kinds != mujoco.mjtDyn.mjDYN_NONE)
        self._integrates = kinds[self._motors] == mujoco.mjtDyn.mjDYN_INTEGRATOR
        self._clamps = not own.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL
        self._data = mujoco.MjData(model)

    def run(self, state: FloatArray, commands: FloatArray) -> FloatArray:
        """Returns the activations before each control step and after the last.

        Args:
            state: Activations before the first step, ``(na,)``.
            commands: Commands of the steps, ``(steps, motors)``.

        Returns:
            ``(steps + 1, na)``.
        """
        model, data = self._model, self._data
        states = np.empty((len(commands) + 1, model.na))
        data.act[:] = states[0] = state
        for after, command in zip(states[1:], commands, strict=True):
            data.ctrl[:] = command
            mujoco.mj_step(model, data, self._substeps)
            after[:] = data.act
        return states

    def settled(self, command: FloatArray) -> FloatArray:
        """Returns the steady state under a constant command, ``(na,)``; 0 for an integrator."""
        model, motors = self._model, self._motors
        known = command[motors]
        clamps = model.actuator_ctrllimited[motors].astype(bool) & self._clamps
        clamped = np.where(clamps, _clipped(known, model.actuator_ctrlrange[motors]), known)
        steady = np.where(self._integrates, 0.0, clamped)
        limited = model.actuator_actlimited[motors].astype(bool)
        return np.where(limited, _clipped(steady, model.actuator_actrange[motors]), steady)


def _clipped(values: FloatArray, ranges: FloatArray) -> FloatArray:
    return np.clip(values, ranges[:, 0], ranges[:, 1])


def _motors_only(model: mujoco.MjModel) -> mujoco.MjModel:
    """Returns a model with as many motors, of the same dynamics, that move nothing."""
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(mass=1.0, inertia=[1.0, 1.0, 1.0])
    body.add_joint(name="joint")
    for kind in model.actuator_dyntype:
        spec.add_actuator(
            dyntype=mujoco.mjtDyn(int(kind)),
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            target="joint",
            gainprm=np.zeros(10),
        )
    return spec.compile()
