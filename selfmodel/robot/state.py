"""Reads and writes the signals of a trajectory in MuJoCo's state of a robot."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray, columns
from selfmodel.robot.base import Bind, DerivedSignal, ShiftedField, StateField, read_base
from selfmodel.robot.embodiment import Embodiment
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.estimation import with_joint_velocities
from selfmodel.trials.signals import Signal
from selfmodel.trials.trial import Trial

ObservedSignal = StateField | ShiftedField | DerivedSignal
"""A signal as a robot logs it."""

StateWriter = Callable[[Mapping[Signal, FloatArray]], None]
"""Writes signals, ``(n, width)`` each, into the state; absent signals, and joints whose value is
NaN, keep their values."""


def signal_fields(
    robot: Robot, *models: mujoco.MjModel
) -> dict[Signal, StateField | DerivedSignal]:
    """Returns the state field of each signal that the physics determines.

    Commands are ``ctrl``. Sensor readings are not included: ``SensorReader`` computes them.

    Args:
        robot: The robot, whose parts name the columns of the signals.
        models: Models of the states: no model for the robot's own, one for all states, or one per
            state, of one layout. A model has all parts of the robot, and may have more.
    """
    models = models or (robot.model,)
    model = models[0]
    motors = columns([int(model.actuator(name).id) for name in robot.anatomy.motors])
    return {
        "commands": StateField("ctrl", motors),
        **_joint_fields(robot, model),
        **read_base(models, robot.root).signal_fields(),
    }


def observed_fields(
    robot: Robot, embodiments: Sequence[Embodiment]
) -> dict[Signal, ObservedSignal]:
    """Returns ``signal_fields`` as robots log them: joint positions with the encoders' offsets.

    Args:
        robot: The healthy robot.
        embodiments: An embodiment for all states, or one per state.
    """
    fields: dict[Signal, ObservedSignal] = {
        **signal_fields(robot, *(embodiment.model for embodiment in embodiments))
    }
    offsets = np.array([embodiment.encoder_offset for embodiment in embodiments])
    if offsets.any():
        joints = _joint_fields(robot, embodiments[0].model)["joint_positions"]
        fields["joint_positions"] = ShiftedField(joints, offsets)
    return fields


def state_writer(robot: Robot, bind: Bind, *models: mujoco.MjModel) -> StateWriter:
    """Returns a function that writes the joint and base signals into a state.

    Args:
        robot: The robot, whose parts name the columns of the signals.
        bind: Returns the fields of the state, which are written.
        models: Models of the states, as for ``signal_fields``.
    """
    models = models or (robot.model,)
    qpos, qvel = bind("qpos"), bind("qvel")
    arrays = {"qpos": qpos, "qvel": qvel}
    base, joints = read_base(models, robot.root), _joint_fields(robot, models[0])

    def write(state: Mapping[Signal, FloatArray]) -> None:
        for signal in ("joint_positions", "joint_velocities"):
            if signal in state:
                field, own = arrays[joints[signal].field], joints[signal].columns
                unknown = np.isnan(state[signal])
                field[:, own] = (
                    np.where(unknown, field[:, own], state[signal])
                    if unknown.any()
                    else state[signal]
                )
        base.write(qpos, qvel, state)

    return write


def bind_data(data: mujoco.MjData) -> Bind:
    """Returns a function from the name of a field of MjData to the field as ``(1, width)``."""

    def bind(field: str) -> FloatArray:
        values: FloatArray = getattr(data, field)
        return values[np.newaxis]

    return bind


def current_value(field: ObservedSignal, data: mujoco.MjData) -> FloatArray:
    """Returns a copy of the current value of a signal of a single robot, ``(width,)``."""
    return np.array(field.reader(bind_data(data))()[0])


def _joint_fields(robot: Robot, model: mujoco.MjModel) -> dict[Signal, StateField]:
    hinges = [model.joint(name) for name in robot.anatomy.hinges]
    positions = columns([int(hinge.qposadr[0]) for hinge in hinges])
    velocities = columns([int(hinge.dofadr[0]) for hinge in hinges])
    return {
        "joint_positions": StateField("qpos", positions),
        "joint_velocities": StateField("qvel", velocities),
        "joint_efforts": StateField("qfrc_actuator", velocities),
    }


BASE_SIGNALS: tuple[Signal, ...] = (
    "base_position",
    "base_orientation",
    "base_linear_velocity",
    "base_angular_velocity",
)
"""Signals of the base."""


def with_known_base(robot: Robot, behaviour: Behaviour) -> Behaviour:
    """Returns a behaviour with its robot's physics steps, and a known base if the base is fixed.

    Values that were observed are unchanged.

    Args:
        robot: The robot of the behaviour.
        behaviour: Behaviour of one run.
    """
    if behaviour.substeps != robot.substeps:
        behaviour = dataclasses.replace(behaviour, substeps=robot.substeps)
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

    The base is known, and joint velocities that were not logged are estimated.

    Args:
        robot: The robot of the trial.
        trial: A trial.
    """
    behaviour = with_known_base(robot, trial.behaviour)
    if robot.has_fixed_base:
        behaviour = with_joint_velocities(behaviour)
    return dataclasses.replace(trial, behaviour=behaviour)


def trial_with_known_base(robot: Robot, trial: Trial) -> Trial:
    """Returns a trial with a known base; see ``with_known_base``."""
    return dataclasses.replace(trial, behaviour=with_known_base(robot, trial.behaviour))
