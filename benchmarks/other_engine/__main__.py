"""``python -m benchmarks.other_engine``: recoveries of robots in PyBullet, and their table.

All but the table needs PyBullet: ``pip install --group other-engine``.
"""

import argparse
import json
from pathlib import Path

from selfmodel.errors import InputError
from selfmodel.settings import Settings
from selfmodel.tasks import ROBOTS


def main() -> None:
    """Runs a command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.other_engine", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    _add_recover(commands.add_parser("recover", help="run a recovery, and print it as a JSON line"))
    _add_table(commands.add_parser("table", help="print the table of some recoveries"))
    _add_transfer(commands.add_parser("transfer", help="walk given gaits in both engines"))
    options = parser.parse_args()
    try:
        options.run(options)
    except ModuleNotFoundError as error:
        if error.name != "pybullet":
            raise
        raise SystemExit("error: PyBullet is missing: pip install --group other-engine") from error
    except InputError as error:
        raise SystemExit(f"error: {error}") from error


def _add_recover(parser: argparse.ArgumentParser) -> None:
    paper = Settings()
    parser.add_argument("robot", choices=tuple(ROBOTS))
    parser.add_argument("--case", type=int, required=True, choices=range(1, 10), help="of Table I")
    parser.add_argument("--seed", type=int, default=0, help="of the physical robot and all else")
    parser.add_argument("--out", type=Path, required=True, help="folder of the run, new or empty")
    parser.add_argument("--trials", type=int, default=paper.trials, help="after the failing one")
    parser.add_argument("--steps", type=int, default=paper.steps, help="control steps of a trial")
    parser.add_argument("--population", type=int, default=paper.population)
    parser.add_argument("--generations", type=int, default=paper.generations)
    parser.add_argument("--threads", type=int, default=0, help="0 for all processors")
    parser.set_defaults(run=_recover)


def _add_table(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("rows", type=Path, nargs="+", help="files of the lines of recover")
    parser.set_defaults(run=_table)


def _add_transfer(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("robot", choices=tuple(ROBOTS))
    parser.add_argument("gaits", type=Path, nargs="+", help="files of controllers")
    parser.add_argument("--seeds", type=int, default=3, help="number of robots in PyBullet")
    parser.set_defaults(run=_transfer)


def _recover(options: argparse.Namespace) -> None:
    # Here, so that --help and table need no PyBullet.
    from benchmarks.other_engine.recovery import Plan, recovered  # noqa: PLC0415  # see above

    settings = Settings(
        steps=options.steps, trials=options.trials, generations=options.generations
    ).scaled(options.population)
    plan = Plan(options.robot, options.case, options.seed, settings, options.threads)
    print(json.dumps(recovered(plan, options.out)), flush=True)


def _table(options: argparse.Namespace) -> None:
    # Here, so that --help answers at once.
    from benchmarks.other_engine.table import read_rows, table  # noqa: PLC0415  # see above

    print(table(read_rows(options.rows)))


def _transfer(options: argparse.Namespace) -> None:
    # Here, so that --help and table need no PyBullet.
    from benchmarks.other_engine.transfer import transfer_lines  # noqa: PLC0415  # see above

    robot = ROBOTS[options.robot].robot()
    for line in transfer_lines(robot, options.gaits, range(options.seeds)):
        print(line, flush=True)


if __name__ == "__main__":
    main()
