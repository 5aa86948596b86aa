"""Watches a simulated robot that breaks after 4 s, and prints what it says of it.

Usage: python examples/watch_a_robot.py HEALTHY.mcap [FAULT]

``selfmodel trial quadruped --controller cpg --gap 0.05 --steps 2400 --out HEALTHY.mcap`` writes the
log of a healthy robot.
"""

import sys
from itertools import chain, islice

import selfmodel
from selfmodel.controllers.playback import played_back

BROKEN, STEPS = 400, 1200
"""Control step at which the robot breaks, and number of all steps."""


def main(log: str, fault: str = "break:front_left_knee") -> None:
    """Prints the findings as they come."""
    healthy = selfmodel.read_log(log).trial
    robot = selfmodel.load_robot(healthy.robot)
    watch = selfmodel.Watch(robot, healthy)
    walk = played_back(robot.anatomy.motors, healthy.trajectory["commands"])
    before, after = (
        selfmodel.simulated_robot(robot, hypothesis, gap=0.05) for hypothesis in ("intact", fault)
    )
    # A simulated robot has its faults from the first step on, so a broken one takes over.
    walked, limped = before.run(walk, BROKEN), islice(after.run(walk, STEPS), BROKEN, None)
    for step in chain(walked, limped):
        for finding in watch.update(step):
            print(finding)


if __name__ == "__main__":
    main(*sys.argv[1:])
