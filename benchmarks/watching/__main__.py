"""``python -m benchmarks.watching COMMAND``: watches of robots of the independent generator.

A command appends a row for each case to ROWS, and skips the cases that are there.
"""

import argparse
import time
from collections.abc import Iterator
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np

import selfmodel
from benchmarks.foreign.cases import Fault, stream
from benchmarks.foreign.model import LEVELS
from benchmarks.foreign.robots import robot
from benchmarks.foreign.scoring import add_rows, read_rows
from benchmarks.watching.streams import NEW, Machine
from benchmarks.watching.tables import table
from selfmodel import Watch
from selfmodel.studies.study import Row
from selfmodel.trials.trajectory import samples_of
from selfmodel.watching import Finding
from selfmodel.watching.finding import ENDS

HEALTHY, HEALTHY_PERIOD = 80.0, 10.0
"""Length of each of the two healthy trials, and time of a gait in them, s."""

PERIOD = 30.0
"""Time of a gait in a stream that is watched, s."""

ONSETS, AFTER = (8.0, 14.0), 8.0
"""Range of the onset of a fault, and time of the stream after it, s."""

FAULTS = ("break", "jam", "sensor", "motor")


def main() -> None:
    """Runs a command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.watching", description=__doc__)
    commands = parser.add_subparsers(required=True, dest="command")
    for name in ("healthy", "faults"):
        command = commands.add_parser(name)
        command.add_argument("--robots", nargs="+", default=["quadruped"])
        command.add_argument("--gaps", nargs="+", choices=LEVELS, default=["moderate", "large"])
        command.add_argument("--seeds", type=int, nargs="+", default=[0], help="physical robots")
        command.add_argument("--limit", type=int, help="number of new rows")
    commands.choices["healthy"].add_argument("--minutes", type=float, default=10.0)
    commands.choices["healthy"].add_argument("--gaits", choices=("known", "new"), default="known")
    commands.choices["faults"].add_argument("--cases", nargs="+", default=[*FAULTS])
    commands.choices["faults"].add_argument("--draws", type=int, default=1, help="of each case")
    commands.add_parser("table", help="print tables of the rows")
    for command in commands.choices.values():
        command.add_argument("rows", type=Path, help="file of the rows, JSON lines")
    given = parser.parse_args()
    if given.command == "table":
        print(table(read_rows(given.rows)))
        return

    def values_of(key: Row, _work: Path) -> Row:
        machine = Machine(key["robot"], key["gap"], key["seed"])
        return (healthy if given.command == "healthy" else faulty)(machine, key)

    add_rows(given.rows, cases(given), given.limit, values_of)


def cases(given: argparse.Namespace) -> Iterator[Row]:
    """Yields what names each row of a command."""
    for seed, gap, name in product(given.seeds, given.gaps, given.robots):
        key = {"command": given.command, "robot": name, "gap": gap, "seed": seed}
        if given.command == "healthy":
            yield {**key, "gaits": given.gaits, "minutes": given.minutes}
        else:
            for draw, case in product(range(given.draws), given.cases):
                yield {**key, "case": case, "draw": draw}


@cache
def watch_of(machine: Machine) -> Watch:
    """Returns the watch of a physical robot, by two healthy trials in all its gaits."""
    trials = [machine.trial(f"healthy-{k}", HEALTHY, HEALTHY_PERIOD) for k in range(2)]
    return Watch(machine.robot, trials)


def healthy(machine: Machine, key: Row) -> Row:
    """Returns the alarms in a stream of a healthy robot; after each that ends, it begins anew."""
    seed = machine.seed + NEW if key["gaits"] == "new" else machine.seed
    name, duration = f"watched-{key['gaits']}", 60 * key["minutes"]
    trial = machine.trial(name, duration, PERIOD, gaits_of=seed)
    watch, judged, status = watch_of(machine), 0, "not judged"
    alarms, causes = list[list[float | str]](), list[str]()
    watch.restart()
    start = time.process_time()
    for step in samples_of(trial.trajectory):
        for finding in watch.update(step):
            if finding.status == "changed" and status != "changed":
                alarms.append([step.time, *finding.shown_by])
            status = finding.status
            if status in ENDS:
                causes.append(f"{status} {finding.remaining[0].hypothesis}")
                watch.restart()
        judged += status == "watching"
    return {
        "alarms": alarms,
        "causes": causes,
        "judged": round(judged * machine.model.control_timestep, 2),
        "seconds": round(time.process_time() - start, 2),
    }


def faulty(machine: Machine, key: Row) -> Row:
    """Returns what the watch of a robot says that fails at an onset."""
    rng = stream(machine.seed, machine.robot, key["case"], str(key["draw"]))
    fault, notation = drawn(machine.robot, key["case"], rng)
    onset = round(float(rng.uniform(*ONSETS)), 2)
    trial = machine.trial(
        f"{key['case']}-{key['draw']}", onset + AFTER, 10.0, faults=(fault,), onset=onset
    )
    watch, findings = watch_of(machine), list[Finding]()
    watch.restart()
    start = time.process_time()
    for step in samples_of(trial.trajectory):
        findings += watch.update(step)
    seconds = time.process_time() - start
    alarm = next((one for one in findings if one.status == "changed"), None)
    last = findings[-1]
    truth = selfmodel.parse_hypothesis(notation, machine.robot).without_severities
    named = [str(rated.hypothesis) for rated in last.remaining]
    return {
        "truth": notation,
        "onset": onset,
        "alarm": alarm and alarm.time,
        "dated": alarm and [alarm.onset, alarm.earliest, alarm.latest],
        "status": last.status,
        "ended": last.time,
        "named": named,
        "right": bool(named) and last.remaining[0].hypothesis.without_severities == truth,
        "seconds": round(seconds, 2),
        "watched": onset + AFTER,
    }


def drawn(name: str, case: str, rng: np.random.Generator) -> tuple[Fault, str]:
    """Returns the fault of a case at a random part, and its notation; a jam is where it is."""
    machine = robot(name)
    if case == "sensor":
        part = str(rng.choice(list(machine.touches)))
        return Fault("dead-sensor", part), f"sensor:{part}"
    part = str(rng.choice([part.name for part in machine.parts if len(part.hinges) == 1]))
    if case == "break":
        return Fault("lost", part), f"break:{part}"
    if case == "jam":
        return Fault("jam", part, float("nan")), f"jam:{part}"
    return Fault("motor", part, 0.5), f"motor:{part}=0.5"


if __name__ == "__main__":
    main()
