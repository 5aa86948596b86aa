"""``python -m benchmarks.hexapod COMMAND``: a hexapod in PyBullet walks, fails, and walks again.

A command appends a row for each case to ROWS, and skips the cases that are there. FOLDER keeps the
first gaits, which are evolved once. It needs PyBullet: ``pip install --group other-engine``.
"""

import argparse
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from itertools import product
from pathlib import Path

from benchmarks.hexapod.robots import CASES, GAIN, MODELS, STEPS
from benchmarks.hexapod.tables import table
from benchmarks.rows import add_rows, add_search, parsed, settings_of
from selfmodel import Settings
from selfmodel.studies.study import Row


def main() -> None:
    """Runs a command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.hexapod", description=__doc__)
    commands = parser.add_subparsers(required=True, dest="command")
    for name in ("walk", "diagnose", "recover"):
        command = commands.add_parser(name)
        command.add_argument("folder", type=Path, help="folder of the first gaits")
        command.add_argument("--models", nargs="+", choices=MODELS, default=["import", "stiff"])
        command.add_argument("--gains", nargs="+", type=float, default=[GAIN], help="of the motors")
        command.add_argument("--seeds", type=int, nargs="+", default=[0], help="physical robots")
        command.add_argument("--gaits", type=int, nargs="+", help="seeds; those of the robots")
        command.add_argument("--cases", default="", help="only those whose name has this text")
        command.add_argument("--score", default="upright", help="of gaits")
        command.add_argument("--design", default="network", help="of gaits")
        command.add_argument("--repair", default="robust", help="of recoveries")
        command.add_argument("--trials", type=int, default=Settings.trials, help="of recoveries")
        add_search(command)
    given = parsed(parser, commands, table)
    # Here, so that --help and the tables need no PyBullet.
    from benchmarks.hexapod import trials  # noqa: PLC0415  # see above

    run: Mapping[str, Callable[[trials.Bench, Row, Path], Row]] = {
        "walk": trials.walked,
        "diagnose": trials.diagnosed,
        "recover": trials.recovered,
    }
    settings = settings_of(given, STEPS)
    bench = trials.Bench(given.folder, settings, given.score, given.design, given.repair)
    add_rows(given.rows, cases(given), given.limit, partial(run[given.command], bench))


def cases(given: argparse.Namespace) -> Iterator[Row]:
    """Yields what names each row of a command."""
    failed = [{"group": group, "legs": legs} for group in CASES for legs in CASES[group]]
    if given.command == "walk":
        failed = [{"group": "intact", "legs": "intact"}]
    names = ("design", "score", "population", "generations", "repair", "trials")
    search = {name: getattr(given, name) for name in names}
    robots = [(seed, gait) for seed in given.seeds for gait in given.gaits or [seed]]
    for robot, model, gain, case in product(robots, given.models, given.gains, failed):
        if given.cases in f"{case['group']} {case['legs']}":
            own = {"command": given.command, "model": model, "gain": gain}
            yield {**own, "seed": robot[0], "gait": robot[1], **case, **search}


if __name__ == "__main__":
    main()
