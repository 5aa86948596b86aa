"""Mutates the input of every reader and checks what becomes of it: ``make fuzz``.

Each finding is kept in a folder with its files, its report and the command that repeats it. The
exit status is 1 if there is a finding. An interrupted campaign goes on with ``--first``.
"""

import argparse
import json
import math
import sys
from pathlib import Path
from time import monotonic

from tests.fuzz.campaign import Plan, run, work_folder
from tests.fuzz.targets import TARGETS


def main() -> int:
    """Runs a campaign, and prints the counts by target as JSON."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--count", type=int, default=100_000, help="cases of all targets")
    parser.add_argument("--seconds", type=float, default=math.inf, help="wall time to begin in")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of each target's first case")
    parser.add_argument("--only", action="append", choices=sorted(TARGETS), metavar="TARGET")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--failures", type=Path, default=Path("fuzz-failures"))
    given = parser.parse_args()
    plan = Plan(
        targets=[TARGETS[name] for name in given.only or TARGETS],
        seed=given.seed,
        first=given.first,
        count=given.count,
        seconds=given.seconds,
        processes=given.processes,
        failures=given.failures.resolve(),
    )
    start = monotonic()
    with work_folder() as work:
        tallies = run(plan, work, _show)
    findings = sum(tally.findings.total() for tally in tallies.values())
    report = {
        "cases": sum(tally.cases for tally in tallies.values()),
        "findings": findings,
        "seconds": monotonic() - start,
        "targets": {name: vars(tally) for name, tally in tallies.items()},
    }
    print(json.dumps(report, indent=1))
    return 1 if findings else 0


def _show(target: str, done: int) -> None:
    print(f"{target}: {done} cases", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
