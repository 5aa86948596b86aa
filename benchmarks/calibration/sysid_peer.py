"""Calibration by ``mujoco.sysid``, with the same segments, parameters, bounds and scales.

``mujoco.sysid`` has no command delay, so each delay is tried around it, as in ``calibrate``. Its
solver, stopping rule and finite differences are its defaults; it has no prior, and large errors
count squared.
"""

import io
from collections.abc import Sequence
from functools import lru_cache
from importlib import import_module
from typing import Any

import mujoco
import numpy as np
from absl import logging

from selfmodel.arrays import FloatArray
from selfmodel.robot.anatomy import MAX_CONTROL_DELAY
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import signal_fields, state_writer
from selfmodel.simulation.model_factors import (
    MAX_LOG_FACTOR,
    Parameters,
    factor_names,
    from_factors,
    model_with_parameters,
)
from selfmodel.simulation.requests import LEAD
from selfmodel.simulation.segments import HORIZON, MAX_SEGMENTS
from selfmodel.trials.estimation import STATE, estimated_states
from selfmodel.trials.signals import CALIBRATION_ERROR_SCALES, Signal, difference
from selfmodel.trials.trial import Trial

Theirs = Any
"""Object or argument of mujoco.sysid, which has no types."""

# Imported by name: the package is marked as typed, and MuJoCo, which it uses, is not.
sysid: Theirs = import_module("mujoco.sysid")

States = dict[Signal, FloatArray]


def sysid_parameters(robot: Robot, trials: Sequence[Trial]) -> Parameters:
    """Returns the fit of ``mujoco.sysid`` to trials of the healthy robot, on one thread."""
    logging.set_verbosity(logging.ERROR)  # it warns of missing sensors, which are not compared
    names = factor_names(robot)
    parameters = sysid.ParameterDict(
        {name: sysid.Parameter(name, 0.0, -MAX_LOG_FACTOR, MAX_LOG_FACTOR) for name in names}
    )

    def residual_at(delay: int) -> Theirs:
        return sysid.build_residual_fn(
            models_sequences=[_sequences(robot, trials, delay)],
            build_model=_builder(robot),
            modify_residual=_Residual(robot),
            resample_true=False,
            n_threads=1,
        )

    def cost(delay: int) -> float:
        residuals, _, _ = residual_at(delay)(np.zeros(len(names)), parameters)
        return float(np.sum(np.square(np.concatenate(residuals))))

    delay = min(range(MAX_CONTROL_DELAY + 1), key=cost)
    progress = io.StringIO()  # it has no option to be silent
    found, _ = sysid.optimize(parameters, residual_at(delay), verbose=False, output=progress)
    return from_factors(np.exp(found.as_vector()), delay)


def _builder(robot: Robot) -> Theirs:
    """Builds models from logarithms; called once per segment with the same ones."""

    @lru_cache(64)
    def build(row: tuple[float, ...]) -> mujoco.MjModel:
        return model_with_parameters(robot, from_factors(np.exp(np.array(row)), 0))

    return lambda parameters, _spec: build(tuple(parameters.as_vector().tolist()))


def _sequences(robot: Robot, trials: Sequence[Trial], delay: int) -> Theirs:
    """Returns every segment as a sequence: from a logged state, under the delayed commands."""
    states, controls, observed = [], [], []
    for trial in trials:
        estimated = estimated_states(trial.trajectory)
        vectors = _vectors(robot, estimated)
        last = trial.trajectory.steps - 1 - HORIZON
        for k in np.unique(np.linspace(LEAD, last, MAX_SEGMENTS).round().astype(int)):
            commands = trial.trajectory["commands"][k - delay : k - delay + HORIZON]
            # A last row that sysid drops.
            rows = np.concatenate([np.repeat(commands, robot.substeps, axis=0), commands[-1:]])
            states.append(
                sysid.create_initial_state(
                    robot.model, vectors[k, : robot.model.nq], vectors[k, robot.model.nq :]
                )
            )
            times = np.arange(len(rows)) * float(robot.model.opt.timestep)
            controls.append(sysid.TimeSeries(times, rows))
            observed.append(
                sysid.TimeSeries(
                    np.arange(1, HORIZON + 1) * robot.control_timestep,
                    vectors[k + 1 : k + HORIZON + 1],
                )
            )
    return sysid.ModelSequences(
        robot.name,
        robot.specification(),
        [str(number) for number in range(len(states))],
        states,
        controls,
        observed,
        allow_missing_sensors=True,
    )


def _vectors(robot: Robot, states: Theirs) -> FloatArray:
    """Returns the state in MuJoCo's order, ``(steps, nq + nv)``."""
    model, steps = robot.model, len(states[STATE[0]])
    fields = {"qpos": np.zeros((steps, model.nq)), "qvel": np.zeros((steps, model.nv))}
    state_writer(robot, fields.__getitem__)(states)
    return np.concatenate([fields["qpos"], fields["qvel"]], axis=1)


class _Residual:
    """Returns the errors of a segment in units of ``CALIBRATION_ERROR_SCALES``."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._where = signal_fields(robot)

    def __call__(
        self,
        _parameters: Theirs,
        _predicted: Theirs,
        observed: Theirs,
        _model: mujoco.MjModel,
        _all: bool,  # noqa: FBT001  # sysid's protocol
        *,
        state: FloatArray,
        **_rest: object,
    ) -> tuple[FloatArray, Theirs, Theirs]:
        substeps = self._robot.substeps
        simulated = self._signals(state[substeps - 1 :: substeps, 1:])  # column 0 is the time
        seen = self._signals(observed.data)
        rows = []
        for signal, scale in CALIBRATION_ERROR_SCALES.items():
            rows.append((difference(signal, simulated[signal], seen[signal]) / scale).ravel())
        return np.concatenate(rows), observed, observed

    def _signals(self, rows: FloatArray) -> States:
        nq = self._robot.model.nq
        fields = {"qpos": rows[:, :nq], "qvel": rows[:, nq:]}
        return {
            signal: self._where[signal](fields.__getitem__)() for signal in CALIBRATION_ERROR_SCALES
        }
