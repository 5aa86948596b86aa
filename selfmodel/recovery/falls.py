"""Falls of a robot: the first step at which its base lies or is turned over, and stays so."""

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.robot.robot import Robot
from selfmodel.rotation import directions
from selfmodel.simulation.simulator import UNTIL_EVERY, Until
from selfmodel.trials.signals import Signal
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial

FALLEN_HEIGHT = 0.5
"""Height below which a base has fallen, as a fraction of its standing height. A base that starts on
the ground, as a swimmer's, cannot fall by this rule."""

FALLEN_TILT = np.radians(60)
"""Tilt above which a base has fallen, relative to its initial orientation, rad."""

FALLEN_TIME = 0.25
"""Time over which a fall is judged, s: a base that has fallen is low or tilted in more than half of
the measurements. A low stride or a wrong measurement is shorter."""


def falls_of(robot: Robot, hypothesis: Hypothesis, trajectory: Trajectory) -> IndexArray:
    """Returns the first step at which each run has fallen; see ``first_falls``.

    The hypothesis matters because a slope tilts the ground. A robot without gravity, as a fish of
    dm_control, turns over and does not fall.
    """
    if not _has_gravity(robot):
        return np.full(trajectory["base_position"].shape[:-2], trajectory.steps)
    return first_falls(trajectory, build(robot, hypothesis).normal, robot.standing_height)


def _has_gravity(robot: Robot) -> bool:
    options = robot.model.opt
    disabled = options.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY
    return bool(not disabled and options.gravity.any())


def fallen(robot: Robot, hypotheses: Sequence[Hypothesis]) -> Until | None:
    """Returns the function that tells which runs have fallen, whatever follows; None if none can.

    The window of a fall is over: the rest of the run does not change the step of the fall. A run
    that diverges after it is finite if it ends. Falls that an earlier call has told are told again
    only where the base stays as it is, as that of a run that has ended.
    """
    if not _has_gravity(robot):
        return None
    known = {hypothesis: build(robot, hypothesis).normal for hypothesis in {*hypotheses}}
    normals = np.array([known[hypothesis] for hypothesis in hypotheses])

    window = steps_of(FALLEN_TIME, robot.control_timestep)

    def have_fallen(begun: Mapping[Signal, FloatArray]) -> BoolArray:
        position, orientation = begun["base_position"], begun["base_orientation"]
        run = position.shape[-2]
        # In the first step the robot stands, in the initial orientation; the others are all that
        # the last call has not judged. To judge every step in every call took a fifth of a rollout.
        steps = np.r_[0, max(1, run - window - UNTIL_EVERY) : run]
        pose = position[..., steps, :], orientation[..., steps, :]
        falls = _first_falls(*pose, normals, robot.standing_height, window)
        return np.asarray(falls + window <= len(steps))

    return have_fallen


def first_falls(trajectory: Trajectory, normals: FloatArray, standing_height: float) -> IndexArray:
    """Returns the first step at which the robot has fallen, or the number of steps without a fall.

    At that step the base is low or tilted, and so it is for most of ``FALLEN_TIME``; see
    ``first_lasting``.

    Args:
        trajectory: Position and orientation of the base, ``(..., steps, width)`` each; NaN where
            not observed.
        normals: Unit normals of the ground, ``(..., 3)``, broadcast to the shape of the runs. The
            ground passes through the origin.
        standing_height: Height of the base in the initial pose, m.
    """
    pose = trajectory["base_position"], trajectory["base_orientation"]
    return _first_falls(*pose, normals, standing_height, steps_in(FALLEN_TIME, trajectory))


def _first_falls(
    position: FloatArray,
    orientation: FloatArray,
    normals: FloatArray,
    standing_height: float,
    window: int,
) -> IndexArray:
    height = np.einsum("...sk,...k->...s", position, normals)
    # The world's upward direction in the frame of the base, against the first one that is known.
    upward = directions(orientation)[..., 2:]
    first = np.isfinite(upward).all(axis=-1).argmax(axis=-1)
    reference = np.take_along_axis(upward, first[..., np.newaxis, np.newaxis], axis=-2)
    cosine = (upward * reference).sum(axis=-1)
    low = (height < FALLEN_HEIGHT * standing_height) & (standing_height > 0)
    down = low | (cosine < np.cos(FALLEN_TILT))
    up = ~down & (np.isfinite(height) | np.isfinite(cosine))
    return first_lasting(down, up, window)


def fall_of(robot: Robot, hypothesis: Hypothesis, trial: Trial) -> int | None:
    """Returns the step at which the robot fell in a trial; None if it did not, or cannot fall.

    A fixed base cannot fall, and a base that was not observed is not known to have fallen. A trial
    that ended early may have ended by a fall: its last pose counts as if it remained.
    """
    if robot.has_fixed_base:
        return None
    logged = trial.trajectory
    whole = held_at_the_end(logged) if logged.steps < trial.plan.steps else logged
    fall = int(falls_of(robot, hypothesis, whole))
    return fall if fall < logged.steps else None


def fall_text(step: int | None) -> str:
    """Returns the fall of a robot at a step as a clause; nothing without one."""
    return "" if step is None else f", fell at step {step}"


def held_at_the_end(trajectory: Trajectory) -> Trajectory:
    """Returns the signals of a run that ended early as if the last ones remained.

    A robot that is stopped as it falls has few measurements of the fall.
    """
    more, time = steps_in(FALLEN_TIME, trajectory), trajectory.time
    step = time[-1] - time[-2] if trajectory.steps > 1 else FALLEN_TIME
    signals = {
        name: np.pad(values, ((0, more), (0, 0)), mode="edge")
        for name, values in trajectory.signals.items()
    }
    later = time[-1] + step * np.arange(1, more + 1)
    return Trajectory(trajectory.names, np.concatenate([time, later]), signals)


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
    run = state.shape[-1]
    first = np.minimum(np.arange(run), max(run - steps, 0))
    last = np.minimum(first + steps, run) - 1

    def in_window(one: BoolArray) -> IndexArray:
        total = np.cumsum(one, axis=-1)
        return np.asarray(total[..., last] - total[..., first] + one[..., first])

    lasting = state & (in_window(state) > in_window(other))
    return np.asarray(np.where(lasting.any(axis=-1), lasting.argmax(axis=-1), run))


def steps_in(duration: float, trajectory: Trajectory) -> int:
    """Returns the control steps in a time, s, at least 1."""
    time = trajectory.time
    return steps_of(duration, time[1] - time[0]) if len(time) > 1 else 1


def steps_of(duration: float, timestep: float) -> int:
    """Returns the control steps in a time, s, at least 1."""
    return max(1, round(duration / timestep))
