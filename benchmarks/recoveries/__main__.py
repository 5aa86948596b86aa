"""``python -m benchmarks.recoveries``: runs recoveries, prints their ratios to the oracle."""

import argparse
from pathlib import Path

from benchmarks.recoveries.study import read_rows, study, write_rows
from benchmarks.recoveries.table import table
from selfmodel.settings import Settings


def main() -> None:
    """Runs a command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.recoveries", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    command = commands.add_parser("run", help="run recoveries in a folder, and write their rows")
    command.add_argument("folder", type=Path, help="folder; the rows are in its results.jsonl")
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
    command.add_argument("--oracles", type=Path, help="results.jsonl of benchmarks.rivals")
    command.set_defaults(run=_table)
    options = parser.parse_args()
    options.run(options)


def _run(options: argparse.Namespace) -> None:
    settings = Settings(steps=options.steps, generations=options.generations)
    wanted = study(
        options.folder,
        options.robots.split(","),
        [int(case) for case in options.cases.split(",")],
        [float(gap) for gap in options.gaps.split(",")],
        [int(seed) for seed in options.seeds.split(",")],
        repair=options.repair,
        settings=settings.scaled(options.population),
    )
    failed = wanted.run(workers=options.jobs, on_progress=print)
    print(write_rows(wanted))
    if failed:
        raise SystemExit("\n".join(f"{end.name} failed: {end.error}" for end in failed))


def _table(options: argparse.Namespace) -> None:
    oracles = read_rows(options.oracles) if options.oracles else []
    print(table(read_rows(options.rows), oracles))


if __name__ == "__main__":
    main()
