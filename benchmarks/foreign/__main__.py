"""``python -m benchmarks.foreign``: makes recordings, scores their diagnoses, prints rates."""

import argparse
import itertools
import multiprocessing
from functools import partial
from pathlib import Path

from benchmarks.foreign.cases import CASES, GROUPS
from benchmarks.foreign.diagram import diagram
from benchmarks.foreign.generate import Plan, generate
from benchmarks.foreign.model import LEVELS
from benchmarks.foreign.robots import NAMES
from benchmarks.foreign.scoring import (
    QUESTIONS,
    Question,
    reliability,
    score,
    summary,
    table,
    write_csv,
)
from benchmarks.rows import read_rows
from selfmodel.style import files_of


def main() -> None:
    """Runs a command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.foreign", description=__doc__)
    commands = parser.add_subparsers(required=True)
    generating = commands.add_parser("generate", help="write recordings")
    scoring = commands.add_parser("score", help="diagnose recordings, and append the answers")
    for command in (generating, scoring):
        command.add_argument("out", type=Path, help="folder of the recordings")
        command.add_argument("--trials", type=int, help="with the faults, 1 to 3 [of the group]")
        command.add_argument("--jobs", type=int, default=2, help="processes")
    generating.add_argument("--robots", default="quadruped,hexapod", help=", ".join(NAMES))
    generating.add_argument("--cases", default="all", help="all, or names of cases or groups")
    generating.add_argument("--seeds", default="0", help="such as 0 or 0-4")
    generating.add_argument("--gaps", default="large", help=", ".join(LEVELS))
    generating.add_argument("--duration", type=float, default=10.0, help="of each trial, s")
    generating.add_argument("--own-gait", action="store_true", help="another than healthy trials")
    generating.set_defaults(run=_generate)
    scoring.add_argument("--rows", type=Path, help="file of the rows [OUT/scores.jsonl]")
    scoring.add_argument("--kinds", help="those of `selfmodel diagnose` [those of the group]")
    scoring.add_argument("--options", default="", help="further options of `selfmodel diagnose`")
    scoring.set_defaults(run=_score)
    rates = commands.add_parser("table", help="print the rates of right answers")
    rates.add_argument("rows", type=Path, help="file of the rows")
    rates.add_argument("--by", choices=("group", "case"), default="group")
    rates.add_argument("--csv", type=Path, help="file to write, a row per recording")
    rates.set_defaults(run=_table)
    drawing = commands.add_parser("diagram", help="draw the reliability of the probabilities")
    drawing.add_argument("csv", type=Path, nargs="+", help="files of `table --csv`")
    drawing.add_argument("--out", type=Path, required=True, help="file to write, .png or .svg")
    drawing.set_defaults(run=_diagram)
    options = parser.parse_args()
    options.run(options)


def _generate(options: argparse.Namespace) -> None:
    plans = [
        Plan(
            robot,
            case,
            seed,
            gap,
            options.duration,
            1 if options.own_gait else options.trials or QUESTIONS[CASES[case].group].trials,
            options.own_gait,
        )
        for gap, seed, case, robot in itertools.product(
            options.gaps.split(","),
            _seeds(options.seeds),
            _cases(options.cases),
            options.robots.split(","),
        )
    ]
    with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
        for folder in pool.imap_unordered(partial(generate, options.out), plans):
            print(folder, flush=True)


def _seeds(text: str) -> range:
    first, _, last = text.partition("-")
    return range(int(first), int(last or first) + 1)


def _cases(text: str) -> list[str]:
    words = text.split(",")
    if unknown := [word for word in words if word not in {"all", *CASES, *GROUPS}]:
        raise SystemExit(
            f"error: unknown case {unknown[0]!r}: expected all, a group ({', '.join(GROUPS)}) or "
            f"a case ({', '.join(CASES)})"
        )
    return [name for name, case in CASES.items() if {"all", name, case.group} & set(words)]


def _score(options: argparse.Namespace) -> None:
    def question_of(group: str) -> Question:
        usual = QUESTIONS[group]
        kinds = usual.kinds if options.kinds is None else options.kinds
        return Question(kinds, options.trials or usual.trials, tuple(options.options.split()))

    rows = options.rows or options.out / "scores.jsonl"
    for row in score(options.out, rows, question_of, options.jobs):
        print(summary(row), flush=True)


def _table(options: argparse.Namespace) -> None:
    rows = read_rows(options.rows)
    if options.csv:
        write_csv(rows, options.csv)
    print(table(rows, options.by), reliability(rows), sep="\n\n")


def _diagram(options: argparse.Namespace) -> None:
    options.out.write_bytes(files_of(options.out.stem, diagram(options.csv))[options.out.name])


if __name__ == "__main__":
    main()
