"""Signals of a fixed base where a trial has none: those of the model."""

import dataclasses

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot.robot import Robot
from selfmodel.robot.state.access import current_value, signal_fields
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.estimation.velocity_estimation import with_joint_velocities
from selfmodel.trials.signals import Signal
from selfmodel.trials.trial import Trial

BASE_SIGNALS: tuple[Signal, ...] = (
    "base_position",
    "base_orientation",
    "base_linear_velocity",
    "base_angular_velocity",
)
"""Signals of the base."""


def with_known_base(robot: Robot, behaviour: Behaviour) -> Behaviour:
    """Returns a behaviour whose base is known at every step if the base is fixed.

    Values that were observed are unchanged, and so is the behaviour of a robot with another base.

    Args:
        robot: The robot of the behaviour.
        behaviour: Behaviour of one run.
    """
    if not robot.has_fixed_base:
        return behaviour
    fields, data = signal_fields(robot), mujoco.MjData(robot.model)
    known = dict[Signal, FloatArray]()
    for signal in BASE_SIGNALS:
        constant = current_value(fields[signal], data)
        observed = behaviour.signals.get(signal, np.full((behaviour.steps, len(constant)), np.nan))
        known[signal] = np.where(np.isnan(observed), constant, observed)
    return dataclasses.replace(behaviour, signals={**behaviour.signals, **known})


def completed_trial(robot: Robot, trial: Trial) -> Trial:
    """Returns a trial whose state is complete if the base is fixed, as far as it was logged.

    The base is known, and joint velocities that were not logged are estimated. Trials of robots
    with another base are returned unchanged.

    Args:
        robot: The robot of the trial.
        trial: A trial.
    """
    if not robot.has_fixed_base:
        return trial
    behaviour = with_joint_velocities(with_known_base(robot, trial.behaviour))
    return dataclasses.replace(trial, behaviour=behaviour)


def trial_with_known_base(robot: Robot, trial: Trial) -> Trial:
    """Returns a trial with a known base; see ``with_known_base``."""
    return dataclasses.replace(trial, behaviour=with_known_base(robot, trial.behaviour))
