"""The state of motors that remember their commands, computed from the commands.

No log holds it: a motor with ``dyntype`` filter follows its command with a time constant, one with
integrator adds its commands up. From rest on, their state follows from what they were commanded.
"""

import mujoco
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.robot.robot import Robot
from selfmodel.simulation.requests import Segments

_INTEGRATOR = int(mujoco.mjtDyn.mjDYN_INTEGRATOR)
_FILTER = int(mujoco.mjtDyn.mjDYN_FILTER)
_RUNGE_KUTTA = int(mujoco.mjtIntegrator.mjINT_RK4)
_UNCLAMPED = int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)


def starting_activations(robot: Robot, segments: Segments, delay: int) -> FloatArray:
    """Returns the activations with which segments of a trial begin.

    The motors are at rest when a trial begins. Where the segments do not say what was commanded
    since, they are taken to have followed the first of the commands that are known for long.

    Args:
        robot: The robot with nothing wrong: no fault changes how an activation follows a command.
        segments: Where to begin, and what was commanded.
        delay: Control steps from a command to its effect.

    Returns:
        ``(segments, na)``; of a robot whose motors remember nothing, ``(segments, 0)``.
    """
    model = robot.model
    motors: IndexArray = np.flatnonzero(model.actuator_dyntype != mujoco.mjtDyn.mjDYN_NONE)
    found = np.zeros((len(segments.commands), model.na))
    if not len(motors):
        return found
    follow = _Follower(robot, motors)
    if segments.past is None:
        effective = segments.commands[:, : max(segments.lead - delay, 0), motors]
        state = follow.settled(segments.commands[:, 0, motors])
        for k in range(effective.shape[1]):
            state = follow.after(state, effective[:, k])
        found[:, model.actuator_actadr[motors]] = state
        return found
    commands, starts = segments.past.commands[:, motors], segments.past.starts
    # What is not known is taken to have stood since the last command that is.
    known = np.maximum.accumulate(
        np.where(np.isfinite(commands), np.arange(len(commands))[:, np.newaxis] + 1, 0)
    )
    rested = np.concatenate([np.zeros((1, len(motors))), commands])
    held = np.take_along_axis(rested, known, axis=0)
    states = np.zeros((int(starts.max(initial=0)) + 1, len(motors)))
    for k in range(len(states) - 1):
        command = held[k - delay] if k >= delay else np.zeros(len(motors))
        states[k + 1] = follow.after(states[k], command)
    found[:, model.actuator_actadr[motors]] = states[starts]
    return found


def activations_of(robot: Robot, commands: FloatArray) -> FloatArray:
    """Returns the activations in a run that shows all commands since rest.

    Args:
        robot: The robot with nothing wrong.
        commands: As the motors got them, ``(steps, motors)``.

    Returns:
        ``(steps, na)``, in each row those with which its command was given.
    """
    model = robot.model
    motors: IndexArray = np.flatnonzero(model.actuator_dyntype != mujoco.mjtDyn.mjDYN_NONE)
    found = np.zeros((len(commands), model.na))
    if not len(motors):
        return found
    follow, state = _Follower(robot, motors), np.zeros(len(motors))
    for row, command in zip(found[1:], commands[:, motors], strict=False):  # the last has no row
        state = follow.after(state, command)
        row[model.actuator_actadr[motors]] = state
    return found


class _Follower:
    """How the activations of some motors change over a control step.

    A command stands for all of it, so the change is linear, and what an activation is clamped to
    at the end it would be clamped to on the way: it moves to one side only.

    Source: MuJoCo's documentation, "Activation dynamics"; ``mj_nextActivation``.
    """

    def __init__(self, robot: Robot, motors: IndexArray) -> None:
        model = robot.model
        timestep, kind = float(model.opt.timestep), model.actuator_dyntype[motors]
        part = timestep / np.maximum(model.actuator_dynprm[motors, 0], mujoco.mjMINVAL)
        runge_kutta = model.opt.integrator == _RUNGE_KUTTA
        slope = 1 - part / 2 + part**2 / 6 - part**3 / 24 if runge_kutta else 1.0
        followed = np.where(kind == _FILTER, part, -np.expm1(-part)) * slope
        kept = (1 - followed) ** robot.substeps
        adds = kind == _INTEGRATOR
        self._adds = adds
        self._kept = np.where(adds, 1.0, kept)
        self._gain = np.where(adds, timestep * robot.substeps, 1 - kept)
        limited = model.actuator_ctrllimited[motors].astype(bool)
        clamps = limited & (not model.opt.disableflags & _UNCLAMPED)
        self._commands = _bounds(clamps, model.actuator_ctrlrange[motors])
        limited = model.actuator_actlimited[motors].astype(bool)
        self._states = _bounds(limited, model.actuator_actrange[motors])

    def after(self, state: FloatArray, command: FloatArray) -> FloatArray:
        """The activations after a control step, ``(..., motors)`` like state and command."""
        clamped = np.clip(command, *self._commands)
        return np.asarray(np.clip(self._kept * state + self._gain * clamped, *self._states))

    def settled(self, command: FloatArray) -> FloatArray:
        """The activations once a command has stood for long; 0 where it would add up for ever."""
        clamped = np.clip(command, *self._commands)
        return np.asarray(np.clip(np.where(self._adds, 0.0, clamped), *self._states))


def _bounds(limited: BoolArray, ranges: FloatArray) -> tuple[FloatArray, FloatArray]:
    none = np.array([[-np.inf, np.inf]])
    low, high = np.where(limited[:, np.newaxis], ranges, none).T
    return low, high
