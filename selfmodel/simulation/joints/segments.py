"""Segments of a trial of a robot with a fixed base, for the calibration of its joints.

The joints of a fixed base are simulated for about a second without losing the trial: position
servos hold them to the commands, and no contact makes the motion chaotic. In a second the commands
move the joints there and back, which shows gains, friction and inertia.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.errors import InputError
from selfmodel.simulation.requests import LEAD, Segments, command_steps, cut_segments
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.estimation import (
    JOINTS,
    STATE,
    estimated_states,
    lacks_joint_velocities,
    with_joint_velocities,
)
from selfmodel.trials.signals import Signal
from selfmodel.trials.trial import Trial, check_magnitudes

SEGMENT_SECONDS = 1.0
"""Length of a segment, s, in a trial that is long enough."""

MIN_SEGMENTS = 12
"""Smallest number of segments of a trial: a short trial has shorter segments."""

MIN_HORIZON = 5
"""Smallest length of a segment, control steps."""


@dataclass(frozen=True, eq=False)
class JointSegments:
    """Consecutive segments of a trial.

    Attributes:
        segments: Initial states and commands.
        observed: Logged values after each step, ``(segments, horizon, hinges)``: joint positions,
            and joint velocities if they were measured.
        judged: Mask of the steps whose prediction has an error, ``(segments, horizon)``.
    """

    segments: Segments
    observed: Mapping[Signal, FloatArray]
    judged: BoolArray


def joint_segments_of(trial: Trial) -> JointSegments:
    """Returns the segments of a trial that begin in a known state.

    Args:
        trial: Trial with known base. Joint velocities that were not measured are estimated, as the
            initial velocity of a segment; they are not compared with the prediction.

    Raises:
        InputError: Too few states and commands are known, or a value is infinite or absurdly large.
    """
    measured = trial.behaviour
    behaviour = with_joint_velocities(measured)
    states = estimated_states(behaviour, STATE)
    horizon = (
        min(
            round(SEGMENT_SECONDS / float(behaviour.time[1] - behaviour.time[0])),
            (behaviour.steps - 1 - LEAD) // MIN_SEGMENTS,
        )
        if behaviour.steps > 1
        else 0
    )
    compared = JOINTS[:1] if lacks_joint_velocities(measured) else JOINTS
    if horizon < MIN_HORIZON:
        raise _unusable(trial, f"the trial has {behaviour.steps} steps")
    starts = np.arange(LEAD, behaviour.steps - horizon, horizon)
    found = _segments(behaviour, states, starts, horizon, compared)
    if len(found.judged) < MIN_SEGMENTS // 2:
        raise _unusable(trial, f"the log has {len(found.judged)} such segments")
    check_magnitudes(trial, (*compared, "commands"))
    return found


def _segments(
    behaviour: Behaviour,
    states: Mapping[Signal, FloatArray],
    starts: IndexArray,
    horizon: int,
    compared: tuple[Signal, ...],
) -> JointSegments:
    known = np.asarray(np.isfinite(np.hstack(list(states.values()))).all(axis=1))
    commanded = np.asarray(np.isfinite(behaviour["commands"]).all(axis=1))
    steady = np.asarray(np.isfinite(behaviour.steady_commands).all(axis=1))
    before = command_steps(starts, horizon)
    usable = known[starts] & commanded[before].all(axis=1)
    starts, before = starts[usable], before[usable]
    after = starts[:, np.newaxis] + np.arange(1, horizon + 1)
    on_time = np.logical_and.accumulate(steady[before], axis=1)[:, LEAD:]
    compared_values = np.hstack([behaviour[signal] for signal in compared])
    seen = np.asarray(np.isfinite(compared_values).all(axis=1))
    judged = np.asarray(on_time & seen[after])
    kept = judged.any(axis=1)
    return JointSegments(
        segments=cut_segments(behaviour, states, starts[kept], horizon, record=compared),
        observed={signal: states[signal][after[kept]] for signal in compared},
        judged=judged[kept],
    )


def _unusable(trial: Trial, reason: str) -> InputError:
    return InputError(
        f"{trial.path}: calibration of a robot with a fixed base needs {MIN_SEGMENTS} segments of "
        f"{MIN_HORIZON} steps or more with joint positions and commands, and {reason}: leave this "
        f"log out"
    )
