"""``python -m benchmarks.lost_legs``: a hexapod loses one leg or two, and walks again, by a rule.

The rule is HexaHeal's: a trial of 14 s counts as recovered if the robot does not fall, and goes at
least 0.125 m/s forward over the last 8 s. The 21 cases are six legs and fifteen pairs; theirs count
if 7 of 10 robots recover, here each robot is a row. A physical robot differs from the self-model by
a gap of 0.1: masses, inertias and torques by 10 %, friction and damping by 20 %, with noise and
delay (theirs: friction 20 %, gains 15 %, torso 10 %). Unlike theirs, it has lost its legs before
the trial begins.

A row for each case and robot is appended to ROWS, and those that are there are skipped. The order
is random, so the rows of a run that was stopped are a random sample. The first gait is evolved once
and kept in FOLDER.
"""

import argparse
import random
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import combinations
from pathlib import Path
from statistics import median

import numpy as np

import selfmodel
from benchmarks.hexapod.robots import LEGS, self_model
from benchmarks.rows import (
    add_rows,
    add_search,
    kept_gait,
    lines_of,
    markdown,
    parsed,
    rate,
    settings_of,
    spread,
)
from selfmodel import Controller, Robot, Settings, Trial
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.recovery.falls import fall_of
from selfmodel.studies.study import Row

ROBOTS = {
    "hexapod": partial(selfmodel.load_robot, "hexapod"),
    "urdf": partial(self_model, "import"),
}
"""Our hexapod, and the one of ``benchmarks/hexapod``, as its URDF is imported."""

SECONDS, LAST, SPEED, GAP = 14.0, 8.0, 0.125, 0.1
"""Duration of a trial and of its end, whose mean speed counts, s; that speed, m/s; the gap."""


def main() -> None:
    """Runs recoveries, or prints the table of their rows."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.lost_legs", description=__doc__)
    commands = parser.add_subparsers(required=True, dest="command")
    run = commands.add_parser("run")
    run.add_argument("robot", choices=ROBOTS)
    run.add_argument("folder", type=Path, help="folder of the first gaits")
    run.add_argument("--seeds", type=int, nargs="+", default=[0], help="physical robots")
    run.add_argument("--design", default="network+heading", help="of gaits")
    run.add_argument("--score", default="upright", help="of gaits")
    run.add_argument("--trials", type=int, default=1, help="of a recovery")
    add_search(run)
    given = parsed(parser, commands, table)
    robot = ROBOTS[given.robot]()
    settings = settings_of(given, round(SECONDS / robot.control_timestep))
    size = f"{given.population}x{given.generations}"
    path = given.folder / f"{given.robot}-{given.design}-{given.score}-{size}.npz"
    search = {"design": given.design, "score": given.score}
    gait = kept_gait(path, robot, settings=settings, **search)
    of = partial(recovered, robot, gait, settings)
    add_rows(given.rows, cases(given), given.limit, of)


def cases(given: argparse.Namespace) -> Iterator[Row]:
    """Yields what names each row, in a random order."""
    names = ("robot", "design", "score", "trials", "population", "generations")
    own = {name: getattr(given, name) for name in names}
    lost = [*combinations(LEGS, 1), *combinations(LEGS, 2)]
    rows = [{**own, "legs": "+".join(legs), "seed": seed} for seed in given.seeds for legs in lost]
    random.Random(0).shuffle(rows)  # noqa: S311  # an order
    return iter(rows)


def recovered(robot: Robot, gait: Controller, settings: Settings, key: Row, work: Path) -> Row:
    """Returns the walks before and after the loss of legs, and those of the recovery."""
    limbs = robot.anatomy.limbs
    truth = "+".join(f"break:{limbs[leg][0].name}" for leg in key["legs"].split("+"))
    healthy, damaged = (
        selfmodel.simulated_robot(robot, faults, gap=GAP, seed=key["seed"])
        for faults in ("intact", truth)
    )
    found = selfmodel.recover(
        *(healthy, damaged, robot, work / "run"),
        gait=gait,
        repair="robust",
        score=key["score"],
        settings=settings,
        seed=key["seed"],
        threads=1,
    )
    hypotheses = [INTACT, *[parse(truth, robot.anatomy)] * len(found.trials[1:])]
    before, after, *trials = [
        {"speed": last_speed(trial), "fell": fall_of(robot, hypothesis, trial) is not None}
        for trial, hypothesis in zip(found.trials, hypotheses, strict=True)
    ]
    named = {"best": str(found.diagnosis.best), "verdict": found.diagnosis.verdict}
    right = str(found.diagnosis.best) == str(parse(truth, robot.anatomy))
    return {"before": before, "after": after, "recovered": trials, **named, "right": right}


def last_speed(trial: Trial) -> float:
    """Returns the mean forward speed over the end of a trial, m/s."""
    time_of, x = trial.trajectory.time, trial.trajectory["base_position"][:, 0]
    first = int(np.searchsorted(time_of, time_of[-1] - LAST))
    return round(float((x[-1] - x[first]) / (time_of[-1] - time_of[first])), 3)


def group_of(legs: str) -> str:
    """Returns how far two lost legs are from each other around the body."""
    places = [[*LEGS].index(leg) for leg in legs.split("+")]
    if len(places) == 1:
        return "one leg"
    apart = abs(places[0] - places[1])
    return ("neighbours", "one apart", "opposite")[min(apart, len(LEGS) - apart) - 1]


def walks(trial: Mapping[str, float]) -> bool:
    """Returns whether a trial counts as recovered."""
    return not trial["fell"] and trial["speed"] >= SPEED


def table(rows: Sequence[Row]) -> str:
    """Returns the table of the rows by robot and group, with Wilson's 95 % intervals."""
    every = [{**row, "lost": lost} for row in rows for lost in (group_of(row["legs"]), "all")]
    every.sort(key=lambda row: (row["robot"], row["lost"]))
    return markdown(lines_of(every, {"robot": "robot", "lost": "lost"}, _rates), texts=2)


def _rates(rows: Sequence[Row]) -> dict[str, str]:
    first = [row["recovered"][0] for row in rows]
    before = [row["before"]["speed"] for row in rows]
    ratios = [one["speed"] / own for one, own in zip(first, before, strict=True)]
    return {
        "right": rate([row["right"] for row in rows]),
        "walks without recovery": rate([walks(row["after"]) for row in rows]),
        "recovered in one trial": rate(list(map(walks, first))),
        "in all trials": rate([any(map(walks, row["recovered"])) for row in rows]),
        "first ÷ before": spread(ratios, ".2f"),
        "CPU seconds": f"{median([row['seconds'] for row in rows]):.0f}",
    }


if __name__ == "__main__":
    main()
