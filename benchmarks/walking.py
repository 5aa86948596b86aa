"""``python -m benchmarks.walking DIR``: how the gaits in a folder of ``selfmodel paper`` walk.

Prints displacement, torso height and contact depth of the healthy robots, at every physics step.
"""

import argparse
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import mujoco
import numpy as np

from selfmodel.controllers.controller import Controller, make_batch
from selfmodel.experiments.grid import finished
from selfmodel.experiments.study.gaits import FILE
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT
from selfmodel.logs import load_controller
from selfmodel.robot.robot import Robot
from selfmodel.robot.sensing import SensorReader
from selfmodel.tasks import ROBOTS


@dataclass(frozen=True)
class Walk:
    """Measures of a run of the healthy robot, over every physics step.

    Attributes:
        displacement: Forward displacement, m.
        lowest: Least height of the root body over its standing height.
        highest: Greatest height of the root body over its standing height.
        deepest: Deepest penetration of any contact, m.
    """

    displacement: float
    lowest: float
    highest: float
    deepest: float

    @property
    def is_walking(self) -> bool:
        """Whether the torso stays between the ground and twice its height, contacts shallow."""
        return self.lowest > 0 and self.highest < 2 and self.deepest <= 0.01


def walk(robot: Robot, controller: Controller, steps: int) -> Walk:
    """Returns the measures of a controller's walk on the healthy robot."""
    embodiment = build(robot, INTACT)
    model, data = embodiment.model, mujoco.MjData(embodiment.model)
    mujoco.mj_forward(model, data)
    senses = SensorReader(model, robot.anatomy, [embodiment])
    brain = make_batch([controller], [embodiment.silent_neurons], len(robot.anatomy.sensors))
    start, heights, deepest = data.qpos[0], [data.qpos[2]], 0.0
    for step in range(steps):
        senses.read(data.sensordata[np.newaxis], data.qpos[np.newaxis], brain.readings)
        brain.step(data.ctrl[np.newaxis])
        for _ in range(robot.substeps if step + 1 < steps else 0):
            mujoco.mj_step(model, data)
            heights.append(data.qpos[2])
            deepest = max(deepest, -data.contact.dist.min(initial=0.0))
    ratios = np.array(heights) / robot.standing_height
    return Walk(
        float(data.qpos[0] - start), float(ratios.min()), float(ratios.max()), float(deepest)
    )


def main() -> None:
    """Prints a table in Markdown, a row per robot."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="folder of `selfmodel paper --out`")
    folder = parser.parse_args().folder / "gaits"
    walks: dict[str, list[Walk]] = {}
    for gait in finished(folder):
        robot = ROBOTS[gait.parameters["robot"]].robot()
        controller = load_controller(gait.path.with_name(FILE))
        steps = gait.parameters["settings"]["steps"]
        walks.setdefault(robot.name, []).append(walk(robot, controller, steps))
    print("| robot | median m | lowest | highest | torso | deepest, mm | walking |")
    print("|---|---:|---:|---:|---|---:|---:|")
    for robot_name, found in walks.items():
        print(_row(robot_name, found))


def _row(robot: str, walks: list[Walk]) -> str:
    displacements = [one.displacement for one in walks]
    return (
        f"| {robot} | {median(displacements):.2f} | {min(displacements):.2f} "
        f"| {max(displacements):.2f} | {min(one.lowest for one in walks):.2f} to "
        f"{max(one.highest for one in walks):.2f} "
        f"| {1000 * max(one.deepest for one in walks):.1f} "
        f"| {sum(one.is_walking for one in walks)} of {len(walks)} |"
    )


if __name__ == "__main__":
    main()
