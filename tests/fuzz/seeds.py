"""Seeds of the campaign: small logs, bags and files, made by the code that is under test."""

from pathlib import Path

import numpy as np

from selfmodel.controllers.playback import Playback
from selfmodel.logs.records import Imported, TrialHeader
from selfmodel.logs.writer import write_trial
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.trial import TrialPlan
from tests.logs.conftest import MJCF, made_up, plan_of, timed
from tests.logs.rosbag.conftest import MAPPING, recorded

DATA = Path(__file__).parents[1] / "data" / "logs-0.1"
"""Small files of version 0.1, which are in the repository."""

SETTINGS = Settings(steps=12, trials=1, generations=2).scaled(4)


def biped() -> Robot:
    """Returns the robot of the seeds."""
    return Robot("biped", MJCF, 0.01)


def trial_log(path: Path, robot: Robot, steps: int, *, clock: bool = False) -> Path:
    """Writes the log of a made-up trial; with a clock, of the format 2."""
    samples = made_up(robot, steps)
    header = TrialHeader(SETTINGS, timed=clock, hidden="intact", gap='{"level": 0.1}')
    return write_trial(
        path, robot, plan_of(robot, steps), timed(samples) if clock else samples, header
    )


def playback_log(path: Path, robot: Robot, steps: int) -> Path:
    """Writes the log of an imported trial, whose controller is unknown."""
    samples = list(made_up(robot, steps))
    commands = np.array([sample.values["commands"] for sample in samples])
    plan = TrialPlan("imported", "single", Playback(robot.anatomy.motors, commands), steps, 0)
    header = TrialHeader(SETTINGS, imported=Imported({"clock": "log"}, MAPPING))
    return write_trial(path, robot, plan, iter(samples), header)


def recording(seconds: float) -> list[tuple[str, int, object]]:
    """Returns the messages of a short recording of the biped, in the order of time."""
    return sorted(recorded(seconds), key=lambda item: item[1])
