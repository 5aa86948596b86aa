"""``python -m benchmarks.recoveries``: runs recoveries, prints their ratios to the oracle."""

import argparse
from functools import partial
from pathlib import Path

from benchmarks.recoveries.cells import cells, compute, read_rows
from benchmarks.recoveries.recover import recovered
from benchmarks.recoveries.table import table
from selfmodel.settings import Settings


def main() -> None:
    """Runs a command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.recoveries", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    command = commands.add_parser("run", help="run recoveries, and append their rows to a file")
    command.add_argument("rows", type=Path, help="file of the rows, ROWS.jsonl")
    command.add_argument("--robots", default="quadruped,hexapod")
    command.add_argument("--cases", default="1,2,4,6")
    command.add_argument("--gaps", default="0.1")
    command.add_argument("--seeds", default="0,1,2")
    command.add_argument("--repair", default="robust", help="robust or paper")
    command.add_argument("--population", type=int, default=100)
    command.add_argument("--generations", type=int, default=30)
    command.add_argument("--steps", type=int, default=1000)
    command.add_argument("--jobs", type=int, default=2, help="processes of one thread each")
    command.set_defaults(run=_run)
    command = commands.add_parser("table", help="print the ratios by case")
    command.add_argument("rows", type=Path, help="file of the rows")
    command.add_argument("--oracles", type=Path, help="results.jsonl of `selfmodel baseline`")
    command.set_defaults(run=_table)
    options = parser.parse_args()
    options.run(options)


def _run(options: argparse.Namespace) -> None:
    settings = Settings(steps=options.steps, generations=options.generations)
    row_of = partial(recovered, repair=options.repair, settings=settings.scaled(options.population))
    wanted = cells(
        options.robots.split(","),
        [int(case) for case in options.cases.split(",")],
        [float(gap) for gap in options.gaps.split(",")],
        [int(seed) for seed in options.seeds.split(",")],
    )
    for row in compute(wanted, row_of, options.rows, options.jobs):
        print(row, flush=True)


def _table(options: argparse.Namespace) -> None:
    oracles = read_rows(options.oracles) if options.oracles else []
    print(table(read_rows(options.rows), oracles))


if __name__ == "__main__":
    main()
