"""Error of short predictions from many logged states."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.comparators.command_errors import command_errors, command_spans
from selfmodel.comparators.encoder_motion import (
    LoggedMotion,
    encoder_motion_loss,
    logged_motion,
)
from selfmodel.comparators.hinge_errors import hinge_losses
from selfmodel.comparators.loose_encoders import (
    LooseEncoders,
    detached_hinges,
    loose_encoders,
    with_loose_encoders,
)
from selfmodel.comparators.sensor_noise_level import noise_level_loss
from selfmodel.diagnosis.comparator import TrialRefusedError
from selfmodel.simulation.requests import Segments, command_steps, cut_segments
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.estimation import (
    ONBOARD,
    STATE,
    estimated_states,
    known_rows,
)
from selfmodel.trials.signals import PREDICTION_ERROR_SCALES, Signal, difference
from selfmodel.trials.trial import Trial

MIN_SEGMENTS = 4
"""Segments of a trial, at least."""

COMPARISONS = 4
"""Steps within a segment at which prediction and log are compared, evenly spread to its end."""

CONTRADICTION = 3.0
"""Factor on the loss of a binary reading that changes although no change is ever predicted."""


@dataclass(frozen=True)
class SegmentPrediction:
    """The error of short predictions of the trial, each from a logged state.

    A trial is cut into segments. Each begins in the logged state, continues under the logged
    commands, and is compared with the log at four steps. An error e of a signal whose scale is s
    has the loss ``log(1 + (e / s)^2)``, so that a chaotic moment cannot outweigh the rest; the loss
    is averaged over the columns of a signal and summed over the signals. Three more terms are added
    to that of the motion: the predicted readings, against the controller's input; the controller's
    arithmetic, the logged commands against the network's output for these readings; and the motion
    of each encoder at the scale of its own noise (``encoder_motion``).

    Source: prediction over a short horizon is multiple shooting (Bock & Plitt 1984) without the
    fit. Its use here answers the paper's future work, section V: displacement contains too little
    information.

    A hinge whose encoder was lost is unknown where it is NaN: it continues from its predicted state
    at the end of the segment before, and has no loss. The mean over the columns of a signal is then
    that of the known columns.

    Limits: the state is required, so encoders and the base's pose and velocity; of the encoders,
    one or more.
    ``segment-prediction-onboard`` requires neither the base's position nor its linear velocity, and
    continues each segment from the base's predicted state at the end of the segment before, which
    makes it less sharp. Slow effects, such as a light wind, hardly show within an eighth of a
    second. The network is taken to be known: without one (a recording of other software) its
    arithmetic is not compared. Segments with a late step (``Behaviour.late``) have no loss: the
    effect of a command in a quarter of a second is not its effect in an eighth.

    Attributes:
        name: The comparator's name.
        state: Signals of the state in which a segment begins, which are also predicted.
        horizon: Control steps of a segment.
        max_segments: Segments at most, evenly spread over the trial.
    """

    name: str
    state: tuple[Signal, ...] = STATE
    horizon: int = 12
    max_segments: int = 80

    @property
    def surrogate(self) -> "SegmentPrediction":
        """The same comparator with a third of the segments."""
        return dataclasses.replace(self, max_segments=max(self.max_segments // 3, MIN_SEGMENTS))

    def prepare(self, trial: Trial) -> "PreparedSegments":
        """Returns the segments of the trial and the logged values to compare them with.

        Raises:
            TrialRefusedError: The trial is too short, or has too few observations.
        """
        behaviour, horizon = trial.behaviour, self.horizon
        states = estimated_states(behaviour, self.state)
        starts, steady = self._starts(trial, states)
        compared = np.unique(np.linspace(0, horizon, COMPARISONS + 1).round().astype(int)[1:])
        rows = starts[:, np.newaxis] + compared
        request = cut_segments(behaviour, states, starts, horizon, (*self.state, "sensors"))
        return PreparedSegments(
            request=request,
            compared=compared,
            states={signal: values[rows] for signal, values in states.items()},
            steady=steady,
            readings=_logged_readings(behaviour["sensors"], starts, horizon),
            motion=_logged_motion(trial, request, starts),
            loose=loose_encoders(behaviour, starts, horizon),
            arithmetic=_arithmetic_loss(trial, starts, horizon),
            piece_steps=(starts[:, np.newaxis] + np.array([0, horizon]))[steady],
        )

    def _starts(
        self, trial: Trial, states: Mapping[Signal, FloatArray]
    ) -> tuple[IndexArray, BoolArray]:
        """Returns the steps at which segments begin, and a mask of those without a late step."""
        behaviour, horizon = trial.behaviour, self.horizon
        if behaviour.steps < MIN_SEGMENTS * horizon + 1:
            raise TrialRefusedError(
                f"{trial.path}: {self.name} needs {MIN_SEGMENTS * horizon + 1} steps or more, "
                f"and the trial has {behaviour.steps}",
                "leave this log out",
            )
        count = min(self.max_segments, (behaviour.steps - 1) // horizon)
        starts = np.linspace(0, behaviour.steps - 1 - horizon, count).round().astype(np.intp)
        known: dict[Signal, BoolArray] = {
            signal: known_rows(signal, states[signal][starts]) for signal in self.state
        }
        known["commands"] = _all_finite(behaviour["commands"], starts, horizon)
        usable = np.asarray(np.logical_and.reduce(list(known.values())))
        steady = _all_finite(behaviour.steady_commands, starts, horizon)
        if np.sum(usable & steady) < MIN_SEGMENTS:
            if usable.sum() >= MIN_SEGMENTS:
                raise TrialRefusedError(
                    f"{trial.path}: {self.name} needs {MIN_SEGMENTS} or more segments of {horizon} "
                    f"steps in which none was late, and the log does not have them",
                    "have the robot keep its control time step, or leave this log out",
                )
            lacking = [signal for signal, steps in known.items() if steps.sum() < MIN_SEGMENTS]
            raise TrialRefusedError(
                f"{trial.path}: {self.name} needs {', '.join(lacking or self.state)} at "
                f"{MIN_SEGMENTS} or more of {count} moments of the trial, and the log does not "
                f"have it",
                "give a comparator that needs fewer signals, or leave this log out",
            )
        return starts[usable], steady[usable]


@dataclass(frozen=True, eq=False)
class LoggedReadings:
    """The readings of the controller in the segments of a trial.

    Attributes:
        values: Readings, ``(segments, horizon + 1, sensors)``; NaN if unknown.
        binary: Mask of the sensors whose readings in the whole trial are 0 or 1, ``(sensors,)``;
            False for a sensor that was never observed.
        mid_trial: Mask of the segments that begin after the start of the trial, ``(segments,)``.
    """

    values: FloatArray
    binary: BoolArray
    mid_trial: BoolArray


@dataclass(frozen=True, eq=False)
class PreparedSegments:
    """A trial prepared for ``SegmentPrediction``.

    Segments with a late step are predicted, because later segments may continue from their end, and
    have no loss.

    Attributes:
        request: The segments; the state and the readings are recorded.
        compared: Steps within a segment at which the state is compared, ``(comparisons,)``.
        states: Logged state at these steps, ``(segments, comparisons, width)`` for each signal.
        steady: Mask of the segments without a late step, ``(segments,)``.
        readings: The logged readings.
        motion: The logged motion of the encoders; None for states without joint positions.
        loose: Encoders that follow commands, as of a detached limb; None if there are none.
        arithmetic: Loss of the controller's arithmetic, ``(segments,)``.
        piece_steps: First and last step of each segment without a late step, ``(segments, 2)``.
    """

    request: Segments
    compared: IndexArray
    states: Mapping[Signal, FloatArray]
    steady: BoolArray
    readings: LoggedReadings
    motion: LoggedMotion | None
    loose: LooseEncoders | None
    arithmetic: FloatArray
    piece_steps: IndexArray

    def distances(self, simulated: Behaviour) -> FloatArray:
        """Returns the mean loss of the segments, ``(n,)``."""
        return np.asarray(self.losses(simulated).mean(axis=1))

    def losses(self, simulated: Behaviour) -> FloatArray:
        """Returns the loss of each segment without a late step, ``(n, segments)``."""
        terms = self._terms(simulated)
        total = np.zeros(simulated["sensors"].shape[:2]) + terms.pop("commands")
        for term in terms.values():
            total += term
        return total if self.steady.all() else np.ascontiguousarray(total[:, self.steady])

    def losses_by_signal(self, simulated: Behaviour) -> dict[str, FloatArray]:
        """Returns the part of each signal in the losses, ``(n, segments)`` each."""
        return {signal: term[:, self.steady] for signal, term in self._terms(simulated).items()}

    def losses_by_hinge(self, simulated: Behaviour) -> FloatArray:
        """Returns the loss of each hinge on its own, ``(n, segments, hinges)``; NaN if unknown.

        See ``hinge_errors``. These losses are no part of ``losses``.
        """
        if "joint_positions" not in self.states:
            return np.full((*self.losses(simulated).shape, len(simulated.names.hinges)), np.nan)
        losses = hinge_losses(simulated.signals, self.states, self.compared)
        return losses[:, self.steady]

    def _terms(self, simulated: Behaviour) -> dict[str, FloatArray]:
        """Returns the loss of each signal in each segment, ``(n, segments)`` each."""
        shape = simulated["sensors"].shape[:2]
        terms = {"commands": np.broadcast_to(self.arithmetic, shape)}
        predictions = simulated
        if self.loose is not None and self.motion is not None:
            detached = detached_hinges(simulated["joint_positions"], self.motion.resting)
            predictions = with_loose_encoders(simulated, self.loose, detached)
        for signal, logged in self.states.items():
            predicted = predictions[signal][:, :, self.compared]
            error = difference(signal, predicted, logged) / PREDICTION_ERROR_SCALES[signal]
            terms[signal] = _finite_mean(np.log1p(np.square(error)))
        terms["sensors"] = _readings_loss(predictions["sensors"], self.readings, self.steady)
        if self.motion is not None:
            motion = encoder_motion_loss(simulated["joint_positions"], self.motion)
            terms["encoder motion"] = motion
        return terms


def _all_finite(commands: FloatArray, starts: IndexArray, horizon: int) -> BoolArray:
    """Returns a mask of the segments whose commands are all finite, ``(segments,)``."""
    rows = np.maximum(command_steps(starts, horizon), 0)
    return np.asarray(np.isfinite(commands[rows]).all(axis=(1, 2)))


def _arithmetic_loss(trial: Trial, starts: IndexArray, horizon: int) -> FloatArray:
    """Returns the loss of the logged commands against the controller's, ``(segments,)``."""
    scale = PREDICTION_ERROR_SCALES["commands"] * command_spans(trial)
    errors = command_errors(trial) / scale
    rows = starts[:, np.newaxis] + np.arange(1, horizon + 1)
    return _finite_mean(np.log1p(np.square(errors[rows])))


def _logged_motion(trial: Trial, request: Segments, starts: IndexArray) -> LoggedMotion | None:
    """Returns the motion of the encoders in the segments; None without joint positions."""
    resting = request.resting_angles
    if resting is None:
        return None
    return logged_motion(trial.behaviour["joint_positions"], starts, request.horizon, resting)


def _logged_readings(logged: FloatArray, starts: IndexArray, horizon: int) -> LoggedReadings:
    unknown = np.isnan(logged)
    binary = (np.isin(logged, (0.0, 1.0)) | unknown).all(axis=0) & ~unknown.all(axis=0)
    rows = starts[:, np.newaxis] + np.arange(horizon + 1)
    return LoggedReadings(logged[rows], np.asarray(binary), starts > 0)


def _readings_loss(predicted: FloatArray, logged: LoggedReadings, steady: BoolArray) -> FloatArray:
    """Returns the loss of the predicted readings, ``(n, segments)``.

    The first row of a segment follows from the state alone. Angles are certain there, but touches
    only at the start of the trial, in the initial pose: elsewhere, millimetres decide. The loss of
    the noise levels is estimated from all segments together, and added to each.
    """
    predicts_binary = np.isin(predicted, (0.0, 1.0)).all(axis=(1, 2))
    switches = np.asarray(logged.binary & predicts_binary)
    never = np.asarray(switches & ~predicted.any(axis=(1, 2)))
    errors = predicted - logged.values
    graded = np.log1p(np.square(errors / PREDICTION_ERROR_SCALES["sensors"]))
    switched = np.abs(errors) * np.where(never, CONTRADICTION, 1.0)[:, None, None]
    switched[:, logged.mid_trial, 0] *= 0.0  # an unknown reading remains NaN
    losses = _finite_mean(np.where(switches[:, None, None], switched, graded))
    observed = ~np.isnan(logged.values).all(axis=(0, 1))
    graded_sensors = np.asarray(observed & ~switches)
    noise = noise_level_loss(predicted[:, steady], logged.values[steady], graded_sensors)
    return losses + noise[:, np.newaxis]


def _finite_mean(values: FloatArray) -> FloatArray:
    """Returns the mean of the finite values over the last two axes; 0 if there are none."""
    known = np.isfinite(values)
    if known.all():
        return np.asarray(values.mean(axis=(-2, -1)))
    total = np.where(known, values, 0.0).sum(axis=(-2, -1))
    return np.asarray(total / np.maximum(known.sum(axis=(-2, -1)), 1))


SEGMENT_PREDICTION = SegmentPrediction("segment-prediction")
SEGMENT_PREDICTION_ONBOARD = SegmentPrediction("segment-prediction-onboard", state=ONBOARD)
