"""``python -m benchmarks.recoveries``: runs recoveries and their oracles, prints the ratios."""

import argparse
from functools import partial
from pathlib import Path

from benchmarks.recoveries.cells import HEALTHY, Cell, cells, compute, read_rows
from benchmarks.recoveries.oracle import oracle
from benchmarks.recoveries.recover import recovered
from benchmarks.recoveries.table import table
from selfmodel.settings import Settings

ORACLE_GENERATIONS = 43
"""Generations with which a search of an oracle evaluates more than 6,000 controllers, and again as
many when it is continued."""


def main() -> None:
    """Runs a command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.recoveries", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    for name, run, text in (
        ("run", _run, "run recoveries, and append their rows to OUT/recoveries-REPAIR.jsonl"),
        ("oracle", _oracle, "run oracles, and append their rows to OUT/oracles.jsonl"),
    ):
        command = commands.add_parser(name, help=text)
        command.add_argument("out", type=Path, help="folder of the rows")
        command.add_argument("--robots", default="quadruped,hexapod")
        command.add_argument("--cases", default="0,1,2,4,6", help="0 is the healthy robot")
        command.add_argument("--gaps", default="0.1")
        command.add_argument("--seeds", default="0,1,2")
        command.add_argument("--repair", default="robust", help="robust or paper")
        command.add_argument("--population", type=int, default=100)
        command.add_argument("--generations", type=int)
        command.add_argument("--steps", type=int, default=1000)
        command.add_argument("--jobs", type=int, default=2, help="processes of one thread each")
        command.set_defaults(run=run)
    command = commands.add_parser("table", help="print the ratios by case")
    command.add_argument("out", type=Path, help="folder of the rows")
    command.add_argument("--repair", default="robust", help="robust or paper")
    command.set_defaults(run=_table)
    options = parser.parse_args()
    options.run(options)


def _run(options: argparse.Namespace) -> None:
    settings = _settings(options, 30)
    row_of = partial(recovered, repair=options.repair, settings=settings)
    wanted = [cell for cell in _cells(options) if cell.case != HEALTHY]
    path = options.out / f"recoveries-{options.repair}.jsonl"
    for row in compute(wanted, row_of, path, options.jobs):
        print(row, flush=True)


def _oracle(options: argparse.Namespace) -> None:
    row_of = partial(oracle, settings=_settings(options, ORACLE_GENERATIONS))
    path = options.out / "oracles.jsonl"
    for row in compute(_cells(options), row_of, path, options.jobs):
        print(row, flush=True)


def _table(options: argparse.Namespace) -> None:
    rows = read_rows(options.out / f"recoveries-{options.repair}.jsonl")
    print(table(rows, read_rows(options.out / "oracles.jsonl")))


def _cells(options: argparse.Namespace) -> list[Cell]:
    return cells(
        options.robots.split(","),
        [int(case) for case in options.cases.split(",")],
        [float(gap) for gap in options.gaps.split(",")],
        [int(seed) for seed in options.seeds.split(",")],
    )


def _settings(options: argparse.Namespace, generations: int) -> Settings:
    return Settings(steps=options.steps, generations=options.generations or generations).scaled(
        options.population
    )


if __name__ == "__main__":
    main()
