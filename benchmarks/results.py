"""Writes docs/results/table-one.md and docs/results.jsonl from the runs of ``table_one``."""

import json
from pathlib import Path
from statistics import median
from typing import Any

Facts = dict[str, Any]
"""JSON values by name."""

RESULTS = Path("docs/results/table-one.md")
DATA = Path("docs/results.jsonl")

HEAD = """# Table I of the paper, on both robots

Written by `make results` (`python -m benchmarks.table_one`), which runs the missing runs and
rewrites this page. Comparator `forward-displacement`, the paper's budget (population 100, 30
generations, 1,000 control steps, 3 trials after the failing one), no reality gap. One thread per
run, as many runs at once as processors; the seconds are those of such a run, without the evolution
of the gait before the failure (last table). The data, one line per gait and one per run, is in
[results.jsonl](../results.jsonl).

Of the ten hypotheses ranked, the best counts. A compound is found only if the search reaches it:
with one number per trial, a partly right hypothesis is no closer than a wrong one. The silent
neuron of case 10 is in no hypothesis, so its diagnosis is never correct. A recovery above 1 is a
controller that walks better than the initial gait: three more searches started from that gait.

*before*, *after*, *recovered*: forward displacement in m before the failure, with the same
controller after it, and of the best of the three recovery trials. *correct*: the best hypothesis is
the truth, or behaves like it to the bit under every logged controller. *distinct*: number of
distinct hypotheses that were simulated.
"""

GAITS = """The paper's budget, one gait per seed. *torso*: its lowest and highest height over all \
seeds, over its standing height; *deepest*: the deepest penetration of any contact; both at every \
physics step. *walking* counts the gaits with a torso above the ground and below twice its \
standing height, and no contact deeper than 1 cm.

The robots have a contact margin of 1 cm (`margin` in the MJCF): contact forces begin before the \
shapes meet, and depth is counted from the shapes. Without it, feet that hit the ground at 2 to \
3 m/s penetrate by more than 1 cm in the one physics step before there is a contact. The gaits are \
fast trots and shuffles more than calm walks: the feet touch down four to fourteen times a second.
"""


def write_results(walks: list[Facts], runs: list[Facts]) -> None:
    """Writes the page.

    Args:
        walks: Results of ``table_one.evolve_gait``, one per robot and seed.
        runs: Results of ``table_one.recover_once``.
    """
    robots = list(dict.fromkeys(walk["robot"] for walk in walks))
    parts = [HEAD]
    for robot in robots:
        parts += [f"\n## {robot.capitalize()}, all ten cases, seed 0\n", _table_one(robot, runs)]
    parts += ["\n## How often the diagnosis is correct, by case\n", _by_case(runs)]
    parts += ["\n## The repair EA on the healthy robots\n", _gaits(robots, walks)]
    RESULTS.write_text("\n".join(parts), encoding="utf-8")
    rows = [json.dumps({key: run[key] for key in run if key != "trials"}) for run in runs]
    rows = [*map(json.dumps, walks), *rows]
    DATA.write_text("\n".join(rows) + "\n", encoding="utf-8")


def _table_one(robot: str, runs: list[Facts]) -> str:
    rows = [
        (
            "| case | truth | before | after | recovered | ÷ before | correct | best hypothesis, "
            "where wrong | distinct | seconds |"
        ),
        "|---|---|---:|---:|---:|---:|---|---|---:|---:|",
    ]
    for run in runs:
        if run["robot"] == robot and run["seed"] == 0:
            displacements = run["displacement"]
            best = "" if run["correct"] else f"`{run['diagnosis'][0]['hypothesis']}`"
            rows.append(
                f"| {run['case']} | `{run['truth']}` | {_short(displacements['before'])} "
                f"| {_short(displacements['after'])} | {_short(displacements['recovered'])} "
                f"| {_short(run['recovery'])} "
                f"| {'yes' if run['correct'] else 'no'} | {best} "
                f"| {run['evaluations']['distinct_hypotheses']} | {run['seconds']:.0f} |"
            )
    return "\n".join(rows) + "\n"


def _short(number: float) -> str:
    return f"{round(number, 2) + 0.0:.2f}"  # -0.001 is 0.00, not -0.00


def _by_case(runs: list[Facts]) -> str:
    rows = [
        ("The quadruped, one run per seed; *÷ before* is recovered over before, over the seeds.\n"),
        "| case | truth | correct | median ÷ before | lowest | highest | diverged simulations |",
        "|---|---|---:|---:|---:|---:|---:|",
    ]
    cases: dict[int, list[Facts]] = {}
    for run in runs:
        if run["robot"] == "quadruped":
            cases.setdefault(run["case"], []).append(run)
    for case, same in sorted(cases.items()):
        if len(same) > 1:
            right = sum(run["correct"] for run in same)
            kept = [run["recovery"] for run in same]
            diverged = sum(run["evaluations"]["diverged"] for run in same)
            rows.append(
                f"| {case} | `{same[0]['truth']}` | {right} of {len(same)} | {median(kept):.2f} "
                f"| {min(kept):.2f} | {max(kept):.2f} | {diverged} |"
            )
    return "\n".join(rows) + "\n"


def _gaits(robots: list[str], walks: list[Facts]) -> str:
    rows = [
        GAITS,
        "| robot | median m | lowest | highest | torso | deepest, mm | walking | median seconds |",
        "|---|---:|---:|---:|---|---:|---:|---:|",
    ]
    for robot in robots:
        same = [walk for walk in walks if walk["robot"] == robot]
        displacements = [walk["displacement"] for walk in same]
        low, high = min(w["lowest"] for w in same), max(w["highest"] for w in same)
        rows.append(
            f"| {robot} | {median(displacements):.2f} | {min(displacements):.2f} "
            f"| {max(displacements):.2f} | {low:.2f} to {high:.2f} "
            f"| {1000 * max(w['deepest'] for w in same):.1f} "
            f"| {sum(w['walking'] for w in same)} of {len(same)} "
            f"| {median(w['seconds'] for w in same):.0f} |"
        )
    return "\n".join(rows) + "\n"
