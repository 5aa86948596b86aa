"""Made-up gaits for the tests of comparators: legs that swing in a rhythm, each in its phase."""

import numpy as np

from selfmodel.controllers.playback import Playback
from selfmodel.trials.signals import SIGNALS, Names, Signal
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial, TrialPlan

LEGS = 4
NAMES = Names(
    sensors=tuple(f"touch_{leg}" for leg in range(LEGS)),
    motors=tuple(f"motor_{leg}" for leg in range(LEGS)),
    hinges=tuple(f"hinge_{leg}" for leg in range(LEGS)),
)
WALK = (0.0, 0.25, 0.5, 0.75)
TROT = (0.0, 0.5, 0.5, 0.0)


def gait(
    phases: tuple[float, ...] = WALK,
    *,
    frequency: float = 1.5,
    duty: float = 0.6,
    swing: float = 0.4,
    late: float = 0.0,
    steps: int = 1000,
) -> Trajectory:
    """One run of a robot that walks straight on, its strides beginning ``late`` seconds late."""
    time = np.arange(steps) * 0.01
    cycle = (time[:, np.newaxis] + 10 - late) * frequency + phases
    base = np.zeros((steps, 3))
    base[:, 0] = 0.3 * time
    signals: dict[Signal, np.ndarray] = {
        signal: np.zeros((steps, NAMES.width(signal))) for signal in SIGNALS
    }
    signals["sensors"] = (cycle % 1 < duty).astype(float)
    signals["joint_positions"] = swing * np.sin(2 * np.pi * cycle)
    signals["base_position"] = base
    signals["base_orientation"] = np.tile([1.0, 0, 0, 0], (steps, 1))
    signals["base_linear_velocity"] = np.tile([0.3, 0, 0], (steps, 1))
    return Trajectory(NAMES, time, signals)


def batch(*runs: Trajectory) -> Trajectory:
    """The runs as a simulator gives them, ``(n, steps, width)``."""
    signals = {signal: np.stack([run[signal] for run in runs]) for signal in runs[0].signals}
    return Trajectory(runs[0].names, runs[0].time, signals)


def changed(run: Trajectory, **signals: np.ndarray) -> Trajectory:
    """The run with other values of some signals."""
    return run.with_signals(signals)


def logged(run: Trajectory) -> Trial:
    """The trial whose log shows that run."""
    driver = Playback(run.names.motors, np.zeros((run.steps, len(run.names.motors))))
    return Trial(
        TrialPlan("made-up", "after", driver, run.steps, 0), "made-up", run, "made-up.mcap"
    )
