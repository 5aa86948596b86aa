"""``python -m benchmarks.other_engine``: recoveries and recordings of robots in PyBullet.

It needs PyBullet: ``pip install --group other-engine``.
"""

import argparse
import json
from pathlib import Path

from benchmarks.rows import read_rows, settings_of
from selfmodel.errors import InputError
from selfmodel.settings import Settings
from selfmodel.tasks import ROBOTS


def main() -> None:
    """Runs a command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.other_engine", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    paper, add = Settings(), commands.add_parser
    recover = add("recover", help="run a recovery, and print it as a JSON line")
    recover.add_argument("robot", choices=tuple(ROBOTS))
    recover.add_argument("--case", type=int, required=True, choices=range(1, 10), help="of Table I")
    recover.add_argument("--seed", type=int, default=0, help="of the physical robot and all else")
    recover.add_argument("--out", type=Path, required=True, help="folder of the run, new or empty")
    recover.add_argument("--trials", type=int, default=paper.trials, help="after the failing one")
    recover.add_argument("--steps", type=int, default=paper.steps, help="control steps of a trial")
    recover.add_argument("--population", type=int, default=paper.population)
    recover.add_argument("--generations", type=int, default=paper.generations)
    recover.add_argument("--design", default="network", help="of the controllers")
    recover.add_argument("--threads", type=int, default=0, help="0 for all processors")
    add("table", help="print the table of some recoveries").add_argument(
        "rows", type=Path, nargs="+", help="files of the lines of recover"
    )
    transfer = add("transfer", help="walk given gaits in both engines")
    transfer.add_argument("robot", choices=tuple(ROBOTS))
    transfer.add_argument("gaits", type=Path, nargs="+", help="files of controllers")
    transfer.add_argument("--seeds", type=int, default=3, help="number of robots in PyBullet")
    record = add("record", help="write recordings of an A1, for `benchmarks.foreign score`")
    record.add_argument("out", type=Path, help="folder of the recordings")
    record.add_argument("--cases", nargs="*", help="names [all]")
    record.add_argument("--seeds", type=int, nargs="*", default=[0])
    record.add_argument("--own-gait", action="store_true", help="another than healthy trials")
    options = parser.parse_args()
    try:
        _run(options)
    except ModuleNotFoundError as error:
        if error.name != "pybullet":
            raise
        raise SystemExit("error: PyBullet is missing: pip install --group other-engine") from error
    except InputError as error:
        raise SystemExit(f"error: {error}") from error


def _run(options: argparse.Namespace) -> None:
    # Here, so that --help needs no PyBullet.
    from benchmarks.other_engine import recordings, recovery  # noqa: PLC0415  # see above

    match options.command:
        case "recover":
            row = recovery.recovered(
                options.robot,
                options.case,
                options.seed,
                options.out,
                settings=settings_of(options, options.steps),
                design=options.design,
                threads=options.threads,
            )
            print(json.dumps(row), flush=True)
        case "table":
            print(recovery.table([row for path in options.rows for row in read_rows(path)]))
        case "transfer":
            robot = ROBOTS[options.robot].robot()
            for line in recovery.transfer_lines(robot, options.gaits, range(options.seeds)):
                print(line, flush=True)
        case "record":
            for seed in options.seeds:
                for case in options.cases or recordings.RECORDED:
                    own = options.own_gait
                    print(recordings.record(options.out, case, seed, own_gait=own), flush=True)


if __name__ == "__main__":
    main()
