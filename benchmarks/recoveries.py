"""Ratios of recoveries to an oracle: medians and lowest tenths by case, with bootstrap intervals.

The recoveries are those of folders of ``selfmodel suite run``, the oracles those of
``benchmarks.rivals``:

    python -m benchmarks.recoveries rows FOLDER... > recoveries.jsonl
    python -m benchmarks.recoveries table recoveries.jsonl --oracles rivals/results.jsonl
"""

import argparse
import json
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.rows import markdown, read_rows
from selfmodel.studies.rows import frame_of, oracles
from selfmodel.studies.statistics import proportion
from selfmodel.studies.study import Row, grouped, rows_in

RESAMPLES = 2000

NOTHING_BREAKS = 9
"""Number of the case of Table I without a failure."""

MIN_SAMPLE = 5
"""Smallest number of values whose median has a bootstrap interval."""

RUN = ("robot", "case", "gap", "seed")


def main() -> None:
    """Runs a command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.recoveries", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    command = commands.add_parser("rows", help="print a row per recovery in folders of a study")
    command.add_argument("folders", type=Path, nargs="+")
    command = commands.add_parser("table", help="print the ratios by case")
    command.add_argument("rows", type=Path, help="file of the rows")
    command.add_argument("--oracles", type=Path, help="results.jsonl of benchmarks.rivals")
    options = parser.parse_args()
    if options.command == "rows":
        for folder in options.folders:
            for row in rows_of(folder):
                print(json.dumps(row, allow_nan=False))
    else:
        oracles_of = read_rows(options.oracles) if options.oracles else []
        print(table(read_rows(options.rows), oracles_of))


def rows_of(folder: Path) -> list[Row]:
    """Returns the recoveries of a study with upright and predicted displacements of each trial, m.

    Steps and seconds are without the search for the gait before the failure, which the recoveries
    of a robot and seed share.
    """
    trials = grouped(rows_in(folder, "trials"), *RUN)
    number = partial(round, ndigits=4)
    rows = []
    for row in rows_in(folder, "recoveries"):
        if "reason" in row:  # the robot cannot have the failure
            continue
        own = trials[tuple(row[name] for name in RUN)]
        rows.append(
            {
                **{name: row[name] for name in (*RUN, "truth", "repair", "correct")},
                "diagnosis": row["best"],
                "verdict": row["verdict"],
                "predicted": [one["robust_mean"] and number(one["robust_mean"]) for one in own],
                "upright": [number(one["upright"]) for one in own],
                "displacement": [number(one["displacement"]) for one in own],
                "falls": [one["fell_at_step"] for one in own],
                "simulated_steps": row["simulated_steps"],
                "seconds": number(row["seconds"]),
            }
        )
    return rows


def table(rows: Sequence[Row], methods: Sequence[Row]) -> str:
    """Returns a Markdown table, a line per robot, case and gap, and one per robot and gap.

    Rows of several repairs are in lines of their own, with the repair after the robot. A ratio is a
    median, with its 95 % bootstrap interval and the lowest tenth. The methods are rows of
    ``benchmarks.rivals``, of which those of the oracle count, each with the mean of its trials. The
    oracle of the healthy robot is that of case 9.
    """
    best = oracles(frame_of(methods)) if methods else {}
    several = len({row["repair"] for row in rows}) > 1
    lines = []
    for (robot, gap, repair), own in sorted(grouped(rows, "robot", "gap", "repair").items()):
        name = f"{robot}, {repair}" if several else robot
        cases = sorted(grouped(own, "case").items())
        lines += [_line(name, case, gap, same, best) for (case,), same in cases]
        lines.append(_line(name, "all", gap, own, best))
    return markdown(lines, texts=3)


def _line(
    robot: str, case: object, gap: float, rows: Sequence[Row], best: dict[tuple[object, ...], float]
) -> dict[str, str]:
    right = proportion(sum(row["correct"] for row in rows), len(rows))
    befores, healthy = {}, {}
    first: list[float] = []
    largest: list[float] = []
    transfer: list[float] = []
    for row in rows:
        # One gait before the failure per seed, whatever the case.
        cell = (row["robot"], NOTHING_BREAKS, row["gap"], row["seed"])
        befores[cell] = row["upright"][0]
        healthy[cell] = _ratio(row["upright"][0], best.get(cell))
        oracle = best.get(tuple(row[name] for name in RUN))
        recovered = row["upright"][2:]
        first.append(_ratio(recovered[0], oracle))
        largest.append(_ratio(max(recovered), oracle))
        transfer += map(_ratio, recovered, row["predicted"][2:])
    falls = sum(row["falls"][2 + int(np.argmax(row["upright"][2:]))] is not None for row in rows)
    return {
        "robot": robot,
        "case": str(case),
        "gap": f"{gap:g}",
        "n": str(len(rows)),
        "diagnosis right": f"{100 * right.estimate:.0f} % "
        f"({100 * right.low:.0f} to {100 * right.high:.0f})",
        "before, m": f"{np.mean(list(befores.values())):.1f}",
        "÷ oracle": _median(healthy.values()),
        "first trial ÷ oracle": _median(first),
        "best ÷ oracle": _median(largest),
        "observed ÷ predicted": _median(transfer),
        "fell": f"{falls} of {len(rows)}",
    }


def _ratio(value: float, reference: float | None) -> float:
    return value / reference if reference and reference > 0 else float("nan")


def _median(values: Iterable[float]) -> str:
    """Returns the median as text, with its interval and the lowest tenth; "-" without values.

    Fewer than ``MIN_SAMPLE`` values have no interval.
    """
    known = np.array([value for value in values if np.isfinite(value)])
    if len(known) < MIN_SAMPLE:
        return f"{np.median(known):.2f} (n {len(known)})" if len(known) else "-"
    rng = np.random.default_rng(0)
    medians = np.median(rng.choice(known, (RESAMPLES, len(known))), axis=1)
    low, high = np.quantile(medians, [0.025, 0.975])
    lowest = np.quantile(known, 0.1)
    return f"{np.median(known):.2f} ({low:.2f} to {high:.2f}; {lowest:.2f})"


if __name__ == "__main__":
    main()
