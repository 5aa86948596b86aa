"""The paper's experiment beside what the paper reports: tables, and a page in Markdown.

Source: J. C. Bongard and H. Lipson, *Automated Damage Diagnosis and Recovery for Remote Robotics*
(ICRA 2004): its abstract, and the part of its text that survives. Its figures and the numbers of
its Table II are not available, so nothing here is read from them.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from types import MappingProxyType
from typing import Any

import numpy as np

from selfmodel.settings import Settings
from selfmodel.studies import figures
from selfmodel.studies.cells import finished
from selfmodel.studies.plans import TABLE_ONE
from selfmodel.studies.recoveries import ON_ROBOT
from selfmodel.studies.rows import frame_of, study_rows
from selfmodel.studies.study import RUNS, Row, grouped
from selfmodel.studies.tables import Table, csv_bytes, markdown_table, summary_table, write_files
from selfmodel.tasks import ROBOTS

NOT_RESTORED: Mapping[str, tuple[int, ...]] = MappingProxyType(
    {"quadruped": (7, 8), "hexapod": (4, 7, 10)}
)
"""Cases in which the paper reports that the function was not restored, by robot."""

EVALUATIONS_ON_ROBOT, RESTORED_ON_ROBOT = 3000, 0.7
"""The abstract has more evaluations than these for evolution on the physical robot, which restores
about this part of the function."""

UNKNOWN = (
    "the content of Figures 1, 5 and 6 and their numbers",
    "the layout and the numbers of Table II",
    "the number of runs of each case, and the displacements in metres",
    "the share of the function from which the paper counts it as restored",
)
"""What could not be established."""

RESTORED_FROM = 0.8
"""Share of the displacement before the failure from which a function counts as restored here."""


RECOVERY = ("robot", "comparator", "case", "seed")
"""Columns by which the trials of one recovery differ from those of others."""


@dataclass(frozen=True)
class PaperResults:
    """Results of the experiment.

    Attributes:
        settings: Parameters of all runs; None without a finished run.
        recoveries: Rows of all recoveries in the folder.
        trials: Rows of their physical trials.
        evolution: Rows of the generations of the evolutions on the robot.
    """

    settings: Settings | None
    recoveries: list[Row]
    trials: list[Row]
    evolution: list[Row]

    def failures(self) -> list[Row]:
        """Returns Table I for the robots and cases of the rows."""
        found = {(row["case"], row["robot"]): row["truth"] for row in self.recoveries}
        return [
            {"case": case, "failure": TABLE_ONE[case], "robot": robot, "truth": truth}
            for (case, robot), truth in sorted(found.items(), key=lambda item: item[0][0])
        ]

    def summaries(self) -> list[Row]:
        """Returns Table II: a row per robot, case and comparator, in the order of the rows."""
        groups = grouped(self.recoveries, "robot", "case", "comparator")
        return [_summary(group) for group in groups.values()]

    def costs(self) -> list[Row]:
        """Returns the restored function by way and number of physical trials: quartiles.

        Only runs that all ways of a robot have count, so that the ways are paired, and only those
        with a displacement above 0 before the failure.
        """
        ways: dict[tuple[str, str], dict[tuple[Any, ...], list[tuple[int, float]]]] = {}
        for (robot, way, case, seed), recovery in grouped(self.trials, *RECOVERY).items():
            steps = list(enumerate(best_so_far(recovery)))[1:]
            ways.setdefault((robot, way), {})[case, seed] = steps
        for row in self.evolution:
            runs = ways.setdefault((row["robot"], ON_ROBOT), {})
            share = _ratio(row["best"], row["before"])
            point = row["case"], row["seed"]
            runs.setdefault(point, []).append((row["evaluations"], share))
        found = []
        for (robot, way), runs in ways.items():
            others = [other for (name, _), other in ways.items() if name == robot]
            values: dict[int, list[float]] = {}
            for run in runs:
                for count, value in runs[run] if all(run in other for other in others) else ():
                    if not math.isnan(value):
                        values.setdefault(count, []).append(value)
            for count, known in values.items():
                low, middle, high = map(float, np.quantile(known, (0.25, 0.5, 0.75)))
                key = {"robot": robot, "way": way, "physical_trials": count, "runs": len(known)}
                found.append({**key, "low": low, "recovery": middle, "high": high})
        return found

    def last_costs(self) -> list[Row]:
        """Returns the costs with the most physical trials, one per robot and way."""
        last: dict[tuple[str, str], Row] = {}
        for cost in self.costs():
            known = last.setdefault((cost["robot"], cost["way"]), cost)
            if cost["physical_trials"] > known["physical_trials"]:
                last[cost["robot"], cost["way"]] = cost
        return list(last.values())

    def as_dict(self) -> dict[str, Any]:
        """Returns the tables and their rows as JSON."""
        return {
            "settings": None if self.settings is None else vars(self.settings),
            "table_1": self.failures(),
            "table_2": self.summaries(),
            "costs": self.last_costs(),
            "recoveries": self.recoveries,
            "trials": self.trials,
        }


def collect(folder: Path) -> PaperResults:
    """Returns all results in the folder of an experiment.

    Raises:
        InputError: A cell in the folder is damaged.
    """
    first = next(finished(folder / RUNS), None)
    keys = ("robot", "case", "seed")
    trials = ("comparator", "number", "stage", "hypothesis", "displacement")
    evolution = ("evaluations", "before", "best")
    return PaperResults(
        settings=None if first is None else Settings(**first.parameters["shared"]["settings"]),
        recoveries=study_rows("paper", folder),
        trials=[
            {name: row[name] for name in (*keys, *trials)}
            for row in study_rows("paper", folder, "trials")
        ],
        evolution=[
            {name: row[name] for name in (*keys, *evolution)}
            for row in study_rows("paper", folder, "evolution")
        ],
    )


def write_results(folder: Path) -> tuple[PaperResults, tuple[Path, ...]]:
    """Writes page, tables and figures of all finished runs in the folder of an experiment.

    Without a finished recovery, nothing is written.

    Raises:
        InputError: A cell in the folder is damaged.
        OSError: The results cannot be written.
    """
    found = collect(folder)
    if not found.recoveries:
        return found, ()
    robots = dict.fromkeys(row["robot"] for row in found.recoveries)
    costs = found.costs()
    text = json.dumps(found.as_dict(), indent=1, allow_nan=False)
    drawn = {
        "figure-1": figures.robots([ROBOTS[name].robot() for name in robots]),
        "figure-5": figures.by_trial(found.trials, NOT_RESTORED, best_so_far),
        # Comparators that have no run in common cannot be compared.
        **({"figure-6": figures.by_cost(costs, ON_ROBOT, _reported())} if costs else {}),
    }
    tables = {
        "table-1": found.failures(),
        "table-2": found.summaries(),
        "costs": costs,
        "recoveries": found.recoveries,
        "trials": found.trials,
        "evolution": found.evolution,
    }
    files = {
        **{name: data for one in drawn.items() for name, data in figures.files_of(*one).items()},
        **{f"{name}.csv": csv_bytes(frame_of(rows)) for name, rows in tables.items()},
        "results.json": f"{text}\n".encode(),
        "paper.md": page(found).encode(),
    }
    return found, write_files(folder, files)


def tables_of(found: PaperResults) -> list[Table]:
    """Returns Table I, Table II and the costs, for programs and for readers."""
    second = [
        {
            **{name: str(row[name]) for name in ("robot", "case", "comparator")},
            "the paper": "restored" if row["restored_in_paper"] else "not restored",
            "right": f"{row['right']} of {row['runs']}",
            **{name: _short(row[name]) for name in ("before", "after", "recovered")},
            "÷ before": "-" if row["recovery"] is None else _short(row["recovery"]),
        }
        for row in found.summaries()
    ]
    costs = [
        {
            "robot": row["robot"],
            "way": row["way"],
            "physical trials": str(row["physical_trials"]),
            "n": str(row["runs"]),
            "÷ before": _short(row["recovery"]),
            "first quartile": _short(row["low"]),
            "third": _short(row["high"]),
        }
        for row in found.costs()
    ]
    first = [{name: str(value) for name, value in row.items()} for row in found.failures()]
    return [
        summary_table("table-1", found.failures(), first, texts=4),
        summary_table("table-2", found.summaries(), second, texts=4),
        summary_table("costs", found.costs(), costs, texts=2),
    ]


def best_so_far(trials: Sequence[Row]) -> list[float]:
    """Returns the share of the displacement before the failure that trials restored.

    Args:
        trials: All trials of one recovery, in order.

    Returns:
        First that of the failing trial, then that of the best recovery trial so far.
    """
    before, after, *recovery = (trial["displacement"] for trial in trials)
    largest = [max(recovery[: count + 1]) for count in range(len(recovery))]
    return [_ratio(displacement, before) for displacement in (after, *largest)]


def _ratio(displacement: float, before: float) -> float:
    return displacement / before if before > 0 else math.nan


def _summary(rows: Sequence[Row]) -> dict[str, Any]:
    first = rows[0]
    ratios = [row["recovered"] / row["before"] for row in rows if row["before"] > 0]
    restored = first["case"] not in NOT_RESTORED[first["robot"]]
    middle = {
        name: median(row[name] for row in rows)
        for name in ("before", "after", "recovered", "distinct_hypotheses", "seconds")
    }
    return {
        **{name: first[name] for name in ("robot", "case", "truth", "comparator")},
        "runs": len(rows),
        "right": sum(row["correct"] for row in rows),
        **{name: middle[name] for name in ("before", "after", "recovered")},
        "recovery": median(ratios) if ratios else None,
        "lowest": min(ratios, default=None),
        "highest": max(ratios, default=None),
        "restored": sum(value >= RESTORED_FROM for value in ratios),
        "restored_in_paper": restored,
        "best": " ".join(sorted({row["best"] for row in rows if not row["correct"]})),
        "distinct_hypotheses": middle["distinct_hypotheses"],
        "diverged": sum(row["diverged"] for row in rows),
        "seconds": middle["seconds"],
    }


def _reported() -> tuple[int, float, str]:
    label = "the paper: over 3,000 on the robot, about 70 %"
    return EVALUATIONS_ON_ROBOT, RESTORED_ON_ROBOT, label


PAGE = """# The paper's experiment

Bongard & Lipson, *Automated Damage Diagnosis and Recovery for Remote Robotics* (ICRA 2004), run \
by `selfmodel paper`: the paper's fault kinds and repair EA, no reality gap, and a physical \
robot that is simulated too, as in the paper.

What is known of the paper's results: its abstract (almost complete functionality is restored \
after three evaluations on the physical robot, as opposed to over 3,000 if the controller is \
evolved on the robot), and from its text that evolution on the robot restored about 70 %, and \
that the function was not restored in the cases {not_restored}. Not available: {unknown}. So the \
tables and figures with the paper's numbers are selfmodel's own results on the same questions, \
and no number in them is read from the paper's.

{size}
## Figure 1: the robots

![The robots from the side and from above, with joints and sensors](figure-1.png)

## Table I: the failures

{failures}
## Table II: diagnosis and recovery

*before*, *after*, *recovered*: median forward displacement in m before the failure, with the \
same controller after it, and of the best recovery trial. *restored*: runs in which the ratio *÷ \
before* is at least {restored_from}; the paper's own limit is not known. *right*: the best \
hypothesis after all trials is the truth, or behaves like it to the bit under every logged \
controller; the silent neuron of case 10 is in no hypothesis. *distinct*: median number of \
distinct hypotheses that were simulated. The seconds are those of one thread.

{summaries}
## Figure 5: recovery by trial

![Displacement over that before the failure, by case, trial and comparator](figure-5.png)

Forward displacement over that before the failure, medians over the seeds. Each line is a case \
with a comparator: the failing trial (open marker), then the best recovery trial so far. The \
data are in [trials.csv](trials.csv).
"""

PAGE_COSTS = """
## Figure 6: physical trials

![Displacement over that before the failure, by number of physical trials](figure-6.png)

Medians and quartiles over the cases and seeds of a robot that all ways have. *{on_robot}* is \
the paper's control: the repair EA with every evaluation on the damaged robot, from the gait \
before the failure and random controllers. It has the evaluations of one repair; the paper's own \
control, the star, has over 3,000. The data are in [costs.csv](costs.csv).

{costs}"""


def page(found: PaperResults) -> str:
    """Returns the page of the experiment in Markdown."""
    robots = list(dict.fromkeys(row["robot"] for row in found.recoveries))
    not_restored = "; ".join(
        f"{', '.join(map(str, cases))} of the {robot}" for robot, cases in NOT_RESTORED.items()
    )
    truths = {(row["case"], row["robot"]): _code(row["truth"]) for row in found.failures()}
    failures = [
        {"case": str(case), "failure": TABLE_ONE[case]}
        | {robot: truths.get((case, robot), "") for robot in robots}
        for case in sorted({case for case, _ in truths})
    ]
    numbers = (3, 4, 5, 6, 7, 8, 10, 11)
    lines = {
        robot: [_line(row) for row in found.summaries() if row["robot"] == robot]
        for robot in robots
    }
    sections = [f"### {robot}\n\n{markdown_table(rows, numbers)}" for robot, rows in lines.items()]
    text = PAGE.format(
        not_restored=not_restored,
        unknown="; ".join(UNKNOWN),
        size=_size(found.settings),
        failures=markdown_table(failures),
        restored_from=RESTORED_FROM,
        summaries="\n".join(sections),
    )
    last = found.last_costs()
    if not last:
        return text
    costs = [
        {
            "robot": row["robot"],
            "way": row["way"],
            "physical trials": str(row["physical_trials"]),
            "runs": str(row["runs"]),
            "÷ before (quartiles)": _between(row["recovery"], row["low"], row["high"], row["runs"]),
        }
        for row in sorted(last, key=lambda row: robots.index(row["robot"]))  # stable
    ]
    for way, trials, restored in (
        ("the paper", "3", "almost complete"),
        ("the paper, on the robot", "over 3,000", "about 0.7"),
    ):
        costs.append(dict(zip(costs[0], ("both", way, trials, "-", restored), strict=True)))
    return text + PAGE_COSTS.format(
        on_robot=ON_ROBOT, costs=markdown_table(costs, numbers=(2, 3, 4))
    )


def _size(settings: Settings | None) -> str:
    if settings is None:
        return ""
    equal = settings == Settings()
    return (
        f"Search budget: population {settings.population}, {settings.generations} generations, "
        f"{settings.steps} control steps, trials after the failing one: {settings.trials}; "
        f"{'the' if equal else 'not the'} paper's.\n"
    )


def _line(row: Row) -> dict[str, str]:
    """Returns a row of Table II for readers."""
    return {
        "case": str(row["case"]),
        "comparator": row["comparator"],
        "the paper": "restored" if row["restored_in_paper"] else "not restored",
        "restored": f"{row['restored']} of {row['runs']}",
        "right": f"{row['right']} of {row['runs']}",
        **{name: _short(row[name]) for name in ("before", "after", "recovered")},
        "÷ before": _between(row["recovery"], row["lowest"], row["highest"], row["runs"]),
        "best hypothesis, where wrong": " ".join(map(_code, row["best"].split())),
        "distinct": f"{row['distinct_hypotheses']:.0f}",
        "seconds": f"{row['seconds']:.0f}",
    }


def _between(middle: float | None, low: float | None, high: float | None, count: int) -> str:
    if middle is None or low is None or high is None:
        return "-"
    return _short(middle) + (f" ({_short(low)} to {_short(high)})" if count > 1 else "")


def _short(number: float) -> str:
    return f"{round(number, 2) + 0.0:.2f}"  # -0.001 is 0.00, not -0.00


def _code(notation: str) -> str:
    return f"`{notation}`" if notation else ""
