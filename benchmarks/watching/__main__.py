"""``python -m benchmarks.watching COMMAND``: watches of robots of the independent generator.

A command appends a row for each case to ROWS, and skips the cases that are there.
"""

import argparse
import time
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import selfmodel
from benchmarks.foreign.model import LEVELS
from benchmarks.rows import add_rows, parsed
from benchmarks.watching.monitors import METHODS
from benchmarks.watching.recordings import recordings, watched
from benchmarks.watching.rivals import compared
from benchmarks.watching.streams import AFTER, FAULTS, Machine, watch_of
from benchmarks.watching.tables import table
from selfmodel.studies.study import Row
from selfmodel.trials.trajectory import samples_of
from selfmodel.watching import Finding
from selfmodel.watching.finding import ENDS


def main() -> None:
    """Runs a command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.watching", description=__doc__)
    commands = parser.add_subparsers(required=True, dest="command")
    commands.add_parser("recordings", help="of real robots").set_defaults(limit=None)
    for name in ("healthy", "faults", "rivals"):
        command = commands.add_parser(name)
        command.add_argument("--robots", nargs="+", default=["quadruped"])
        command.add_argument("--gaps", nargs="+", choices=LEVELS, default=["moderate", "large"])
        command.add_argument("--seeds", type=int, nargs="+", default=[0], help="physical robots")
        command.add_argument("--limit", type=int, help="number of new rows")
    commands.choices["healthy"].add_argument("--minutes", type=float, default=10.0)
    commands.choices["healthy"].add_argument("--gaits", choices=("known", "new"), default="known")
    commands.choices["faults"].add_argument("--cases", nargs="+", default=[*FAULTS])
    commands.choices["faults"].add_argument("--draws", type=int, default=1, help="of each case")
    commands.choices["rivals"].add_argument("--methods", nargs="+", default=[*METHODS])
    given = parsed(parser, commands, table)
    if given.command == "recordings":
        found = recordings()
        keys = (one.key for one in found.values())
        add_rows(given.rows, keys, given.limit, lambda key, _work: watched(found[str(key)]))
        return
    values = {"healthy": healthy, "faults": faulty, "rivals": compared}[given.command]

    def values_of(key: Row, _work: Path) -> Row:
        machine = Machine(key["robot"], key["gap"], key["seed"])
        return values(machine, key)

    add_rows(given.rows, cases(given), given.limit, values_of)


def cases(given: argparse.Namespace) -> Iterator[Row]:
    """Yields what names each row of a command."""
    for seed, gap, name in product(given.seeds, given.gaps, given.robots):
        key = {"command": given.command, "robot": name, "gap": gap, "seed": seed}
        if given.command == "healthy":
            yield {**key, "gaits": given.gaits, "minutes": given.minutes}
        elif given.command == "rivals":
            yield from ({**key, "method": method} for method in given.methods)
        else:
            for draw, case in product(range(given.draws), given.cases):
                yield {**key, "case": case, "draw": draw}


def healthy(machine: Machine, key: Row) -> Row:
    """Returns the alarms in a stream of a healthy robot; after each that ends, it begins anew."""
    trial = machine.watched(key["gaits"], key["minutes"])
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
                causes.append(
                    " ".join([status, *(str(r.hypothesis) for r in finding.remaining[:1])])
                )
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
    notation, onset, trial = machine.failing(key["case"], key["draw"])
    watch, findings = watch_of(machine), list[Finding]()
    watch.restart()
    start = time.process_time()
    for step in samples_of(trial.trajectory):
        findings += watch.update(step)
    findings += watch.finish()
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


if __name__ == "__main__":
    main()
