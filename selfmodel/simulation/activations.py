"""Actuator activations (MuJoCo's ``act``), computed from the commands.

Activations are not logged. The activation of a motor with the ``dyntype`` filter follows its
command with a time constant, and the activation of an integrator is the sum of its commands. Both
are zero at the start of a trial, so they follow from the commands since.
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
    model = robot.model
    motors: IndexArray = np.flatnonzero(model.actuator_dyntype != mujoco.mjtDyn.mjDYN_NONE)
    activations = np.zeros((len(segments.commands), model.na))
    if not len(motors):
        return activations
    dynamics = _ActivationDynamics(robot, motors)
    if segments.past is None:
        effective = segments.commands[:, : max(segments.lead - delay, 0), motors]
        state = dynamics.settled(segments.commands[:, 0, motors])
        for k in range(effective.shape[1]):
            state = dynamics.next(state, effective[:, k])
        activations[:, model.actuator_actadr[motors]] = state
        return activations
    commands, starts = segments.past.commands[:, motors], segments.past.starts
    # An unknown command is assumed to be the last known command before it; 0 at first.
    last_known = np.maximum.accumulate(
        np.where(np.isfinite(commands), np.arange(len(commands))[:, np.newaxis] + 1, 0)
    )
    from_rest = np.concatenate([np.zeros((1, len(motors))), commands])
    filled = np.take_along_axis(from_rest, last_known, axis=0)
    states = np.zeros((int(starts.max(initial=0)) + 1, len(motors)))
    for k in range(len(states) - 1):
        command = filled[k - delay] if k >= delay else np.zeros(len(motors))
        states[k + 1] = dynamics.next(states[k], command)
    activations[:, model.actuator_actadr[motors]] = states[starts]
    return activations


def activations_since_rest(robot: Robot, commands: FloatArray) -> FloatArray:
    """Returns the activations of a run with known commands since its start.

    Args:
        robot: The healthy robot.
        commands: Commands at the motors, after the control delay, ``(steps, motors)``.

    Returns:
        Activations before the command of each row, ``(steps, na)``.
    """
    model = robot.model
    motors: IndexArray = np.flatnonzero(model.actuator_dyntype != mujoco.mjtDyn.mjDYN_NONE)
    activations = np.zeros((len(commands), model.na))
    if not len(motors):
        return activations
    dynamics, state = _ActivationDynamics(robot, motors), np.zeros(len(motors))
    # The last command has no row after it.
    for row, command in zip(activations[1:], commands[:, motors], strict=False):
        state = dynamics.next(state, command)
        row[model.actuator_actadr[motors]] = state
    return activations


class _ActivationDynamics:
    """Activation dynamics over one control step.

    A command is constant during a control step, so the update is linear and each activation changes
    monotonically: clamping at the end of the step equals clamping at each physics step.

    Source: MuJoCo's documentation, "Activation dynamics"; ``mj_nextActivation``.

    Args:
        robot: The healthy robot.
        motors: Indices of the motors with activations, ``(motors,)``.
    """

    def __init__(self, robot: Robot, motors: IndexArray) -> None:
        model = robot.model
        timestep, kind = float(model.opt.timestep), model.actuator_dyntype[motors]
        ratio = timestep / np.maximum(model.actuator_dynprm[motors, 0], mujoco.mjMINVAL)
        runge_kutta = model.opt.integrator == _RUNGE_KUTTA
        correction = 1 - ratio / 2 + ratio**2 / 6 - ratio**3 / 24 if runge_kutta else 1.0
        substep_gain = np.where(kind == _FILTER, ratio, -np.expm1(-ratio)) * correction
        decay = (1 - substep_gain) ** robot.substeps
        integrates = kind == _INTEGRATOR
        self._integrates = integrates
        self._decay = np.where(integrates, 1.0, decay)
        self._gain = np.where(integrates, timestep * robot.substeps, 1 - decay)
        limited = model.actuator_ctrllimited[motors].astype(bool)
        clamps = limited & (not model.opt.disableflags & _UNCLAMPED)
        self._command_bounds = _bounds(clamps, model.actuator_ctrlrange[motors])
        limited = model.actuator_actlimited[motors].astype(bool)
        self._activation_bounds = _bounds(limited, model.actuator_actrange[motors])

    def next(self, state: FloatArray, command: FloatArray) -> FloatArray:
        """Returns the activations after a control step, ``(..., motors)``.

        Args:
            state: Activations before the step, ``(..., motors)``.
            command: Commands of the step, ``(..., motors)``.
        """
        clamped = np.clip(command, *self._command_bounds)
        after = self._decay * state + self._gain * clamped
        return np.asarray(np.clip(after, *self._activation_bounds))

    def settled(self, command: FloatArray) -> FloatArray:
        """Returns the steady state under a constant command; 0 for an integrator."""
        clamped = np.clip(command, *self._command_bounds)
        steady = np.where(self._integrates, 0.0, clamped)
        return np.asarray(np.clip(steady, *self._activation_bounds))


def _bounds(limited: BoolArray, ranges: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Returns the lower and the upper bound of each motor, infinite if not limited."""
    unbounded = np.array([[-np.inf, np.inf]])
    low, high = np.where(limited[:, np.newaxis], ranges, unbounded).T
    return low, high
