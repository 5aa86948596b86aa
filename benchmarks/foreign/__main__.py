"""``python -m benchmarks.foreign``: makes recordings, scores their diagnoses, prints rates."""

import argparse
import itertools
import multiprocessing
from collections.abc import Iterable
from functools import partial
from pathlib import Path

from benchmarks.foreign.cases import CASES, GROUPS
from benchmarks.foreign.generate import Plan, generate
from benchmarks.foreign.robots import NAMES
from benchmarks.foreign.scoring.csv_rows import write_csv
from benchmarks.foreign.scoring.judge import summary
from benchmarks.foreign.scoring.questions import QUESTIONS, Question
from benchmarks.foreign.scoring.rates import table
from benchmarks.foreign.scoring.score import read_rows, score
from benchmarks.foreign.world.gap import LEVELS


def main() -> None:
    """Runs a command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.foreign", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    _add_generate(commands.add_parser("generate", help="write recordings"))
    _add_score(commands.add_parser("score", help="diagnose recordings, and append the answers"))
    _add_table(commands.add_parser("table", help="print the rates of right answers"))
    options = parser.parse_args()
    options.run(options)


def _add_generate(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("out", type=Path, help="folder of the recordings")
    parser.add_argument("--robots", default="quadruped,hexapod", help=", ".join(NAMES))
    parser.add_argument("--cases", default="all", help="all, or names of cases or groups")
    parser.add_argument("--seeds", default="0", help="such as 0 or 0-4")
    parser.add_argument("--gaps", default="large", help=", ".join(LEVELS))
    parser.add_argument("--trials", type=int, help="with the faults, 1 to 3 [those of the group]")
    parser.add_argument("--duration", type=float, default=10.0, help="of each trial, s")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.set_defaults(run=_generate)


def _add_score(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("out", type=Path, help="folder of the recordings")
    parser.add_argument("--rows", type=Path, help="file of the rows [OUT/scores.jsonl]")
    parser.add_argument("--kinds", help="those of `selfmodel diagnose` [those of the group]")
    parser.add_argument("--trials", type=int, help="with the faults, 1 to 3 [those of the group]")
    parser.add_argument("--options", default="", help="further options of `selfmodel diagnose`")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.set_defaults(run=_score)


def _add_table(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("rows", type=Path, help="file of the rows")
    parser.add_argument("--by", choices=("group", "case"), default="group")
    parser.add_argument("--csv", type=Path, help="file to write, a row per recording")
    parser.set_defaults(run=_table)


def _score(options: argparse.Namespace) -> None:
    rows = options.rows or options.out / "scores.jsonl"

    def question_of(group: str) -> Question:
        usual = QUESTIONS[group]
        return Question(
            usual.kinds if options.kinds is None else options.kinds,
            options.trials or usual.trials,
            tuple(options.options.split()),
        )

    for row in score(options.out, rows, question_of, options.jobs):
        print(summary(row), flush=True)


def _table(options: argparse.Namespace) -> None:
    rows = read_rows(options.rows)
    if options.csv:
        write_csv(rows, options.csv)
    print(table(rows, options.by))


def _generate(options: argparse.Namespace) -> None:
    work = partial(generate, options.out)
    with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
        for folder in pool.imap_unordered(work, plans(options)):
            print(folder, flush=True)


def plans(options: argparse.Namespace) -> list[Plan]:
    """Returns the recordings that the options name."""
    names = _chosen(options.cases)
    return [
        Plan(robot, case, seed, gap, options.duration, _trials(case, options))
        for gap, seed, case, robot in itertools.product(
            options.gaps.split(","), _seeds(options.seeds), names, options.robots.split(",")
        )
    ]


def _trials(case: str, options: argparse.Namespace) -> int:
    return options.trials or QUESTIONS[CASES[case].group].trials


def _chosen(text: str) -> list[str]:
    words = text.split(",")
    unknown = [word for word in words if word not in {"all", *CASES, *GROUPS}]
    if unknown:
        raise SystemExit(
            f"error: unknown case {unknown[0]!r}: expected all, a group ({', '.join(GROUPS)}) or "
            f"a case ({', '.join(CASES)})"
        )
    return [
        name
        for name, case in CASES.items()
        if "all" in words or name in words or case.group in words
    ]


def _seeds(text: str) -> Iterable[int]:
    first, _, last = text.partition("-")
    return range(int(first), int(last or first) + 1)


if __name__ == "__main__":
    main()
