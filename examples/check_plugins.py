"""Do a comparator and a kind of your own keep their contracts? Here those of the other examples.

Usage:
  selfmodel trial quadruped --out intact.mcap
  python examples/check_plugins.py intact.mcap
"""

import sys

from heading_comparator import HEADING
from payload import PAYLOAD

from selfmodel.diagnosis.comparator_contract import check_comparator, shown
from selfmodel.diagnosis.evidence import simulate
from selfmodel.diagnosis.kind_contract import check_kind
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.logs import read_log
from selfmodel.logs.robots import common_robot
from selfmodel.simulation.simulator import Simulator

log = read_log(sys.argv[1])
robot, trial = common_robot([log]), log.trial
request = HEADING.request(trial)
broken = parse("break:front_left_knee", robot.anatomy)

# First what the trial itself shows, which must be at 0; then what is to be judged beside it.
check_comparator(HEADING, trial, shown(request, trial))
simulated = simulate(Simulator(robot, threads=2), request, trial, [INTACT, broken])
check_comparator(HEADING, trial, simulated.behaviour)
print(f"{HEADING.name}: {HEADING.distances(simulated.behaviour, trial)}")

check_kind(PAYLOAD, robot)
print(f"{PAYLOAD.name}: {len(PAYLOAD.candidates(robot.anatomy))} faults that may be proposed")
