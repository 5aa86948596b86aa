"""Page of the paper's experiment in Markdown: its tables and figures beside the paper."""

from collections.abc import Sequence

from selfmodel.experiments.paper.plan import ON_ROBOT
from selfmodel.experiments.paper.reported import NOT_RESTORED, UNKNOWN
from selfmodel.experiments.paper.tables import (
    RESTORED_FROM,
    CaseSummary,
    Cost,
    Failure,
    last_costs,
)
from selfmodel.settings import Settings

HEAD = """# The paper's experiment

Bongard & Lipson, *Automated Damage Diagnosis and Recovery for Remote Robotics* (ICRA 2004), run \
by `selfmodel paper`: the paper's fault kinds and repair EA, no reality gap, and a physical \
robot that is simulated too, as in the paper.

What is known of the paper's results: its abstract (almost complete functionality is restored \
after three evaluations on the physical robot, as opposed to over 3,000 if the controller is \
evolved on the robot), and from its text that evolution on the robot restored about 70 %, and \
that the function was not restored in the cases {not_restored}. Not available: {unknown}. So the \
tables and figures with the paper's numbers are selfmodel's own results on the same questions, \
and no number in them is read from the paper's.
"""

FIGURE_ONE = """## Figure 1: the robots

![The robots from the side and from above, with joints and sensors](figure-1.png)
"""

FIGURE_FIVE = """## Figure 5: recovery by trial

![Displacement over that before the failure, by case, trial and comparator](figure-5.png)

Forward displacement over that before the failure, medians over the seeds. Each line is a case \
with a comparator: the failing trial (open marker), then the best recovery trial so far. The \
data are in [trials.csv](trials.csv).
"""

FIGURE_SIX = """## Figure 6: physical trials

![Displacement over that before the failure, by number of physical trials](figure-6.png)

Medians and quartiles over the cases and seeds of a robot that all ways have. *{on_robot}* is \
the paper's control: the repair EA with every evaluation on the damaged robot, from the gait \
before the failure and random controllers. It has the evaluations of one repair; the paper's own \
control, the star, has over 3,000. The data are in [costs.csv](costs.csv).
"""

TABLE_TWO = """## Table II: diagnosis and recovery

*before*, *after*, *recovered*: median forward displacement in m before the failure, with the \
same controller after it, and of the best recovery trial. *restored*: runs in which the ratio *÷ \
before* is at least {restored_from}; the paper's own limit is not known. *right*: the best \
hypothesis after all trials is the truth, or behaves like it to the bit under every logged \
controller; the silent neuron of case 10 is in no hypothesis. *distinct*: median number of \
distinct hypotheses that were simulated. The seconds are those of one thread.
"""


def page(
    settings: Settings | None,
    failures: Sequence[Failure],
    summaries: Sequence[CaseSummary],
    costs: Sequence[Cost],
) -> str:
    """Returns the page.

    Args:
        settings: Parameters of the runs.
        failures: Table I.
        summaries: Table II.
        costs: Restored function by way and number of physical trials.
    """
    not_restored = "; ".join(
        f"{', '.join(map(str, cases))} of the {robot}" for robot, cases in NOT_RESTORED.items()
    )
    robots = dict.fromkeys(row.robot for row in summaries)
    parts = [
        HEAD.format(not_restored=not_restored, unknown="; ".join(UNKNOWN)),
        _budget(settings),
        FIGURE_ONE,
        "## Table I: the failures\n",
        _table_one(failures, list(robots)),
        TABLE_TWO.format(restored_from=RESTORED_FROM),
        *(part for robot in robots for part in (f"### {robot}\n", _table_two(robot, summaries))),
        FIGURE_FIVE,
        *(
            (FIGURE_SIX.format(on_robot=ON_ROBOT), _costs(last_costs(costs), list(robots)))
            if costs
            else ()
        ),
    ]
    return "\n".join(parts)


def _budget(settings: Settings | None) -> str:
    if settings is None:
        return ""
    equal = settings == Settings()
    return (
        f"Search budget: population {settings.population}, {settings.generations} generations, "
        f"{settings.steps} control steps, trials after the failing one: {settings.trials}; "
        f"{'the' if equal else 'not the'} paper's.\n"
    )


def _table_one(failures: Sequence[Failure], robots: Sequence[str]) -> str:
    truths = {(row.case, row.robot): row.truth for row in failures}
    words = {row.case: row.failure for row in failures}
    rows = [
        [str(case), words[case], *(_code(truths.get((case, robot))) for robot in robots)]
        for case in sorted(words)
    ]
    return _markdown(["case", "failure", *robots], rows)


def _table_two(robot: str, summaries: Sequence[CaseSummary]) -> str:
    rows = [
        [
            str(row.case),
            row.comparator,
            "restored" if row.restored_in_paper else "not restored",
            f"{row.restored} of {row.runs}",
            f"{row.right} of {row.runs}",
            *(_short(value) for value in (row.before, row.after, row.recovered)),
            _between(row.recovery, row.lowest, row.highest, row.runs),
            " ".join(map(_code, row.best.split())),
            f"{row.distinct_hypotheses:.0f}",
            f"{row.seconds:.0f}",
        ]
        for row in summaries
        if row.robot == robot
    ]
    columns = ["case", "comparator", "the paper", "restored", "right", "before", "after"]
    columns += ["recovered", "÷ before", "best hypothesis, where wrong", "distinct", "seconds"]
    return _markdown(columns, rows, numbers=(3, 4, 5, 6, 7, 8, 10, 11))


def _costs(costs: Sequence[Cost], robots: Sequence[str]) -> str:
    rows = [
        [
            cost.robot,
            cost.way,
            str(cost.physical_trials),
            str(cost.runs),
            _between(cost.recovery, cost.low, cost.high, cost.runs),
        ]
        for cost in sorted(costs, key=lambda cost: robots.index(cost.robot))  # stable
    ]
    rows.append(["both", "the paper", "3", "-", "almost complete"])
    rows.append(["both", "the paper, on the robot", "over 3,000", "-", "about 0.7"])
    columns = ["robot", "way", "physical trials", "runs", "÷ before (quartiles)"]
    return _markdown(columns, rows, numbers=(2, 3, 4))


def _between(middle: float | None, low: float | None, high: float | None, count: int) -> str:
    if middle is None or low is None or high is None:
        return "-"
    return _short(middle) + (f" ({_short(low)} to {_short(high)})" if count > 1 else "")


def _short(number: float) -> str:
    return f"{round(number, 2) + 0.0:.2f}"  # -0.001 is 0.00, not -0.00


def _code(notation: str | None) -> str:
    return f"`{notation}`" if notation else ""


def _markdown(
    columns: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[int] = ()
) -> str:
    """Returns a table, aligned left but for the columns of numbers, from 0."""
    rule = ["---:" if column in numbers else "---" for column in range(len(columns))]
    return "".join(f"| {' | '.join(row)} |\n" for row in (columns, rule, *rows))
