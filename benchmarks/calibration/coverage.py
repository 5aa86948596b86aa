"""Coverage of the intervals of calibrations, and the rate at which they do harm.

``python -m benchmarks.calibration.coverage [--robots quadruped,hexapod] [--count 24]`` prints a
table and writes ``benchmarks/calibration/coverage.json``. Each physical robot is plain MuJoCo with
random parameters (``benchmarks.calibration.robots``); it is calibrated on a trial of one gait. Harm
is an error above that of the nominal model in a trial of another gait, which was not fitted.
"""

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from benchmarks.calibration.robots import commands_of, drawn, logged
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration import calibrate, prediction_error
from selfmodel.simulation.model_factors import factor_names, nominal, with_parameters
from selfmodel.tasks import ROBOTS

RESULTS = Path(__file__).with_suffix(".json")
STEPS = 1000
"""Control steps of a trial."""
GAITS = 2
"""Gaits of the bank: each robot is calibrated on one and predicted in the next."""
FIRST_SEED = 100
"""Seed of the first robot; the constants of calibration were chosen with seeds below it."""
FRICTION = 0.8
"""Friction of the robots of the row ``friction 0.8``, as a factor."""

HARM = 1.001
"""Ratio of errors that counts as harm: an MJCF has numbers of six digits."""

Facts = dict[str, Any]


def main() -> None:
    """Measures, prints and writes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bank", type=Path, default=Path("benchmarks/bank"))
    parser.add_argument("--robots", default=",".join(ROBOTS))
    parser.add_argument("--spreads", default="0.05,0.1")
    parser.add_argument(
        "--contacts",
        type=float,
        default=0.0,
        help="standard deviation of the logarithms of stiffness and damping of contacts",
    )
    parser.add_argument("--count", type=int, default=24, help="robots of each kind and spread")
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args()
    rows = []
    for name in options.robots.split(","):
        robot = ROBOTS[name].robot()
        gaits = [commands_of(robot, options.bank, number, STEPS) for number in range(GAITS + 1)]
        for spread in map(float, options.spreads.split(",")):
            for seed in range(FIRST_SEED, FIRST_SEED + options.count):
                rows.append(measured(robot, gaits, spread, seed, options.contacts))
                print(json.dumps(rows[-1]), flush=True)
    options.out.write_text(json.dumps({"rows": rows}, indent=1) + "\n", encoding="utf-8")
    print(table(rows))


def measured(
    robot: Robot, gaits: Sequence[np.ndarray], spread: float, seed: int, contacts: float
) -> Facts:
    """Returns the facts of one physical robot; every second one has a friction of 0.8."""
    rng = np.random.default_rng([seed, round(1000 * spread)])
    truth = drawn(robot.model, spread, rng)
    if seed % 2:
        truth = replace(truth, friction=FRICTION)
    if contacts:
        other_draws = np.random.default_rng([seed, round(1000 * spread), 1])
        stiffness, damping = np.exp(contacts * other_draws.standard_normal(2)).tolist()
        # A physics step integrates no more damping than these robots have.
        truth = replace(truth, contacts=(stiffness, min(damping, 1.0)))
    seen, unseen = seed // 2 % GAITS, seed // 2 % GAITS + 1
    trial, other = (logged(robot, truth, gaits[gait], rng, "trial") for gait in (seen, unseen))
    start = process_time()
    found = calibrate(robot, [trial], threads=1)
    seconds = process_time() - start
    delayed = with_parameters(robot, replace(nominal(robot), delay=found.parameters.delay))
    off = np.log(found.parameters.factors) - np.log(truth.factors(robot.model, robot.root))
    return {
        "robot": robot.name,
        "spread": spread,
        "seed": seed,
        "chosen": found.chosen,
        "contacts_true": truth.contacts,
        "contacts": (found.parameters.contact_stiffness, found.parameters.contact_damping),
        "delay_right": found.parameters.delay == truth.delay,
        "over_deviations": (np.abs(off) / found.deviations).tolist(),
        "determined": [row["determined"] for row in found.rows()],
        "error_nominal": prediction_error(robot, [other], 1),
        "error_delayed": prediction_error(delayed, [other], 1),
        "error": prediction_error(found.robot, [other], 1),
        "suspicion": found.suspicion and str(found.suspicion),
        "seconds": seconds,
    }


def table(rows: Sequence[Facts]) -> str:
    """Returns the rates for each kind of robot and spread, as Markdown."""
    header = (
        "| robot | spread | robots | contacts changed | factors kept | delay right | within 68 % "
        "| within 95 % "
        "| determined factors within 68 % | within 95 % "
        "| friction of 0.8: undetermined or within 95 % | harm | harm against the delay alone "
        "| alarms | seconds |"
    )
    lines = [header, "|---" * 15 + "|"]
    for robot, spread in dict.fromkeys((row["robot"], row["spread"]) for row in rows):
        own = [row for row in rows if (row["robot"], row["spread"]) == (robot, spread)]
        over = np.array([row["over_deviations"] for row in own])
        known = np.array([row["determined"] for row in own])
        slippery = [row for row in own if row["seed"] % 2]
        column = factor_names(ROBOTS[robot].robot()).index("friction")
        honest = [
            not row["determined"][column] or row["over_deviations"][column] < 1.96
            for row in slippery
        ]
        cells = [
            robot,
            f"{spread:g}",
            str(len(own)),
            str(sum(tuple(row["contacts"]) != (1.0, 1.0) for row in own)),
            str(sum(row["chosen"] == "factors" for row in own)),
            str(sum(row["delay_right"] for row in own)),
            *_shares(over),
            *_shares(over[known]),
            f"{sum(honest)} of {len(honest)}",
            str(sum(row["error"] > HARM * row["error_nominal"] for row in own)),
            str(sum(row["error"] > HARM * row["error_delayed"] for row in own)),
            str(sum(row["suspicion"] is not None for row in own)),
            f"{np.mean([row['seconds'] for row in own]):.1f}",
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _shares(over: np.ndarray) -> tuple[str, str]:
    """Returns the shares of errors within the intervals of 68 and 95 %, as text."""
    if not over.size:
        return "-", "-"
    return f"{100 * np.mean(over < 1):.0f} %", f"{100 * np.mean(over < 1.96):.0f} %"


if __name__ == "__main__":
    main()
