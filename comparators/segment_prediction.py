"""Error of short predictions from many logged states."""

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.comparators import encoders, readings
from selfmodel.controllers.playback import Playback
from selfmodel.diagnosis.comparator import Losses, Prepared, TrialRefusedError
from selfmodel.simulation.requests import (
    MAX_CHAIN,
    WARM_UP,
    Segments,
    chained,
    command_steps,
    cut_segments,
)
from selfmodel.trials.estimation import (
    BASE,
    JOINTS,
    ONBOARD,
    STATE,
    estimated_states,
    known_rows,
    known_steps,
)
from selfmodel.trials.signals import PREDICTION_ERROR_SCALES, Signal, difference
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial

MIN_SEGMENTS = 4
"""Segments of a trial, at least."""

MIN_COVER = 0.9
"""Share of a trial that segments cover without gaps that matter."""

LEAST = 12
"""Segments, at least, that a surrogate simulates of a trial that has more than its most."""

COMPARISONS = 4
"""Steps within a segment at which prediction and log are compared, evenly spread to its end."""


@dataclass(frozen=True)
class SegmentPrediction:
    """The error of short predictions of the trial, each from a logged state.

    A trial is cut into segments. Each begins in the logged state, continues under the logged
    commands, and is compared with the log at four steps. An error e of a signal whose scale is s
    has the loss ``log(1 + (e / s)^2)``, so that a chaotic moment cannot outweigh the rest; the loss
    is averaged over the columns of a signal and summed over the signals. Three more terms are added
    to that of the motion: the predicted readings, against the controller's input; the controller's
    arithmetic, the logged commands against the network's output for these readings; and the motion
    of each encoder at the scale of its own noise (``encoders``).

    Source: prediction over a short horizon is multiple shooting (Bock & Plitt 1984) without the
    fit. Its use here answers the paper's future work, section V: displacement contains too little
    information.

    A hinge whose encoder was lost is unknown where it is NaN: it continues from its predicted state
    at the end of the segment before, and has no loss. The mean over the columns of a signal is then
    that of the known columns. So does the base of ``segment-prediction-onboard``, which requires
    neither its position nor its linear velocity. Such segments follow each other (``chained``).

    Limits: needs the base's pose and velocity and at least one encoder. Slow effects, such as a
    light wind, hardly show within an eighth of a second. The network is taken to be known: without
    one (a recording of other software) its arithmetic is not compared. Segments with a late step
    (``Trajectory.late``) have no loss: the effect of a command in a quarter of a second is not its
    effect in an eighth.

    Attributes:
        name: The comparator's name.
        state: Signals of the state in which a segment begins, which are also predicted.
        horizon: Control steps of a segment.
        max_segments: Segments of a short trial, at most, evenly spread over it.
        density: Segments per control step of a longer trial.
        only_last: Whether only the last segment of a trial is compared, as of a robot that is
            watched, and predicted beside it what it continues from.
    """

    name: str
    state: tuple[Signal, ...] = STATE
    horizon: int = 12
    max_segments: int = 80
    density: float = 0.08
    only_last: bool = False

    @property
    def surrogate(self) -> "SegmentPrediction":
        """The same comparator with a third of the segments, at most those of a short trial."""
        fewer = max(self.max_segments // 3, MIN_SEGMENTS)
        return dataclasses.replace(self, max_segments=fewer, density=0.0)

    def prepare(self, trial: Trial) -> Prepared:
        """Returns the segments of the trial and the logged values to compare them with.

        Segments with a late step, and those that warm up a chain, are predicted, because later ones
        may continue from their end, and have no loss.
        """
        prepared, starts, steady, chains = self._prepared(trial)
        if self.only_last:
            last = prepared(slice(-1, None), 1)
            if isinstance(last.request, Segments) and last.request.independent:
                return last
            warm_up = max(1, round(WARM_UP / (self.horizon * trial.trajectory.timestep)))
            return prepared(slice(-1 - warm_up, None), 1)
        whole = prepared(slice(None), chains)
        if chains == 1 or trial.trajectory.time[-1] <= MAX_CHAIN:
            return whole
        size = len(starts) // chains
        parts = [slice(first, first + size) for first in range(0, len(starts), size)]
        sections = [prepared(own, 1) for own in parts if steady[own].any()]
        return dataclasses.replace(whole, sections=sections)

    def _prepared(
        self, trial: Trial
    ) -> tuple[Callable[[slice, int], Prepared], IndexArray, BoolArray, int]:
        """Returns a function that prepares some segments in chains, and what ``_starts`` does."""
        trajectory, horizon = trial.trajectory, self.horizon
        states = estimated_states(trajectory, self.state)
        starts, steady, chains = self._starts(trial, states)
        compared = np.unique(np.linspace(0, horizon, COMPARISONS + 1).round().astype(int)[1:])
        logged = {s: values[starts[:, np.newaxis] + compared] for s, values in states.items()}
        reading_log = readings.logged_readings(trajectory["sensors"], starts, horizon)
        motion = encoders.logged_motion(trajectory["joint_positions"], starts, horizon)
        # Most preparations are only to see whether the trial is accepted.
        loose = cache(partial(encoders.loose_encoders, trajectory, starts, horizon))
        arithmetic = readings.arithmetic_loss(trial, starts, horizon)

        def losses(simulated: Trajectory, own: slice) -> Losses:
            """Returns the losses of each segment that has any, of some that were simulated."""
            counted, predicted = steady[own], simulated.signals
            if simulated.hinge_mask("detached").any() and (followed := loose()):
                predicted = encoders.with_loose_encoders(simulated, followed.of(own))
            shape = predicted["sensors"].shape[:2]
            terms = {"commands": np.broadcast_to(arithmetic[own], shape)}
            for signal, values in logged.items():
                error = difference(signal, predicted[signal][:, :, compared], values[own])
                scaled = error / PREDICTION_ERROR_SCALES[signal]
                terms[signal] = readings.finite_mean(np.log1p(np.square(scaled)))
            terms["sensors"] = readings.readings_loss(
                predicted["sensors"], reading_log.of(own), counted
            )
            terms["encoder motion"] = encoders.encoder_motion_loss(simulated, motion.of(own))
            total = np.zeros(shape)
            for term in terms.values():
                total += term
            at_compared = {signal: values[own] for signal, values in logged.items()}
            return Losses(
                total=total if counted.all() else np.ascontiguousarray(total[:, counted]),
                by_signal={signal: term[:, counted] for signal, term in terms.items()},
                by_hinge=encoders.hinge_losses(simulated, at_compared, compared)[:, counted],
            )

        record: tuple[Signal, ...] = (*self.state, "sensors")

        def prepared(own: slice, chains: int) -> Prepared:
            begins = starts[own]
            request = dataclasses.replace(
                cut_segments(trajectory, states, begins, horizon, record, chains=chains),
                reads_encoders=isinstance(trial.plan.controller, Playback),
            )
            piece_steps = (begins[:, np.newaxis] + np.array([0, horizon]))[steady[own]]
            return Prepared(request, partial(losses, own=own), piece_steps)

        return prepared, starts, steady, chains

    def _starts(
        self, trial: Trial, states: Mapping[Signal, FloatArray]
    ) -> tuple[IndexArray, BoolArray, int]:
        """Returns the steps at which segments begin, a mask of those that have a loss, and chains.

        Segments that follow each other are consecutive, if not all of a trial are simulated.
        """
        trajectory, horizon = trial.trajectory, self.horizon
        if trajectory.steps < MIN_SEGMENTS * horizon + 1:
            raise TrialRefusedError(
                f"{trial.path}: {self.name} needs {MIN_SEGMENTS * horizon + 1} steps or more, "
                f"and the trial has {trajectory.steps}",
                "leave this log out",
            )
        fitting = (trajectory.steps - 1) // horizon
        most = max(self.max_segments, round(self.density * trajectory.steps))
        if not self.density and fitting > most:  # a surrogate: of a trial of middle length, too
            most = min(most, max(round(fitting / 3), LEAST))
        follow = not set(BASE) <= states.keys() or any(
            np.isnan(states[signal][known_steps(states)]).any() for signal in JOINTS
        )
        count = fitting if follow and most < MIN_COVER * fitting else min(most, fitting)
        starts = np.linspace(0, trajectory.steps - 1 - horizon, count).round().astype(np.intp)
        known: dict[Signal, BoolArray] = {
            signal: known_rows(signal, states[signal][starts]) for signal in self.state
        }
        known["commands"] = _all_finite(trajectory["commands"], starts, horizon)
        usable = np.asarray(np.logical_and.reduce(list(known.values())))
        steady = _all_finite(trajectory.steady_commands, starts, horizon)
        if usable.sum() < MIN_SEGMENTS:
            lacking = [signal for signal, steps in known.items() if steps.sum() < MIN_SEGMENTS]
            raise TrialRefusedError(
                f"{trial.path}: {self.name} needs {', '.join(lacking or self.state)} at "
                f"{MIN_SEGMENTS} or more of {count} moments of the trial, and the log does not "
                f"have it",
                "give a comparator that needs fewer signals, or leave this log out",
            )
        starts, steady, chains = starts[usable], steady[usable], 1
        if follow:
            rows, counted, chains = chained(len(starts), most, horizon * trajectory.timestep)
            starts, steady = starts[rows], steady[rows] & counted
        if steady.sum() < MIN_SEGMENTS:
            raise TrialRefusedError(
                f"{trial.path}: {self.name} needs {MIN_SEGMENTS} or more segments of {horizon} "
                f"steps in which none was late, and the log does not have them",
                "have the robot keep its control time step, or leave this log out",
            )
        return starts, steady, chains


def _all_finite(commands: FloatArray, starts: IndexArray, horizon: int) -> BoolArray:
    """Returns a mask of the segments whose commands are all finite, ``(segments,)``."""
    rows = np.maximum(command_steps(starts, horizon), 0)
    return np.asarray(np.isfinite(commands[rows]).all(axis=(1, 2)))


SEGMENT_PREDICTION = SegmentPrediction("segment-prediction")
SEGMENT_PREDICTION_ONBOARD = SegmentPrediction("segment-prediction-onboard", state=ONBOARD)
