"""Checks the contracts of a comparator and a fault kind: here those of the other examples.

Usage:
  selfmodel trial quadruped --out intact.mcap
  python examples/check_plugins.py intact.mcap
"""

import sys

from gravity import GRAVITY
from heading_comparator import HEADING

from selfmodel.diagnosis.losses import simulate
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.logs import read_log
from selfmodel.logs.robots import common_robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.testing import check_comparator, check_fault_kind, shown

log = read_log(sys.argv[1])
robot, trial = common_robot([log]), log.trial
prepared = HEADING.prepare(trial)
broken = parse("break:front_left_knee", robot.anatomy)

# First a simulation that reproduces the trial, whose distance must be 0; then real simulations.
check_comparator(HEADING, trial, shown(prepared.request, trial))
simulated = simulate(Simulator(robot, threads=2), prepared.request, trial, [INTACT, broken])
check_comparator(HEADING, trial, simulated.trajectory)
print(f"{HEADING.name}: {prepared.losses(simulated.trajectory).mean(axis=1)}")

check_fault_kind(GRAVITY, robot)
print(f"{GRAVITY.name}: {len(GRAVITY.candidates(robot.anatomy))} faults that may be proposed")
