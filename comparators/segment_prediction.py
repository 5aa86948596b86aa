"""From each of many logged states: how well are the next tenths of a second predicted?"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.comparators.arithmetic import command_errors, command_spans
from selfmodel.comparators.trembling import trembling_loss
from selfmodel.errors import InputError
from selfmodel.simulation.requests import Past, Segments
from selfmodel.trials.behaviour import Behaviour, Signal
from selfmodel.trials.signal_difference import difference
from selfmodel.trials.state_estimation import ONBOARD, STATE, estimated_states
from selfmodel.trials.trial import Trial

LEAD = 5
"""Commands from before a segment that a model with a control delay may need."""

FEWEST = 4
"""Segments without which nothing can be said."""

LOOKS = 4
"""How many times within a segment prediction and log are compared, the last at its end."""

SCALES: Mapping[Signal, float] = MappingProxyType(
    {
        "joint_positions": 0.1,
        "joint_velocities": 3.0,
        "base_position": 0.03,
        "base_orientation": 0.1,
        "base_linear_velocity": 0.3,
        "base_angular_velocity": 1.0,
        "sensors": 0.3,
        "commands": 0.05,
    }
)
"""By how much a prediction may be wrong until the error counts as large, in each signal's unit; of
commands, for the paper's range, and as much more or less as a motor's own is wider or narrower."""

CONTRADICTION = 3.0
"""How much more it counts that a sensor which is predicted never to switch does."""


@dataclass(frozen=True)
class SegmentPrediction:
    """How badly short stretches of the trial are predicted, each from a state that was logged.

    A trial is cut into segments. Each begins with the logged state, goes on under the logged
    commands, and is compared with the log several times on its way. An error e of a signal whose
    scale is s counts ``log(1 + (e / s)^2)``, so that a chaotic moment cannot outweigh the rest; it
    is averaged over the columns of a signal and summed over the signals. Beside the motion two
    things are judged: the readings, against what the controller received, and the controller's
    arithmetic, what it commanded against what its network makes of these readings.

    Source: prediction over a short horizon is multiple shooting (Bock & Plitt 1984) without the
    fit. Its use here answers the paper's future work, section V: displacement says too little.

    Limits: it needs the state, so encoders and the base's pose and velocity; ``segment-prediction-
    onboard`` does without the base's position and linear velocity, and carries them on from one
    segment to the next, which makes it less sharp. What acts slowly, such as a light wind, hardly
    shows within an eighth of a second. The network is taken to be known: without one (a recording
    of other software) its arithmetic is not judged. Nothing is judged across a step that was late
    (``Behaviour.late``): what a command does in an eighth of a second, it does not in a quarter.

    Attributes:
        name: What it is called.
        state: The signals that a segment begins with and that are predicted.
        horizon: Control steps of a segment.
        most: Segments at most; they lie evenly over the trial.
    """

    name: str
    state: tuple[Signal, ...] = STATE
    horizon: int = 12
    most: int = 80

    @property
    def screen(self) -> "SegmentPrediction":
        """The same, of a third of the segments."""
        return dataclasses.replace(self, most=max(self.most // 3, FEWEST))

    def request(self, trial: Trial) -> Segments:
        """Returns the segments, and that all of their state and the readings are looked at.

        Raises:
            InputError: The trial is too short, or was not observed well enough.
        """
        cut = _cut(self, trial)
        commands = trial.behaviour["commands"]
        rows = cut.starts[:, np.newaxis] + np.arange(-LEAD, self.horizon)
        return Segments(
            states={signal: cut.states[signal][cut.starts] for signal in self.state},
            commands=np.where(rows[..., np.newaxis] < 0, 0.0, commands[np.maximum(rows, 0)]),
            lead=LEAD,
            record=(*self.state, "sensors"),
            past=Past(commands, cut.starts),
        )

    def losses(self, simulated: Behaviour, trial: Trial) -> FloatArray:
        """Returns the loss of each segment in which no step was late, ``(n, segments)``."""
        cut = _cut(self, trial)
        looks = np.unique(np.linspace(0, self.horizon, LOOKS + 1).round().astype(int)[1:])
        rows = cut.starts[:, np.newaxis] + looks
        total = np.zeros(simulated["sensors"].shape[:2]) + cut.arithmetic
        for signal in self.state:
            logged, predicted = cut.states[signal][rows], simulated[signal][:, :, looks]
            error = difference(signal, predicted, logged) / SCALES[signal]
            total += _mean(np.log1p(np.square(error)))
        total += _readings(simulated["sensors"], trial.behaviour["sensors"], cut)
        return total if cut.steady.all() else np.ascontiguousarray(total[:, cut.steady])

    def distances(self, simulated: Behaviour, trial: Trial) -> FloatArray:
        """Returns the mean loss of the segments, ``(n,)``."""
        return np.asarray(self.losses(simulated, trial).mean(axis=1))


@dataclass(frozen=True, eq=False)
class _Cut:
    """What does not depend on the hypothesis: the state, the segments, the arithmetic's loss.

    Segments with a step that was late are predicted, for those after them may go on from their end,
    and are not judged: only the steady ones are.
    """

    states: Mapping[Signal, FloatArray]
    starts: IndexArray
    steady: BoolArray
    arithmetic: FloatArray


@lru_cache(maxsize=64)  # a trial is judged once a generation
def _cut(comparator: SegmentPrediction, trial: Trial) -> _Cut:
    behaviour, horizon = trial.behaviour, comparator.horizon
    states = estimated_states(behaviour, comparator.state)
    if behaviour.steps < FEWEST * horizon + 1:
        raise InputError(
            f"{trial.path}: {comparator.name} needs {FEWEST * horizon + 1} steps or more, "
            f"and the trial has {behaviour.steps}: leave this log out"
        )
    count = min(comparator.most, (behaviour.steps - 1) // horizon)
    starts = np.linspace(0, behaviour.steps - 1 - horizon, count).round().astype(np.intp)
    known: dict[Signal, BoolArray] = {
        signal: np.asarray(np.isfinite(states[signal][starts]).all(axis=1))
        for signal in comparator.state
    }
    known["commands"] = _known_all_along(behaviour["commands"], starts, horizon)
    usable = np.asarray(np.logical_and.reduce(list(known.values())))
    steady = _known_all_along(behaviour.steady_commands, starts, horizon)
    if np.sum(usable & steady) < FEWEST:
        if usable.sum() >= FEWEST:
            raise InputError(
                f"{trial.path}: {comparator.name} needs {FEWEST} or more stretches of {horizon} "
                f"steps in which none was late, and the log does not have them: have the robot "
                f"keep its control time step, or leave this log out"
            )
        lacking = [signal for signal, moments in known.items() if moments.sum() < FEWEST]
        raise InputError(
            f"{trial.path}: {comparator.name} needs {', '.join(lacking or comparator.state)} at "
            f"{FEWEST} or more of {count} moments of the trial, and the log does not have it: give "
            f"a comparator that needs less (docs/how-it-works.md lists what each needs), or leave "
            f"this log out"
        )
    starts, steady = starts[usable], steady[usable]
    wrong = command_errors(trial) / (SCALES["commands"] * command_spans(trial))
    rows = starts[:, np.newaxis] + np.arange(1, horizon + 1)
    return _Cut(states, starts, steady, _mean(np.log1p(np.square(wrong[rows]))))


def _known_all_along(commands: FloatArray, starts: IndexArray, horizon: int) -> BoolArray:
    rows = np.maximum(starts[:, np.newaxis] + np.arange(-LEAD, horizon), 0)
    return np.asarray(np.isfinite(commands[rows]).all(axis=(1, 2)))


def _readings(predicted: FloatArray, logged: FloatArray, cut: _Cut) -> FloatArray:
    """How badly the readings are predicted, ``(n, segments)``.

    The first row of a segment follows from the state alone: there an angle's reading is sure, and
    a touch is not, because millimetres decide. Only at the start of the trial the robot stands.
    How much a sensor trembles, only all segments together tell; it counts in each of them.
    """
    starts = cut.starts
    rows = starts[:, np.newaxis] + np.arange(predicted.shape[2])
    told = logged[rows]
    binary = np.isin(logged, (0.0, 1.0)) | np.isnan(logged)
    predicts_binary = np.isin(predicted, (0.0, 1.0)).all(axis=(1, 2))
    switches = np.asarray(binary.all(axis=0) & predicts_binary)
    never = np.asarray(switches & ~predicted.any(axis=(1, 2)))
    graded = np.log1p(np.square((predicted - told) / SCALES["sensors"]))
    switched = np.abs(predicted - told) * np.where(never, CONTRADICTION, 1.0)[:, None, None]
    switched[:, starts > 0, 0] = 0.0
    each = _mean(np.where(switches[:, None, None], switched, graded))
    noise = trembling_loss(predicted[:, cut.steady], told[cut.steady], ~switches)
    return each + noise[:, np.newaxis]


def _mean(values: FloatArray) -> FloatArray:
    """The mean over the last two axes of what was observed; 0 where nothing was."""
    known = np.isfinite(values)
    if known.all():
        return np.asarray(values.mean(axis=(-2, -1)))
    total = np.where(known, values, 0.0).sum(axis=(-2, -1))
    return np.asarray(total / np.maximum(known.sum(axis=(-2, -1)), 1))


SEGMENT_PREDICTION = SegmentPrediction("segment-prediction")
SEGMENT_PREDICTION_ONBOARD = SegmentPrediction("segment-prediction-onboard", state=ONBOARD)
