"""``python -m benchmarks.go1 COMMAND``: a Go1 under its policy, diagnosed and recovered.

The folder FILES has the files of others, see ``docs/results/policies.md``. A command appends a row
for each case to ROWS, and skips the cases that are there. The order of the cases is random, so the
rows of a command that was stopped are a random sample.
"""

import argparse
import random
from collections.abc import Iterator
from pathlib import Path

import selfmodel
from benchmarks.go1 import robots
from benchmarks.go1.robots import OTHERS, WALK, Go1
from benchmarks.go1.tables import table
from benchmarks.rows import add_rows, add_search, parsed, settings_of
from selfmodel import Diagnosis, Hypothesis, Robot, Settings
from selfmodel.studies.study import Row

SEEDS = {"diagnose": 3, "healthy": 20, "recover": 3}
CASES = {"diagnose": robots.faults, "healthy": robots.commands, "recover": robots.damages}
"""Physical robots of each command, and their cases."""


def main() -> None:
    """Runs a command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.go1", description=__doc__)
    commands = parser.add_subparsers(required=True, dest="command")
    for name, seeds in SEEDS.items():
        command = commands.add_parser(name)
        command.add_argument("files", type=Path, help="folder of the files of others")
        command.add_argument("--seeds", type=int, default=seeds, help="physical robots")
        command.add_argument("--cases", default="", help="only those whose name has this text")
        add_search(command)
        command.add_argument("--healthy", type=float, default=1.2, help="command of a log, m/s")
    given = parsed(parser, commands, table)
    settings = settings_of(given, robots.STEPS)
    robot = selfmodel.load_robot(given.files / robots.SCENE, robots.SETTINGS)

    def values_of(key: Row, work: Path) -> Row:
        go1 = Go1(given.files, work, key["seed"], robot)
        return (recovered if given.command == "recover" else diagnosed)(go1, key, settings)

    add_rows(given.rows, cases(robot, given), given.limit, values_of)


def cases(robot: Robot, given: argparse.Namespace) -> Iterator[Row]:
    """Yields what names each row of a command, in a random order."""
    healthy = {} if given.command == "recover" else {"healthy": given.healthy}
    rows = [
        {"command": given.command, "group": group, "truth": truth, "seed": seed, **healthy}
        for seed in range(given.seeds)
        for group, truth in CASES[given.command](robot, seed)
    ]
    random.Random(0).shuffle(rows)  # noqa: S311  # an order
    return (row for row in rows if given.cases in f"{row['group']} {row['truth']}")


def diagnosed(go1: Go1, key: Row, settings: Settings) -> Row:
    """Returns the diagnosis of a log by healthy logs of other commands."""
    before, truth, forward = go1.physical("intact", 0), key["truth"], (key["healthy"], 0.0, 0.0)
    healthy = [go1.logged(before, *one) for one in ((forward, "forward"), (robots.TURN, "turn"))]
    log = go1.logged(go1.physical(truth, 1), OTHERS.get(key["group"], WALK), "diagnosed")
    found = selfmodel.diagnose(
        log, healthy=healthy, robot=go1.robot, settings=settings, seed=go1.seed, threads=1
    )
    return {**_facts(found, truth, go1.robot), "displacement": round(log.displacement, 2)}


def recovered(go1: Go1, key: Row, settings: Settings) -> Row:
    """Returns the recovery of a robot by three trials, with the defaults."""
    found = selfmodel.recover(
        go1.physical("intact", 0),
        go1.physical(key["truth"], 1),
        go1.robot,
        go1.work / "run",
        gait=go1.policy(WALK),
        settings=settings,
        seed=go1.seed,
        threads=1,
    )
    before, unadapted, *scores = (round(value, 2) for value in found.scores)
    return {
        **_facts(found.diagnosis, key["truth"], go1.robot),
        "before": before,
        "unadapted": unadapted,
        "scores": scores,
        "expected": [round(mean, 2) for mean in found.robust_means[2:]],
        "falls": [fall is not None for fall in found.falls[2:]],
        "tried": [str(one) for one in found.tried[2:]],
    }


def _facts(found: Diagnosis, notation: str, robot: Robot) -> Row:
    truth = parts(selfmodel.parse_hypothesis(notation, robot))
    return {
        "first": parts(found.best) == truth,
        "answer": answer(found, truth),
        "best": str(found.best),
        "verdict": found.verdict,
        "alike": [str(one) for one in found.indistinguishable],
        "unsearched": [str(one) for one in found.unsearched.named] if found.unsearched else [],
        "since": found.change.time if found.change else None,
        "reason": found.doubt.reason if found.doubt else found.reason,
    }


def parts(one: Hypothesis) -> frozenset[tuple[str, str]]:
    """Returns kinds and parts; half the gain of a servo is half its torque, up to a limit."""
    pairs = one.without_severities
    return frozenset((kind.name.replace("servo-gain", "motor"), part) for kind, part in pairs)


def answer(found: Diagnosis, truth: frozenset[tuple[str, str]]) -> str:
    """Returns whether kinds and parts are right by the verdict, or how they are not."""
    if found.verdict == "not judged":
        return found.verdict
    if parts(found.best) == truth:
        return "right"
    if truth in map(parts, found.indistinguishable):
        return "among those alike"
    if found.unsearched and truth in map(parts, found.unsearched.named):
        return "right, of an unsearched kind"
    return "wrong" if found.best.faults else "missed"


if __name__ == "__main__":
    main()
