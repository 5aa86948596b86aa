"""``python -m benchmarks.servo``: diagnoses of a servo's recordings by its healthy recordings.

The recordings are in ``../shared/samples/xl330-pendulum`` (see its README).
"""

import argparse
import json
import time
from itertools import permutations, product
from pathlib import Path

from selfmodel import Trial, diagnose
from selfmodel.logs.recordings.importer import import_recording
from selfmodel.logs.recordings.mapping_file import parse_mapping
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.mjcf.settings import checked_settings
from selfmodel.robot.robot import Robot

SAMPLE = Path(__file__).parents[3] / "shared" / "samples" / "xl330-pendulum"
PENDULUM = Path(__file__).parent / "pendulum.xml"

HEALTHY = ("sin_sin", "up_and_down", "sin_time_square", "lift_and_drop")
HALF_GAIN = ("sin_sin", "up_and_down")
"""Movements with the firmware's gain 800, and with 400."""

TORQUE_OFF = 2.0
"""Time of ``lift_and_drop`` at which the torque is switched off, s."""

MAPPING = """
robot = "pendulum.xml"
control_timestep = 0.006
[time]
column = "time"
unit = "s"
[joints]
unit = "rad"
[joints.names]
servo = "position"
[joints.velocities]
servo = "velocity"
[commands]
unit = "rad"
[commands.names]
servo = "goal"
"""


def trial_of(robot: Robot, name: str, end: float = float("inf")) -> Trial:
    """Returns a recording, up to a time in s."""
    mapping = parse_mapping(MAPPING, "the mapping")
    found = import_recording(SAMPLE / f"{name}.csv", mapping, robot).trajectory
    rows = found.time < end
    return Trial.from_arrays(
        robot,
        found["joint_positions"][rows],
        found["commands"][rows],
        joint_velocities=found["joint_velocities"][rows],
        name=name,
    )


def main() -> None:
    """Diagnoses recordings by each healthy one, and prints a row for each pair."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.servo", description=__doc__)
    groups = ("same", "gain", "off")
    parser.add_argument("--groups", choices=groups, nargs="*", default=groups)
    parser.add_argument("--kinds", default="default", help="fault kinds to search")
    options = parser.parse_args()
    robot = load_mjcf(PENDULUM, checked_settings({"control_timestep": 0.006}))
    healthy = {name: trial_of(robot, f"kp800_{name}", TORQUE_OFF if name == "lift_and_drop" else 99) for name in HEALTHY}
    pairs = {
        "same": [(one, other, healthy[other]) for one, other in permutations(HEALTHY, 2)],
        "gain": [
            (one, f"kp400_{other}", trial_of(robot, f"kp400_{other}"))
            for one, other in product(HEALTHY, HALF_GAIN)
        ],
        "off": [
            (one, "lift_and_drop", trial_of(robot, "kp800_lift_and_drop")) for one in HEALTHY
        ],
    }
    for group in options.groups:
        for one, name, trial in pairs[group]:
            start = time.process_time()
            found = diagnose(
                trial, healthy=healthy[one], robot=robot, kinds=options.kinds, seed=0, threads=1
            )
            row = {
                "group": group,
                "healthy": one,
                "trial": name,
                "best": str(found.best),
                "verdict": found.verdict,
                "since": None if found.change is None else round(found.change.time, 2),
                "seconds": round(time.process_time() - start),
                "loss": round(found.fit.loss,4) if found.fit else None,"intact": round(found.fit.intact_loss,4) if found.fit else None,"h": round(found.fit.healthy_loss,4) if found.fit else None,
                "reason": found.doubt.reason if found.doubt else "",
            }
            print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()
