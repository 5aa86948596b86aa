"""Inputs that are hard to judge: models that diverge, and trials with missing signals."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.estimation import JOINTS
from selfmodel.trials.signals import Signal
from selfmodel.trials.trial import Trial


def exploding(simulator: Simulator, text: str) -> Hypothesis:
    """Returns a hypothesis whose model in this simulator diverges: its joints amplify motion."""
    hypothesis = parse(text, simulator.robot.anatomy)
    built = simulator._embodiment(hypothesis)
    built.model.dof_damping[6:] = -1e3
    return hypothesis


def lacking(trial: Trial, signals: tuple[Signal, ...], steps: slice = slice(None)) -> Trial:
    """Returns the trial with signals that are NaN, not observed, at some steps."""
    run = trial.behaviour
    lost = {signal: run[signal].copy() for signal in signals}
    for values in lost.values():
        values[steps] = np.nan
    return replace(trial, behaviour=replace(run, signals={**run.signals, **lost}))


def without_encoders(trial: Trial, hinges: Sequence[int], steps: slice = slice(None)) -> Trial:
    """Returns the trial with joint signals of some hinges that are NaN at some steps."""
    run = trial.behaviour
    lost = {signal: run[signal].copy() for signal in JOINTS}
    for values in lost.values():
        values[steps, hinges] = np.nan
    return replace(trial, behaviour=replace(run, signals={**run.signals, **lost}))


def with_value(trial: Trial, signal: Signal, step: int, column: int, value: float) -> Trial:
    """Returns the trial with another number at one step in one column of a signal."""
    run = trial.behaviour
    values = run[signal].copy()
    values[step, column] = value
    return replace(trial, behaviour=replace(run, signals={**run.signals, signal: values}))


def unstable(robot: Robot) -> Robot:
    """Returns the robot in an impossible storm: every simulation diverges, whatever the fault."""
    mjcf = robot.mjcf.replace("<option ", '<option wind="0 0 1e9" density="1e9" ', 1)
    return replace(robot, mjcf=mjcf)
