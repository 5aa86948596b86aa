"""Seeds of the campaign: small logs, bags and files, made by the code that is under test."""

from pathlib import Path

import numpy as np

from selfmodel.controllers.playback import Playback
from selfmodel.logs.records import Imported, TrialHeader
from selfmodel.logs.writing.writer import write_trial
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.trial import TrialPlan
from tests.logs.conftest import MJCF, made_up, plan_of, timed
from tests.logs.recordings.conftest import JOINTS, MAPPING, angle, recorded
from tests.logs.recordings.rosbag.bags import T0, Item, made, pose_stamped, trajectory

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


OTHER_MAPPING = (
    MAPPING.replace('topic = "/commands"', 'topic = "/trajectory"')
    .replace('order = ["RHY", "RHX", "LHY", "LHX"]\n', "")
    .replace('topic = "/odom"', 'topic = "/pose"')
    + '[touch.right_touch]\ntopic = "/right_foot"\n'
)
"""Mapping of the other topics of ``recording``: messages of other types."""


def recording(seconds: float) -> list[Item]:
    """Returns the messages of a short recording of the biped, in the order of time."""
    items = recorded(seconds)
    for k in range(round(seconds * 100)):
        stamp = T0 + k * 10**7
        at = [angle(joint, k / 100) for joint in range(4)]
        items.append(("/trajectory", stamp, trajectory(stamp, JOINTS, at)))
        items.append(("/pose", stamp, pose_stamped(stamp, (k / 100, 0, 0.5), (1, 0, 0, 0))))
        items.append(("/right_foot", stamp, made("std_msgs/msg/Float32", data=float(k % 9))))
    return sorted(items, key=lambda item: item[1])
