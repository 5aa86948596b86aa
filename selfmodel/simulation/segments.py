"""Segments of healthy trials, and the errors of predicting them with models of the robot.

A robot that walks is predicted over a tenth of a second: contacts make longer simulations chaotic.
The joints of a fixed base are simulated for about a second without losing the trial: position
servos hold them to the commands, and in a second the commands move the joints there and back, which
shows gains, friction and inertia.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.errors import InputError
from selfmodel.faults.build import apply_faults
from selfmodel.faults.hypothesis import INTACT
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import with_known_base
from selfmodel.simulation.model_factors import Parameters, model_with_parameters
from selfmodel.simulation.prediction import predict
from selfmodel.simulation.requests import LEAD, Segments, command_steps, cut_segments
from selfmodel.simulation.rollout import SimulationStats, largest_batch
from selfmodel.trials.estimation import (
    BASE,
    JOINTS,
    ONBOARD,
    STATE,
    estimated_states,
    known_steps,
    lacks_joint_velocities,
    with_joint_velocities,
)
from selfmodel.trials.signals import CALIBRATION_ERROR_SCALES, Signal, difference
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial, check_magnitudes

MAX_SEGMENTS = 40
"""Largest number of segments of a trial in which the base was observed."""

HORIZON = 10
"""Length of a segment, control steps."""

MIN_BASE_SHARE = 0.25
"""Smallest share of usable segments with an observed base at which the base is used."""

MIN_COMPLETE_SHARE = 0.25
"""Smallest share of the known steps at which every hinge is known, for other steps to be left out.
"""

SEGMENT_SECONDS = 1.0
"""Length of a segment of a robot with a fixed base, s, in a trial that is long enough."""

MIN_SEGMENTS = 12
"""Smallest number of segments of a fixed base: a short trial has shorter segments."""

MIN_HORIZON = 5
"""Smallest length of a segment of a fixed base, control steps."""

MAX_ERROR = 1e6
"""Bound on the absolute error of a prediction, in ``CALIBRATION_ERROR_SCALES``: the error of a
simulation that is no longer finite. The solver does not end on numbers that are not finite."""

_POSITIONS: Signal = "joint_positions"


@dataclass(frozen=True, eq=False)
class ObservedSegments:
    """Segments of a trial, and what was observed in them.

    Attributes:
        segments: Initial states and commands.
        observed: Estimated state after each step, ``(segments, horizon, width)`` for each signal
            that is compared.
        valid: Mask of the steps whose prediction has an error, ``(segments, horizon)``: the state
            after the step is known, and so are the commands that led there. Single hinges may be
            unknown; see ``compared``.
    """

    segments: Segments
    observed: Mapping[Signal, FloatArray]
    valid: BoolArray

    @cached_property
    def compared(self) -> dict[Signal, BoolArray]:
        """Masks of the errors of each compared signal, ``(segments, horizon, columns)``.

        Errors of an orientation have three columns: all of them are known, or none.
        """
        masks: dict[Signal, BoolArray] = {}
        for signal in (own for own in CALIBRATION_ERROR_SCALES if own in self.observed):
            values = self.observed[signal]
            known = np.isfinite(values) if signal in JOINTS else np.ones((*values.shape[:2], 3))
            masks[signal] = (known != 0) & self.valid[..., np.newaxis]
        return masks


def observed_segments(robot: Robot, trial: Trial) -> ObservedSegments:
    """Returns segments of a trial in which the state and the commands are known.

    The segments are spread over the trial and known completely. If the base's position and linear
    velocity are known in less than a quarter of the segments in which all other signals are, both
    are left out, and segments follow each other from the start of the trial, in the model's initial
    pose: each begins with the base in the predicted state at the end of the segment before. Of a
    trial in which a hinge is unknown most of the time, the other hinges are used in the same way.

    With a fixed base, segments of up to a second follow each other, and joint positions are
    compared, and joint velocities if they were measured.

    Raises:
        InputError: Too few states and commands are known for any segments, or a value is infinite
            or absurdly large.
    """
    trajectory = with_known_base(robot, trial.trajectory)
    if robot.has_fixed_base:
        found = _consecutive(trial, trajectory)
    else:
        if trajectory.steps <= LEAD + HORIZON:
            raise _unusable(trial, f"the trial has {trajectory.steps}")
        some = _spread(trajectory) or _sequential(trajectory)
        if some is None:
            never = _never_known(trajectory)
            raise _unusable(
                trial, f"the log never has {never}" if never else "the log has no such segment"
            )
        found = some
    check_magnitudes(trial, (*found.observed, "commands"))
    return found


def _spread(trajectory: Trajectory) -> ObservedSegments | None:
    """Returns segments of the whole state; None if there are too few.

    They are independent and spread over the trial. With unknown hinges, which continue from the
    segment before, they follow each other.
    """
    last = trajectory.steps - 1 - HORIZON
    begins = np.unique(np.linspace(LEAD, last, MAX_SEGMENTS).round().astype(np.intp))
    states = estimated_states(trajectory, STATE)
    onboard = _known({signal: states[signal] for signal in ONBOARD}) & _steady(trajectory)
    known = onboard & _known(states)
    whole = _all_known(known, begins)
    if not whole.any() or whole.sum() < MIN_BASE_SHARE * _all_known(onboard, begins).sum():
        return None
    if any(np.isnan(states[signal][known]).any() for signal in JOINTS):
        begins = np.arange(LEAD, last + 1, HORIZON)
        whole = _all_known(known, begins)
        if not whole.any():
            return None
    return _cut(trajectory, states, begins[whole], HORIZON, STATE)


def _sequential(trajectory: Trajectory) -> ObservedSegments | None:
    """Returns consecutive segments of the onboard state; None if too few steps are valid.

    Every segment with a known initial state and known commands is simulated, because later segments
    continue from its end. A step is valid if its state was observed and no command before it, in
    the segment or in its lead, was held for other than a control time step.
    """
    begins = np.arange(0, trajectory.steps - HORIZON, HORIZON)
    states = estimated_states(trajectory, ONBOARD)
    starts = begins[_known(states)[begins] & _all_known(_commanded(trajectory), begins)]
    segments = _cut(trajectory, states, starts, HORIZON, ONBOARD)
    return segments if segments.valid.sum() >= HORIZON else None


def _consecutive(trial: Trial, measured: Trajectory) -> ObservedSegments:
    """Returns segments of the joints of a fixed base that begin in a known state.

    Joint velocities that were not measured are estimated, as the initial velocity of a segment.
    """
    trajectory, steps = with_joint_velocities(measured), measured.steps
    compared = JOINTS[:1] if lacks_joint_velocities(measured) else JOINTS
    timestep = float(trajectory.time[1] - trajectory.time[0]) if steps > 1 else 1.0
    horizon = min(round(SEGMENT_SECONDS / timestep), (steps - 1 - LEAD) // MIN_SEGMENTS)
    if horizon < MIN_HORIZON:
        raise _unusable(trial, f"the trial has {steps} steps", fixed=True)
    states = estimated_states(trajectory, STATE)
    starts = np.arange(LEAD, steps - horizon, horizon)
    commanded = _commanded(trajectory)[command_steps(starts, horizon)].all(axis=1)
    starts = starts[_known(states)[starts] & commanded]
    starts = starts[_cut(trajectory, states, starts, horizon, compared).valid.any(axis=1)]
    if len(starts) < MIN_SEGMENTS // 2:
        raise _unusable(trial, f"the log has {len(starts)} such segments", fixed=True)
    return _cut(trajectory, states, starts, horizon, compared)


def _cut(
    trajectory: Trajectory,
    states: Mapping[Signal, FloatArray],
    starts: IndexArray,
    horizon: int,
    compared: tuple[Signal, ...],
) -> ObservedSegments:
    before = np.maximum(command_steps(starts, horizon), 0)
    after = starts[:, np.newaxis] + np.arange(1, horizon + 1)
    steady = np.logical_and.accumulate(_steady(trajectory)[before], axis=1)
    observed = {signal: states[signal] for signal in compared}
    return ObservedSegments(
        segments=cut_segments(trajectory, states, starts, horizon, record=compared),
        observed={signal: values[after] for signal, values in observed.items()},
        valid=steady[:, LEAD:] & _known(observed)[after],
    )


def _known(states: Mapping[Signal, FloatArray]) -> BoolArray:
    """Returns a mask of the steps at which a state is known, ``(steps,)``.

    It is known completely there; if that is rare, single hinges may be unknown.
    """
    complete = np.isfinite(np.hstack(list(states.values()))).all(axis=1)
    some = known_steps(states)
    return np.asarray(complete if complete.sum() >= MIN_COMPLETE_SHARE * some.sum() else some)


def _commanded(trajectory: Trajectory) -> BoolArray:
    """Returns a mask of the steps with known commands, ``(steps,)``."""
    return np.asarray(np.isfinite(trajectory["commands"]).all(axis=1))


def _steady(trajectory: Trajectory) -> BoolArray:
    """Returns a mask of the known commands held for one control time step, ``(steps,)``."""
    return np.asarray(np.isfinite(trajectory.steady_commands).all(axis=1))


def _all_known(known: BoolArray, begins: IndexArray) -> BoolArray:
    """Returns a mask of the segments that are known with their lead, ``(segments,)``."""
    return np.array([known[max(k - LEAD, 0) : k + HORIZON + 1].all() for k in begins.tolist()])


def _never_known(trajectory: Trajectory) -> str:
    """Returns the required signals that were never observed, with columns if only some are.

    Of the joints, one hinge is enough.
    """
    never = []
    signals: tuple[Signal, ...] = (*ONBOARD, "commands")
    for signal in signals:
        names = np.array(trajectory.names.columns(signal))
        lacking = ~np.isfinite(trajectory[signal]).any(axis=0)
        if lacking.all() or (lacking.any() and signal not in JOINTS):
            some = "" if lacking.all() else f" of {', '.join(names[lacking])}"
            never.append(signal + some)
    return ", ".join(never)


def _unusable(trial: Trial, reason: str, *, fixed: bool = False) -> InputError:
    needs = (
        f"calibration of a robot with a fixed base needs {MIN_SEGMENTS} segments of {MIN_HORIZON} "
        f"steps or more with joint positions and commands"
        if fixed
        else f"calibration needs segments of {LEAD + HORIZON + 1} steps or more, without late "
        f"steps, with {', '.join(ONBOARD)} and the commands"
    )
    return InputError(f"{trial.path}: {needs}, and {reason}: leave this log out")


def is_better(one: FloatArray, other: FloatArray, min_z: float) -> bool:
    """Returns whether one's losses of segments are lower by ``min_z`` standard errors, paired."""
    gains = other - one
    error = float(gains.std(ddof=1)) / np.sqrt(len(gains)) if len(gains) > 1 else np.inf
    return bool(gains.mean() > min_z * error and gains.mean() > 0)


def root_mean_square(errors: FloatArray) -> float:
    """Returns the root mean square of errors."""
    return float(np.sqrt(np.mean(errors**2)))


def pseudo_huber(errors: FloatArray) -> FloatArray:
    """Returns pseudo-Huber residuals: their squares grow linearly with errors above 1."""
    return np.asarray(np.sign(errors) * np.sqrt(2 * (np.sqrt(1 + errors**2) - 1)))


@dataclass(frozen=True, eq=False)
class SegmentErrors:
    """Errors of predictions of segments with models of a robot.

    Attributes:
        robot: The robot as its model describes it.
        data: Segments of at least one trial of the healthy robot.
        threads: Threads of MuJoCo's steps.
    """

    robot: Robot
    data: Sequence[ObservedSegments]
    threads: int

    @cached_property
    def segment_of_error(self) -> IndexArray:
        """Number of the segment of each error, over all trials, ``(errors,)``."""
        first = np.cumsum([0, *(len(own.valid) for own in self.data)])
        return np.concatenate(
            [
                number + np.nonzero(mask)[0]
                for number, own in zip(first, self.data, strict=False)
                for mask in own.compared.values()
            ]
        )

    @property
    def segments(self) -> int:
        """Number of segments of all trials."""
        return sum(len(own.valid) for own in self.data)

    @property
    def overlap(self) -> float:
        """Number of segments that contain a step, on average over the steps; at least 1."""
        steps = [
            own.segments.starts[:, np.newaxis] + np.arange(own.segments.horizon)
            for own in self.data
        ]
        return sum(own.size for own in steps) / sum(len(np.unique(own)) for own in steps)

    def folds(self, count: int) -> IndexArray:
        """Returns the part of each segment, ``(segments,)``: each trial cut in time."""
        parts = [np.arange(len(own.valid)) * count // len(own.valid) for own in self.data]
        return np.concatenate(parts)

    def losses(self, errors: FloatArray) -> FloatArray:
        """Returns the mean loss of each segment, ``(segments,)``, from errors, ``(errors,)``.

        A segment without a valid step has a loss of 0.
        """
        number = self.segment_of_error
        sums = np.bincount(number, pseudo_huber(errors) ** 2, self.segments)
        return np.asarray(sums / np.maximum(np.bincount(number, minlength=self.segments), 1))

    def joint_errors(self, errors: FloatArray) -> FloatArray:
        """Returns the errors of joint positions, ``(valid steps, hinges)``, rad.

        The error of an unknown hinge is 0. ``errors`` are all errors of one model, ``(errors,)``.
        """
        first, found = 0, []
        for own in self.data:
            for signal, mask in own.compared.items():
                last = first + int(mask.sum())
                if signal == _POSITIONS:
                    known = mask[own.valid]
                    found.append(np.zeros(known.shape))
                    found[-1][known] = errors[first:last]
                first = last
        return np.concatenate(found) * CALIBRATION_ERROR_SCALES[_POSITIONS]

    def of(self, models: Sequence[Parameters], stats: SimulationStats | None = None) -> FloatArray:
        """Returns prediction errors divided by their scales, ``(errors, models)``, all finite.

        The models are predicted in batches, so that their memory is bounded; adjacent ones with one
        control delay share them.
        """
        stats = SimulationStats() if stats is None else stats
        size = min(largest_batch(self.robot, own.segments, steps=0) for own in self.data)
        batches = [
            same[first : first + size]
            for same in (list(group) for _, group in groupby(models, lambda own: own.delay))
            for first in range(0, len(same), size)
        ]
        return np.concatenate([self._of_batch(batch, stats) for batch in batches], axis=1)

    def with_estimated_states(self, parameters: Parameters) -> "SegmentErrors":
        """Returns the errors of independent segments.

        An unknown state begins as the parameters predict it.
        """
        predict_with = self._predictor([parameters], SimulationStats())

        def independent(own: ObservedSegments) -> ObservedSegments:
            segments = own.segments
            if segments.independent:
                return own
            predicted = predict_with(replace(segments, record=(*BASE, *JOINTS)))
            states = dict(segments.states)
            for signal in predicted.signals:
                begin = predicted[signal][0, :, 0]
                known = states.get(signal, np.full_like(begin, np.nan))
                states[signal] = np.where(np.isnan(known), begin, known)
            return replace(own, segments=replace(segments, states=states))

        return replace(self, data=[independent(own) for own in self.data])

    def _of_batch(self, models: Sequence[Parameters], stats: SimulationStats) -> FloatArray:
        predict_with = self._predictor(models, stats)
        rows = []
        for own in self.data:
            predicted = predict_with(own.segments)
            for signal, mask in own.compared.items():
                with np.errstate(over="ignore", invalid="ignore"):  # bounded below
                    error = difference(signal, predicted[signal][:, :, 1:], own.observed[signal])
                    rows.append((error / CALIBRATION_ERROR_SCALES[signal])[:, mask])
        errors = np.nan_to_num(np.concatenate(rows, axis=1).T, nan=MAX_ERROR)
        return np.clip(errors, -MAX_ERROR, MAX_ERROR)

    def _predictor(
        self, models: Sequence[Parameters], stats: SimulationStats
    ) -> Callable[[Segments], Trajectory]:
        """Returns a function that predicts segments with models of equal delay.

        The signals of its result are ``(models, segments, horizon + 1, width)``.
        """
        robot, delay = self.robot, models[0].delay
        variants = [
            apply_faults(model_with_parameters(robot, parameters), robot.anatomy, INTACT)
            for parameters in models
        ]

        def predict_with(segments: Segments) -> Trajectory:
            return predict(
                robot, variants, segments, threads=self.threads, stats=stats, delay=delay
            ).trajectory

        return predict_with
