"""Segments of trials, and the errors of predicting them with models of the robot.

A robot that walks is predicted over a tenth of a second: contacts make longer simulations chaotic.
The joints of a fixed base are simulated for about a second without losing the trial: position
servos hold them to the commands, and in a second the commands move the joints there and back, which
shows gains, friction and inertia.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import groupby

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.errors import InputError
from selfmodel.faults.build import apply_faults
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.robot.model_variant import ModelVariant
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import with_known_base
from selfmodel.rotation import product
from selfmodel.simulation.model_factors import Parameters, model_with_parameters
from selfmodel.simulation.prediction import predict
from selfmodel.simulation.requests import LEAD, Segments, chained, command_steps, cut_segments
from selfmodel.simulation.rollout import SimulationStats, largest_batch
from selfmodel.trials import estimation
from selfmodel.trials.signals import CALIBRATION_ERROR_SCALES, Signal, difference
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial, check_magnitudes

MAX_SEGMENTS, MAX_FOLLOWING = 40, 10.0
"""Largest number of segments of a trial that was observed completely; and the longest part of one
in which the base or a hinge was not, so that segments follow each other, s."""

HORIZON = 10
"""Length of a segment, control steps."""

MIN_BASE_SHARE, MIN_COMPLETE_SHARE = 0.25, 0.25
"""Smallest share of usable segments with an observed base at which the base is used; and of known
steps with all hinges at which others are left out."""

SEGMENT_SECONDS = 1.0
"""Length of a segment of a robot with a fixed base, s, in a trial that is long enough."""

MIN_SEGMENTS, MIN_HORIZON = 12, 5
"""Smallest number of segments of a fixed base, as a short trial has shorter segments; and their
smallest length, control steps."""

MAX_ERROR = 1e6
"""Bound on the absolute error of a prediction, in its scale: that of a simulation that is no longer
finite. The solver does not end on numbers that are not finite."""

STATE_ERROR, PERTURBATIONS = 0.1, 4
"""Standard deviation of errors of the initial state of a segment, in ``CALIBRATION_ERROR_SCALES``,
and their number, by which sensitivity is measured. They make losses about as large as those of
fitted self-models. Of 19 healthy robots in gaits with losses of 0.4 to 3.8 times those in the
healthy trials, this ratio was 0.4 to 1.5 times that of the sensitivities, median 1.1."""

POSITIONS: Signal = "joint_positions"


@dataclass(frozen=True, eq=False)
class ObservedSegments:
    """Segments of a trial, and what was observed in them.

    Attributes:
        observed: Estimated state after each step, ``(segments, horizon, width)`` for each signal
            that is compared.
        valid: Mask of the steps after which the state is known, but for single hinges, and so are
            the commands that led there, ``(segments, horizon)``.
        known: Errors of predictions so far, by the parameters of the model, ``(errors,)`` each.
    """

    segments: Segments
    observed: Mapping[Signal, FloatArray]
    valid: BoolArray
    hypothesis: Hypothesis = INTACT
    known: dict[Parameters, FloatArray] = field(default_factory=dict, init=False)  # not of a copy

    @cached_property
    def compared(self) -> dict[Signal, BoolArray]:
        """Masks of the errors of each compared signal, ``(segments, horizon, columns)``.

        Errors of an orientation have three columns: all of them are known, or none.
        """
        masks: dict[Signal, BoolArray] = {}
        for signal in (own for own in CALIBRATION_ERROR_SCALES if own in self.observed):
            values, joints = self.observed[signal], signal in estimation.JOINTS
            known = np.isfinite(values) if joints else np.ones((*values.shape[:2], 3), np.bool_)
            masks[signal] = known & self.valid[..., np.newaxis]
        return masks


def observed_segments(
    robot: Robot, trial: Trial, following: float = MAX_FOLLOWING
) -> ObservedSegments:
    """Returns segments of a trial in which the state and the commands are known.

    The segments are spread over the trial and known completely. If the base's position and linear
    velocity are known in less than a quarter of the segments in which all other signals are, both
    are left out, and segments follow each other from the start of the trial, in the model's initial
    pose: each begins with the base in the predicted state at the end of the segment before. Of a
    trial in which a hinge is unknown most of the time, the other hinges are used in the same way.
    Segments that follow each other are ``following`` s long together, at most.

    With a fixed base, segments of up to a second follow each other, and joint positions are
    compared, and joint velocities if they were measured.

    Raises:
        InputError: Too few states and commands are known for any segments, or a value is infinite
            or absurdly large.
    """
    trajectory = with_known_base(robot, trial.trajectory)
    if robot.has_fixed_base:
        cut: ObservedSegments | str = _consecutive(trajectory)
        needs = (
            f"calibration of a robot with a fixed base needs {MIN_SEGMENTS} segments of "
            f"{MIN_HORIZON} steps or more with joint positions and commands"
        )
    else:
        cut = (
            _spread(trajectory, following)
            or _sequential(trajectory, following)
            or _lack(trajectory)
        )
        needs = (
            f"calibration needs segments of {LEAD + HORIZON + 1} steps or more, without late "
            f"steps, with {', '.join(estimation.ONBOARD)} and the commands"
        )
    if isinstance(cut, str):
        raise InputError(f"{trial.path}: {needs}, and {cut}: leave this log out")
    check_magnitudes(trial, (*cut.observed, "commands"))
    return cut


def _spread(trajectory: Trajectory, following: float) -> ObservedSegments | None:
    """Returns segments of the whole state, spread over the trial; None if there are too few.

    With unknown hinges, which continue from the segment before, they follow each other; of a long
    trial, those of two parts.
    """
    last = trajectory.steps - 1 - HORIZON
    if last < LEAD:
        return None
    states = estimation.estimated_states(trajectory)
    onboard = _known({signal: states[signal] for signal in estimation.ONBOARD})
    onboard = onboard & _complete(trajectory.steady_commands)
    known = onboard & _known(states)
    begins = np.unique(np.linspace(LEAD, last, MAX_SEGMENTS).round().astype(np.intp))
    whole = _all_known(known, begins)
    if not whole.any() or whole.sum() < MIN_BASE_SHARE * _all_known(onboard, begins).sum():
        return None
    if any(np.isnan(states[signal][known]).any() for signal in estimation.JOINTS):
        begins = np.arange(LEAD, last + 1, HORIZON)
        whole = _all_known(known, begins)
        return _chained(trajectory, states, begins[whole], estimation.STATE, following)
    return _cut(trajectory, states, begins[whole], HORIZON, estimation.STATE)


def _sequential(trajectory: Trajectory, following: float) -> ObservedSegments | None:
    """Returns consecutive segments of the onboard state; None if too few steps are valid.

    Every segment with a known initial state and known commands is simulated, because later segments
    continue from its end; of a long trial, those of two parts.
    """
    if trajectory.steps <= LEAD + HORIZON:
        return None
    begins = np.arange(0, trajectory.steps - HORIZON, HORIZON)
    states = estimation.estimated_states(trajectory, estimation.ONBOARD)
    commanded = _all_known(_complete(trajectory["commands"]), begins)
    starts = begins[_known(states)[begins] & commanded]
    cut = _chained(trajectory, states, starts, estimation.ONBOARD, following)
    return cut if cut is not None and cut.valid.sum() >= HORIZON else None


def _chained(
    trajectory: Trajectory,
    states: Mapping[Signal, FloatArray],
    starts: IndexArray,
    compared: tuple[Signal, ...],
    following: float,
) -> ObservedSegments | None:
    """Returns segments that follow each other, at most for some s; None without any."""
    if not len(starts):
        return None
    length = HORIZON * trajectory.timestep
    rows, counted, chains = chained(len(starts), round(following / length), length)
    cut = _cut(trajectory, states, starts[rows], HORIZON, compared)
    segments = replace(cut.segments, chains=chains)
    return replace(cut, segments=segments, valid=cut.valid & counted[:, np.newaxis])


def _consecutive(measured: Trajectory) -> ObservedSegments | str:
    """Returns segments of the joints of a fixed base that begin in a known state, or the lack.

    Joint velocities that were not measured are estimated, as the initial velocity of a segment.
    """
    trajectory, steps = estimation.with_joint_velocities(measured), measured.steps
    compared = estimation.JOINTS[: 1 if estimation.lacks_joint_velocities(measured) else 2]
    timestep = float(trajectory.time[1] - trajectory.time[0]) if steps > 1 else 1.0
    horizon = min(round(SEGMENT_SECONDS / timestep), (steps - 1 - LEAD) // MIN_SEGMENTS)
    if horizon < MIN_HORIZON:
        return f"the trial has {steps} steps"
    states = estimation.estimated_states(trajectory)
    starts = np.arange(LEAD, steps - horizon, horizon)
    commanded = _complete(trajectory["commands"])[command_steps(starts, horizon)].all(axis=1)
    starts = starts[_known(states)[starts] & commanded]
    starts = starts[_cut(trajectory, states, starts, horizon, compared).valid.any(axis=1)]
    if len(starts) < MIN_SEGMENTS // 2:
        return f"the log has {len(starts)} such segments"
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
    steady = np.logical_and.accumulate(_complete(trajectory.steady_commands)[before], axis=1)
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
    complete, some = _complete(np.hstack(list(states.values()))), estimation.known_steps(states)
    return complete if complete.sum() >= MIN_COMPLETE_SHARE * some.sum() else some


def _complete(values: FloatArray) -> BoolArray:
    return np.asarray(np.isfinite(values).all(axis=1))


def _all_known(known: BoolArray, begins: IndexArray) -> BoolArray:
    """Returns a mask of the segments that are known with their lead, ``(segments,)``."""
    return np.array([known[max(k - LEAD, 0) : k + HORIZON + 1].all() for k in begins.tolist()])


def _lack(trajectory: Trajectory) -> str:
    """Returns why there are no segments: too few steps, or signals that were never observed.

    Columns are named if only some of a signal lack. Of the joints, one hinge is enough.
    """
    if trajectory.steps <= LEAD + HORIZON:
        return f"the trial has {trajectory.steps}"
    never = []
    signals: tuple[Signal, ...] = (*estimation.ONBOARD, "commands")
    for signal in signals:
        names = np.array(trajectory.names.columns(signal))
        lacking = ~np.isfinite(trajectory[signal]).any(axis=0)
        if lacking.all() or (lacking.any() and signal not in estimation.JOINTS):
            never.append(signal + ("" if lacking.all() else f" of {', '.join(names[lacking])}"))
    return f"the log never has {', '.join(never)}" if never else "the log has no such segment"


def _with_errors(signal: Signal, values: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Returns values of a signal, ``(segments, width)``, with errors of ``STATE_ERROR``."""
    scale = STATE_ERROR * CALIBRATION_ERROR_SCALES[signal]
    if signal != "base_orientation":
        return np.asarray(values + scale * rng.standard_normal(values.shape))
    turn = 0.5 * scale * rng.standard_normal((len(values), 3))  # half of a small angle
    turned = product(np.hstack([np.ones((len(values), 1)), turn]), values)
    return np.asarray(turned / np.linalg.norm(turned, axis=1, keepdims=True))


def is_better(one: FloatArray, other: FloatArray, min_z: float) -> bool:
    """Returns whether one's losses of segments are lower by ``min_z`` standard errors, paired."""
    gains = other - one
    error = float(gains.std(ddof=1)) / np.sqrt(len(gains)) if len(gains) > 1 else np.inf
    return bool(gains.mean() > min_z * error and gains.mean() > 0)


def root_mean_square(errors: FloatArray) -> FloatArray:
    """Returns the root mean square of errors over their first axis."""
    return np.asarray(np.sqrt((errors**2).mean(axis=0)))


def pseudo_huber(errors: FloatArray) -> FloatArray:
    """Returns pseudo-Huber residuals: their squares grow linearly with errors above 1."""
    return np.asarray(np.sign(errors) * np.sqrt(2 * (np.sqrt(1 + errors**2) - 1)))


@dataclass(frozen=True, eq=False)
class SegmentErrors:
    """Errors of predictions of the segments of trials with models of a robot.

    ``on_models`` is called with the number of models so far, after each batch.
    """

    robot: Robot
    data: Sequence[ObservedSegments]
    threads: int
    on_models: Callable[[int], None] = lambda _: None
    stats: SimulationStats = field(default_factory=SimulationStats)

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
    def overlap(self) -> float:
        """Number of segments that contain a step, on average over the steps; at least 1."""
        trials = [own.segments for own in self.data]
        steps = [own.starts[:, np.newaxis] + np.arange(own.horizon) for own in trials]
        return sum(own.size for own in steps) / sum(len(np.unique(own)) for own in steps)

    def folds(self, count: int) -> IndexArray:
        """Returns the part of each segment, ``(segments,)``: each trial cut in time."""
        parts = [np.arange(len(own.valid)) * count // len(own.valid) for own in self.data]
        return np.concatenate(parts)

    def losses(self, errors: FloatArray) -> FloatArray:
        """Returns the mean loss of each segment, ``(segments,)``; 0 without a valid step."""
        number, count = self.segment_of_error, sum(len(own.valid) for own in self.data)
        sums = np.bincount(number, pseudo_huber(errors) ** 2, count)
        return np.asarray(sums / np.maximum(np.bincount(number, minlength=count), 1))

    def joint_errors(self, errors: FloatArray) -> FloatArray:
        """Returns the errors of joint positions, ``(valid steps, hinges)``, rad.

        The error of an unknown hinge is 0.
        """
        masks = [(own, *compared) for own in self.data for compared in own.compared.items()]
        ends = np.cumsum([mask.sum() for _, _, mask in masks])
        positions = []
        for (own, signal, mask), part in zip(masks, np.split(errors, ends[:-1]), strict=True):
            if signal == POSITIONS:
                values = np.zeros(mask.shape)
                values[mask] = part
                positions.append(values[own.valid])
        return np.concatenate(positions) * CALIBRATION_ERROR_SCALES[POSITIONS]

    def of(self, models: Sequence[Parameters]) -> FloatArray:
        """Returns prediction errors divided by their scales, ``(errors, models)``, all finite.

        Batches bound their memory; adjacent models with one control delay share them.
        """
        size = min(largest_batch(self.robot, own.segments, steps=0) for own in self.data)
        batches = [
            same[first : first + size]
            for same in (list(group) for _, group in groupby(models, lambda own: own.delay))
            for first in range(0, len(same), size)
        ]
        return np.concatenate([self._of_batch(batch) for batch in batches], axis=1)

    def with_estimated_states(self, parameters: Parameters) -> "SegmentErrors":
        """Returns independent segments: an unknown state begins as the parameters predict it."""
        record, data = (*estimation.BASE, *estimation.JOINTS), []
        for own in self.data:
            segments, states = own.segments, dict(own.segments.states)
            if not segments.independent:
                variants = self._variants([parameters], own.hypothesis)
                whole = replace(segments, record=record)
                predicted = self._predicted(variants, whole, parameters.delay)
                for signal in record:
                    begin = predicted[signal][0, :, 0]
                    known = states.get(signal, np.full_like(begin, np.nan))
                    states[signal] = np.where(np.isnan(known), begin, known)
            data.append(replace(own, segments=replace(segments, states=states)))
        return replace(self, data=data)

    def sensitivity(self, parameters: Parameters, rng: np.random.Generator) -> float:
        """Returns the mean loss of predictions from states with errors of ``STATE_ERROR``.

        Errors of the model are left out: the predictions are compared with those from the states
        without errors. It tells how chaotic a motion is, so how large a loss to expect of it.
        """
        data = []
        for own in self.data:
            variants = self._variants([parameters], own.hypothesis)
            exact = self._predicted(variants, own.segments, parameters.delay)
            observed = {
                signal: np.where(np.isnan(values), np.nan, exact[signal][0, :, 1:])
                for signal, values in own.observed.items()
            }
            for _ in range(PERTURBATIONS):
                states = {
                    signal: _with_errors(signal, values, rng)
                    for signal, values in own.segments.states.items()
                }
                segments = replace(own.segments, states=states)
                data.append(replace(own, segments=segments, observed=observed))
        perturbed = replace(self, data=data)
        losses = perturbed.losses(perturbed.of([parameters])[:, 0])
        return float(losses[np.unique(perturbed.segment_of_error)].mean())

    def _of_batch(self, models: Sequence[Parameters]) -> FloatArray:
        variants: dict[tuple[Parameters, Hypothesis], ModelVariant] = {}
        for own in self.data:
            if missing := [one for one in dict.fromkeys(models) if one not in own.known]:
                new = [one for one in missing if (one, own.hypothesis) not in variants]
                for one, variant in zip(new, self._variants(new, own.hypothesis), strict=True):
                    variants[one, own.hypothesis] = variant
                given = [variants[one, own.hypothesis] for one in missing]
                predicted, rows = self._predicted(given, own.segments, models[0].delay), []
                for signal, mask in own.compared.items():
                    with np.errstate(over="ignore", invalid="ignore"):  # bounded below
                        error = difference(
                            signal, predicted[signal][:, :, 1:], own.observed[signal]
                        )
                        rows.append((error / CALIBRATION_ERROR_SCALES[signal])[:, mask])
                errors = np.nan_to_num(np.concatenate(rows, axis=1), nan=MAX_ERROR)
                own.known.update(zip(missing, np.clip(errors, -MAX_ERROR, MAX_ERROR), strict=True))
        self.on_models(self.stats.runs // len(self.data))
        return np.array([np.concatenate([own.known[one] for own in self.data]) for one in models]).T

    def _variants(self, models: Sequence[Parameters], hypothesis: Hypothesis) -> list[ModelVariant]:
        scaled = [model_with_parameters(self.robot, parameters) for parameters in models]
        return [apply_faults(model, self.robot.anatomy, hypothesis) for model in scaled]

    def _predicted(
        self, variants: list[ModelVariant], segments: Segments, delay: float
    ) -> Trajectory:
        """Returns predictions of equal delay, ``(models, segments, horizon + 1, width)``."""
        given, stats = (self.robot, variants, segments), self.stats
        return predict(*given, threads=self.threads, stats=stats, delay=delay).trajectory
