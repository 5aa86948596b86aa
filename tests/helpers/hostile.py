"""Inputs that are hard to judge: models that diverge, and trials with missing signals."""

from collections.abc import Iterable, Sequence
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
    built = simulator._variant(hypothesis)
    built.model.dof_damping[6:] = -1e3
    return hypothesis


def lacking(trial: Trial, signals: Iterable[Signal], steps: slice = slice(None)) -> Trial:
    """Returns the trial with signals that are NaN, not observed, at some steps."""
    for signal in signals:
        trial = with_value(trial, signal, steps, slice(None), np.nan)
    return trial


def without_encoders(trial: Trial, hinges: Sequence[int], steps: slice = slice(None)) -> Trial:
    """Returns the trial with joint signals of some hinges that are NaN at some steps."""
    for signal in JOINTS:
        trial = with_value(trial, signal, steps, hinges, np.nan)
    return trial


def with_value(trial: Trial, signal: Signal, step: object, column: object, value: float) -> Trial:
    """Returns the trial with another number at some steps in some columns of a signal."""
    values = trial.trajectory[signal].copy()
    values[step, column] = value
    return replace(trial, trajectory=trial.trajectory.with_signals({signal: values}))


def unstable(robot: Robot) -> Robot:
    """Returns the robot in an impossible storm: every simulation diverges, whatever the fault."""
    mjcf = robot.mjcf.replace("<option ", '<option wind="0 0 1e9" density="1e9" ', 1)
    return replace(robot, mjcf=mjcf)
