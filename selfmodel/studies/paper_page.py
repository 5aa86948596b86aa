"""The paper's experiment beside what the paper reports: tables, and a page in Markdown.

Source: J. C. Bongard and H. Lipson, *Automated Damage Diagnosis and Recovery for Remote Robotics*
(ICRA 2004): its abstract, and the part of its text that survives. Its figures and the numbers of
its Table II are not available, so nothing here is read from them.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd

from selfmodel.faults.registry import TABLE_ONE
from selfmodel.settings import Settings
from selfmodel.studies import figures, tables
from selfmodel.studies.recoveries import ON_ROBOT
from selfmodel.studies.rows import KINDS, methods_of, study_rows
from selfmodel.studies.study import Row, grouped, shared_in
from selfmodel.studies.tables import Table, table_of
from selfmodel.style import files_of
from selfmodel.tasks import ROBOTS

NOT_RESTORED: Mapping[str, tuple[int, ...]] = MappingProxyType(
    {"quadruped": (7, 8), "hexapod": (4, 7, 10)}
)
"""Cases in which the paper reports that the function was not restored, by robot."""

REPORTED = (3000, 0.7, "the paper: over 3,000 on the robot, about 70 %")
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

RUN = ("robot", "case", "seed")

COSTS = """\
![Displacement over that before the failure, by number of physical trials](figure-6.png)

Medians and quartiles over the cases and seeds of a robot that all ways have, after the most trials
of each way. *{on_robot}* is the paper's control: the repair EA with every evaluation on the damaged
robot, from the gait before the failure and random controllers. It has the evaluations of one
repair; the paper's own control, the star, has over 3,000. The paper itself reports almost complete
restoration after 3 trials. The data are in [costs.csv](costs.csv).

{table}"""


@dataclass(frozen=True)
class PaperResults:
    """Results of the experiment: settings of its runs, None without one, and rows.

    They are those of recoveries, of their physical trials, and of the generations of the evolutions
    on the robot.
    """

    settings: Settings | None
    recoveries: list[Row]
    trials: list[Row]
    evolution: list[Row]

    def failures(self) -> list[Row]:
        """Returns Table I for the robots and cases of the rows."""
        truths = {(row["case"], row["robot"]): row["truth"] for row in self.recoveries}
        return [
            {"case": case, "failure": TABLE_ONE[case], "robot": robot, "truth": truth}
            for (case, robot), truth in sorted(truths.items(), key=lambda item: item[0][0])
        ]

    def summaries(self) -> list[Row]:
        """Returns Table II: a row per robot, case and comparator, in the order of the rows."""
        named = self.named(self.recoveries)
        return list(map(_summary, grouped(named, "robot", "case", "comparator").values()))

    def named(self, rows: Sequence[Row]) -> list[Row]:
        """Returns rows whose comparator has the name that readers see; see ``methods_of``."""
        given = [row["comparator"] for row in self.recoveries]
        names = dict(zip(given, methods_of(self.recoveries), strict=True))
        return [
            {**row, "comparator": names.get(row["comparator"], row["comparator"])} for row in rows
        ]

    def costs(self) -> list[Row]:
        """Returns the restored function by way and number of physical trials: quartiles.

        Only runs that all ways of a robot have count, so that the ways are paired, and only those
        with a displacement above 0 before the failure.
        """
        points = [
            (*run, trials, share)
            for run, rows in grouped(self.named(self.trials), *RUN, "comparator").items()
            for trials, share in enumerate(best_so_far(rows))
            if trials
        ]
        points += [
            (*(row[name] for name in RUN), ON_ROBOT, row["evaluations"], _share(**row))
            for row in self.evolution
        ]
        frame = pd.DataFrame(points, columns=[*RUN, "way", "physical_trials", "recovery"])
        of_robot, of_run = (
            frame.groupby(names)["way"].transform("nunique") for names in ("robot", list(RUN))
        )
        paired = frame[of_run == of_robot].dropna()
        rows = []
        groups = paired.groupby(["robot", "way", "physical_trials"], sort=False)["recovery"]
        for (robot, way, trials), shares in groups:
            low, middle, high = np.quantile(shares, (0.25, 0.5, 0.75)).tolist()
            key = {"robot": robot, "way": way, "physical_trials": trials, "runs": len(shares)}
            rows.append({**key, "low": low, "recovery": middle, "high": high})
        return rows

    def last_costs(self) -> list[Row]:
        """Returns the costs with the most physical trials, one per robot and way."""
        ways = grouped(self.costs(), "robot", "way").values()
        return [max(costs, key=lambda cost: cost["physical_trials"]) for costs in ways]

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
    """Returns all results in the folder of an experiment."""
    settings = shared_in(folder).get("settings")

    def rows(table: str, columns: Sequence[str]) -> list[Row]:
        every = study_rows("paper", folder, table)
        every.sort(key=lambda row: list(ROBOTS).index(row["robot"]))
        return [{name: row[name] for name in columns} for row in every]

    return PaperResults(
        None if settings is None else Settings(**settings),
        rows("recoveries", KINDS["paper"].columns),
        rows("trials", (*RUN, "comparator", "number", "stage", "hypothesis", "displacement")),
        rows("evolution", (*RUN, "evaluations", "before", "best")),
    )


def results_of(folder: Path) -> tables.Results:
    """Returns page, tables and figures of all finished runs in the folder of an experiment.

    Without a finished recovery, there are no files.
    """
    results = collect(folder)
    every = tables_of(results)
    return tables.Results(
        results.as_dict(),
        every,
        every[1],
        "Medians over the runs, m; the paper: whether it reports the case as restored.",
        _files(results, every) if results.recoveries else {},
    )


def _files(results: PaperResults, every: Sequence[Table]) -> dict[str, bytes]:
    robots = dict.fromkeys(row["robot"] for row in results.recoveries)
    drawn = {
        "figure-1": figures.robots([ROBOTS[name].robot() for name in robots]),
        "figure-5": figures.by_trial(results.named(results.trials), NOT_RESTORED, best_so_far),
    }
    if costs := results.costs():  # comparators that have no run in common cannot be compared
        drawn["figure-6"] = figures.by_cost(costs, ON_ROBOT, REPORTED)
    rows = {name: getattr(results, name) for name in ("recoveries", "trials", "evolution")}
    files: dict[str, bytes] = {}
    for name, figure in drawn.items():
        files |= files_of(name, figure)
    files |= tables.table_files([*every, *(table_of(*item) for item in rows.items())], "csv")
    return {
        **files,
        "results.json": tables.json_bytes(results.as_dict()),
        "paper.md": page(results).encode(),
    }


def tables_of(results: PaperResults) -> list[Table]:
    """Returns Table I, Table II and the costs, for programs and for readers."""
    second = [
        {
            **{name: str(row[name]) for name in ("robot", "case", "comparator")},
            "the paper": "restored" if row["restored_in_paper"] else "not restored",
            **{name: f"{row[name]} of {row['runs']}" for name in ("restored", "right")},
            **{name: _short(row[name]) for name in ("before", "after", "recovered")},
            "÷ before": _between(row, "lowest", "highest"),
        }
        for row in results.summaries()
    ]
    return [
        table_of("table-1", results.failures()),
        table_of("table-2", results.summaries(), second, texts=4),
        _cost_table(results.costs()),
    ]


def _cost_table(costs: Sequence[Row]) -> Table:
    shown = [
        {
            **{name: row[name] for name in ("robot", "way")},
            "physical trials": str(row["physical_trials"]),
            "n": str(row["runs"]),
            "÷ before (quartiles)": _between(row, "low", "high"),
        }
        for row in costs
    ]
    return table_of("costs", costs, shown, texts=2)


def page(results: PaperResults) -> str:
    """Returns the page of the experiment in Markdown."""
    first, second, _ = map(tables.markdown_of, tables_of(results))
    settings, last = results.settings or Settings(), results.last_costs()
    costs = COSTS.format(on_robot=ON_ROBOT, table=tables.markdown_of(_cost_table(last)))
    restored = {robot: ", ".join(map(str, cases)) for robot, cases in NOT_RESTORED.items()}
    template = Path(__file__).with_suffix(".md").read_text(encoding="utf-8")
    return template.format(
        not_restored="; ".join(f"{cases} of the {robot}" for robot, cases in restored.items()),
        unknown="; ".join(UNKNOWN),
        size=f"Search budget: population {settings.population}, {settings.generations} "
        f"generations, {settings.steps} control steps, trials after the failing one: "
        f"{settings.trials}; {'the' if settings == Settings() else 'not the'} paper's.\n",
        failures=first,
        restored_from=RESTORED_FROM,
        summaries=second,
        costs=costs if last else "No run has all ways, so that they could be compared.\n",
    )


def best_so_far(trials: Sequence[Row]) -> list[float]:
    """Returns the share of the displacement before the failure that a recovery's trials restored.

    The first is that of the failing trial, and then each is that of the best recovery trial so far.
    """
    before, after, *recovery = (trial["displacement"] for trial in trials)
    return [_share(before, one) for one in (after, *np.maximum.accumulate(recovery).tolist())]


def _share(before: float, best: float, **_row: object) -> float:
    return best / before if before > 0 else math.nan


def _summary(rows: Sequence[Row]) -> Row:
    first = rows[0]
    known = [row for row in rows if None not in (row["before"], row["recovered"])]
    ratios = [row["recovered"] / row["before"] for row in known if row["before"] > 0]
    return {
        **{name: first[name] for name in ("robot", "case", "truth", "comparator")},
        "runs": len(rows),
        "right": sum(row["correct"] for row in rows),
        **tables.medians(rows, "before", "after", "recovered"),
        "recovery": median(ratios) if ratios else None,
        "lowest": min(ratios, default=None),
        "highest": max(ratios, default=None),
        "restored": sum(value >= RESTORED_FROM for value in ratios),
        "restored_in_paper": first["case"] not in NOT_RESTORED[first["robot"]],
        "best": " ".join(sorted({row["best"] for row in rows if not row["correct"]})),
        **tables.medians(rows, "distinct_hypotheses"),
        "diverged": sum(row["diverged"] for row in rows),
        **tables.medians(rows, "seconds"),
    }


def _between(row: Row, low: str, high: str) -> str:
    """Returns the restored share with two bounds, if there are several runs, as text."""
    if row["recovery"] is None:
        return "-"
    bounds = f" ({_short(row[low])} to {_short(row[high])})" if row["runs"] > 1 else ""
    return _short(row["recovery"]) + bounds


def _short(number: float) -> str:
    return f"{round(number, 2) + 0.0:.2f}"  # -0.001 is 0.00, not -0.00
