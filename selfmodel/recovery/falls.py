"""Falls of a robot, from the pose of its base."""

import math

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.rotation import directions
from selfmodel.trials.trial import Trial

FALLEN_HEIGHT = 0.5
"""Height below which a base has fallen, as a fraction of its standing height. A base that starts on
the ground, as a swimmer's, cannot fall by this rule."""

FALLEN_TILT = np.radians(60)
"""Tilt above which a base has fallen, relative to its initial orientation, rad."""

FALLEN_TIME = 0.25
"""Time over which a fall is judged, s: a base that has fallen is low or tilted in more than half of
the measurements. A low stride or a wrong measurement is shorter."""


def falls_of(robot: Robot, hypothesis: Hypothesis, behaviour: Behaviour) -> IndexArray:
    """Returns the first step at which each run has fallen, or the number of steps without a fall.

    Args:
        robot: The healthy robot.
        hypothesis: Faults of the robot, of which a slope tilts the ground.
        behaviour: Position and orientation of the base, ``(..., steps, width)`` each.

    Returns:
        Step indices, ``(...)``.
    """
    return first_falls(behaviour, build(robot, hypothesis).normal, robot.standing_height)


def fall_of(robot: Robot, hypothesis: Hypothesis, trial: Trial) -> int | None:
    """Returns the step at which the robot fell in a trial; None if it did not, or cannot fall.

    A fixed base cannot fall, and a base that was not observed is not known to have fallen. A trial
    that ended early may have ended by a fall: its last pose counts as if it remained.

    Args:
        robot: The healthy robot.
        hypothesis: Faults of the physical robot.
        trial: The trial.
    """
    if robot.has_fixed_base:
        return None
    logged = trial.behaviour
    judged = held_at_the_end(logged) if logged.steps < trial.plan.steps else logged
    fall = int(falls_of(robot, hypothesis, judged))
    return fall if fall < logged.steps else None


def first_falls(behaviour: Behaviour, normals: FloatArray, standing_height: float) -> IndexArray:
    """Returns the first step at which the robot has fallen, or the number of steps without a fall.

    At that step the base is low or tilted, and so it is in more than half of the measurements of
    the next ``FALLEN_TIME``; if the run ends before, of its last ``FALLEN_TIME``; if the run is
    shorter than that, of the run.

    Args:
        behaviour: Position and orientation of the base, ``(..., steps, width)`` each; NaN where not
            observed.
        normals: Unit normals of the ground, ``(..., 3)``, broadcast to the shape of the runs. The
            ground passes through the origin.
        standing_height: Height of the base in the initial pose, m.

    Returns:
        Step indices, ``(...)``.
    """
    height = np.einsum("...sk,...k->...s", behaviour["base_position"], normals)
    upright = _cosines_of_tilt(directions(behaviour["base_orientation"])[..., 2:])
    low = (height < FALLEN_HEIGHT * standing_height) & (standing_height > 0)
    down = low | (upright < np.cos(FALLEN_TILT))
    up = ~down & (np.isfinite(height) | np.isfinite(upright))
    return first_lasting(down, up, steps_of(FALLEN_TIME, behaviour))


def held_at_the_end(behaviour: Behaviour) -> Behaviour:
    """Returns the signals of a run that ended early as if the last ones remained.

    A robot that is stopped as it falls has few measurements of the fall.

    Args:
        behaviour: One run, ``(steps, width)`` each.
    """
    more = steps_of(FALLEN_TIME, behaviour)
    step = behaviour.time[-1] - behaviour.time[-2] if behaviour.steps > 1 else FALLEN_TIME
    signals = {
        name: np.pad(values, ((0, more), (0, 0)), mode="edge")
        for name, values in behaviour.signals.items()
    }
    later = behaviour.time[-1] + step * np.arange(1, more + 1)
    return Behaviour(behaviour.names, np.concatenate([behaviour.time, later]), signals)


def first_lasting(state: BoolArray, other: BoolArray, steps: int) -> IndexArray:
    """Returns the first step of a state that lasts, or the number of steps without one, ``(...)``.

    Args:
        state: Steps of the state, ``(..., steps)``; it lasts if it is more frequent than the other
            in the window of the step.
        other: Steps of the other state; a step of neither is not known.
        steps: Length of a window, which begins at the step itself. The end of the run cuts no
            window: near it, the window is that of the last ``steps``, or the whole of a run that is
            shorter.
    """
    lasting = state & (_in_window(state, steps) > _in_window(other, steps))
    first: IndexArray = np.where(lasting.any(axis=-1), lasting.argmax(axis=-1), state.shape[-1])
    return first


def steps_of(duration: float, behaviour: Behaviour) -> int:
    """Returns the control steps in a time, s, at least 1."""
    return max(1, round(duration / _timestep(behaviour)))


def _cosines_of_tilt(upward: FloatArray) -> FloatArray:
    """Returns the cosine of the tilt from the first known orientation, ``(..., steps)``.

    Args:
        upward: The world's upward direction in the base frame, ``(..., steps, 3)``.
    """
    first = np.isfinite(upward).all(axis=-1).argmax(axis=-1)
    reference = np.take_along_axis(upward, first[..., np.newaxis, np.newaxis], axis=-2)
    return np.asarray((upward * reference).sum(axis=-1))


def _timestep(behaviour: Behaviour) -> float:
    """Returns the control time step, s; infinity for a single step."""
    return float(behaviour.time[1] - behaviour.time[0]) if behaviour.steps > 1 else math.inf


def _in_window(state: BoolArray, steps: int) -> IndexArray:
    """Returns the number of steps of a state in the window of each step.

    Args:
        state: ``(..., steps)``.
        steps: Length of a window; see ``first_lasting``.
    """
    total: IndexArray = np.cumsum(state, axis=-1)
    run = state.shape[-1]
    first = np.minimum(np.arange(run), max(run - steps, 0))
    last = np.minimum(first + steps, run) - 1
    return np.asarray(total[..., last] - total[..., first] + state[..., first])
