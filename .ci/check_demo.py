"""Checks that the newest run of ``make demo`` is the one that the README describes.

The same processor repeats the numbers; another one may round differently, and contacts are chaotic,
so that evolution finds other gaits there, as with another seed. Case 1 with the seeds 0 to 2 at a
gap of 0.1 walked 12.7 to 21.9 m, 2.6 to 3.7 m and 12.0 to 13.8 m, at most 0.29 of the first
displacement after the loss and at least 0.61 recovered (docs/results/data/recoveries-robust.jsonl).
"""

import json
import re
import sys
from pathlib import Path

from selfmodel.faults.notation import parse
from selfmodel.logs import read_log
from selfmodel.logs.robots import robot_of
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trajectory import forward_displacement

TOLERANCE, LOST, REGAINED = 1 / 2, 1 / 3, 1 / 2
"""In first displacements: of each number; most that may be left after the loss, and least that must
be recovered. Those seeds keep to all three."""

FINER = 4
"""Division of the physics time step at which the same gaits walk again."""


def main() -> None:
    """Exits with a sentence where the run and the README differ."""
    folder = max(Path("runs").glob("quadruped-*"), key=lambda path: path.stat().st_mtime)
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    before, after, *later = [trial["displacement"] for trial in result["trials"]]
    recovered = max(later)
    text = Path("README.md").read_text(encoding="utf-8")
    number = r"([\d.]+) m"
    walks = rf"walks {number} in ten seconds, {number} after the loss, and {number}"
    finer = rf"its first gait walks {number} and the recovered one {number}"
    numbers = re.search(rf"{walks}.*{finer}", text, re.DOTALL)
    if numbers is None:
        sys.exit("README.md: expected the displacements of the demo, and found none")
    stated = [float(number) for number in numbers.groups()]
    logs = sorted((folder / "trials").glob("*.mcap"))
    best = logs[2 + later.index(recovered)]
    again = (at_a_finer_step(logs[0], "intact"), at_a_finer_step(best, result["truth"]))
    for said, walked in zip(stated, (before, after, recovered, *again), strict=True):
        sys.stdout.write(f"README.md: {said} m; here {walked:.1f} m\n")
        if abs(said - walked) > TOLERANCE * stated[0]:
            sys.exit(f"README.md: the demo walks {said} m; here it walked {walked:.1f} m")
    if not (after < LOST * before and recovered >= REGAINED * before):
        walked = f"{before:.1f} m, {after:.1f} m after the loss and {recovered:.1f} m recovered"
        sys.exit(f"{folder}: expected a walk that is lost and regained, got {walked}")
    if not result["correct"]:
        sys.exit(f"{folder}: the diagnosis of the demo is wrong")


def at_a_finer_step(path: Path, notation: str) -> float:
    """Returns the displacement of a trial's gait at a quarter of the physics time step, m."""
    log = read_log(path)
    robot = robot_of(log)
    option = re.compile(r'timestep="([^"]+)"')
    mjcf = option.sub(lambda step: f'timestep="{float(step[1]) / FINER}"', robot.mjcf)
    fine = Robot(robot.name, mjcf, robot.control_timestep)
    if fine.substeps != FINER * robot.substeps:
        sys.exit(f"{path}: expected the physics time step in its MJCF, and did not find it")
    runs = [(parse(notation, fine.anatomy), log.trial.plan.controller)]
    result = Simulator(fine).run(runs, log.trial.plan.steps, ["base_position"])
    return float(forward_displacement(result.trajectory)[0])


if __name__ == "__main__":
    main()
