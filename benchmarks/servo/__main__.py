"""``python -m benchmarks.servo``: diagnoses of a servo's recordings by its healthy recordings.

The recordings are in ``../shared/samples/xl330-pendulum`` (see its README).
"""

import argparse
import json
import time
from itertools import product
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

TORQUE_OFF = {"lift_and_drop": 2.0}
"""Time at which the torque is switched off, s."""

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


def trial_of(robot: Robot, name: str, end: float | None = None) -> Trial:
    """Returns a recording, up to a time in s."""
    mapping = parse_mapping(MAPPING, "the mapping")
    found = import_recording(SAMPLE / f"{name}.csv", mapping, robot).trajectory
    rows = found.time < (end or float("inf"))
    return Trial.from_arrays(
        robot,
        found["joint_positions"][rows],
        found["commands"][rows],
        joint_velocities=found["joint_velocities"][rows],
        name=name,
    )


def main() -> None:
    """Diagnoses recordings by each healthy one, and by all others, and prints a row for each."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.servo", description=__doc__)
    groups = ("same", "gain", "off")
    parser.add_argument("--groups", choices=groups, nargs="*", default=groups)
    parser.add_argument("--healthy", choices=(*HEALTHY, "others"), nargs="*")
    options = parser.parse_args()
    robot = load_mjcf(PENDULUM, checked_settings({"control_timestep": 0.006}))
    healthy = {name: trial_of(robot, f"kp800_{name}", TORQUE_OFF.get(name)) for name in HEALTHY}
    changed = {
        "same": list(healthy.items()),
        "gain": [(name, trial_of(robot, f"kp400_{name}")) for name in HALF_GAIN],
        "off": [(name, trial_of(robot, f"kp800_{name}")) for name in TORQUE_OFF],
    }
    references = options.healthy or (*HEALTHY, "others")
    for group, reference in product(options.groups, references):
        for name, trial in changed[group]:
            others = [own for other, own in healthy.items() if other != name or group == "gain"]
            if group != "gain" and reference == name:
                continue
            start = time.process_time()
            found = diagnose(
                trial,
                healthy=others if reference == "others" else healthy[reference],
                robot=robot,
                seed=0,
                threads=1,
            )
            row = {
                "group": group,
                "healthy": reference,
                "trial": name,
                "best": str(found.best),
                "verdict": found.verdict,
                "alike": [str(one) for one in found.indistinguishable],
                "since": None if found.change is None else round(found.change.time, 2),
                "seconds": round(time.process_time() - start),
                "reason": found.doubt.reason if found.doubt else "",
            }
            print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()
