"""Calibration and diagnosis of a real robot: a Unitree Go2 on a stand, from 15 s of its log.

Fits the model to the first 10 s, compares predictions of the last 5 s, fits three disjoint thirds,
diagnoses the last 5 s, and puts weak motors into them; then the last two again with the times
exchanged: the fit to the last 10 s, and the first 5 s diagnosed. Each stage adds its numbers to the
JSON.

    python -m benchmarks.go2 --out benchmarks/go2.json --figure docs/figures/go2.png
"""

import argparse
import json
from pathlib import Path
from time import perf_counter, process_time
from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.go2_sample import (
    RATE,
    positions_and_commands,
    robot_on_stand,
    simulated,
    trial_of,
    with_fault,
)
from selfmodel.comparators.segment_prediction import SegmentPrediction
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.evidence import Evidence
from selfmodel.diagnosis.significance import is_better
from selfmodel.faults.broken import BROKEN
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.jammed import JAMMED
from selfmodel.faults.kind import Fault
from selfmodel.faults.motor import WEAK_MOTOR
from selfmodel.faults.sensor import FAILED_SENSOR
from selfmodel.robot.joint_parameters import (
    QUANTITIES,
    JointParameters,
    model_with_joint_parameters,
)
from selfmodel.robot.parameters import with_model
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.calibration import calibrate
from selfmodel.simulation.simulator import Simulator

if TYPE_CHECKING:
    from collections.abc import Callable

FITTED, ALL = 10 * RATE, 15 * RATE
KINDS = (BROKEN, JAMMED, FAILED_SENSOR, WEAK_MOTOR)
COMPARATOR = SegmentPrediction("segment-prediction")
SHORTLIST = 8
TORQUES = (0.95, 0.9, 0.8, 0.7)
"""Parts of the torque that remain of the motors that are weak in the recording."""
STAGES = ("fit", "thirds", "hypotheses", "verdict", "injected", "exchanged")


def main() -> None:
    """Runs the stages, in their order; a stage after ``fit`` reads its fit from the JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="JSON file, read and written")
    parser.add_argument("--figure", type=Path, help="PNG file of the held-out part")
    parser.add_argument("--stages", default=",".join(STAGES))
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    found = json.loads(options.out.read_text()) if options.out.exists() else {}
    nominal = robot_on_stand()
    stages: dict[str, Callable[[], Any]] = {
        "fit": lambda: _fit(nominal, 0, FITTED, options.threads),
        "thirds": lambda: [
            _fit(nominal, k * ALL // 3, (k + 1) * ALL // 3, options.threads) for k in range(3)
        ],
        "hypotheses": lambda: {
            "nominal": _hypotheses(nominal, options.threads),
            "calibrated": _hypotheses(_robot_of(nominal, found["fit"]), options.threads),
        },
        "verdict": lambda: _verdict(
            _robot_of(nominal, found["fit"]), (0, FITTED), (FITTED, ALL), options.threads
        ),
        "injected": lambda: _injected(
            _robot_of(nominal, found["fit"]),
            (FITTED, ALL),
            found["verdict"]["detectable"],
            options.threads,
        ),
        "exchanged": lambda: _exchanged(nominal, options.threads),
    }
    for stage in options.stages.split(","):
        start = perf_counter(), process_time()
        found[stage] = stages[stage]()
        found.setdefault("seconds", {})[stage] = {
            "wall": round(perf_counter() - start[0], 1),
            "processor": round(process_time() - start[1], 1),
        }
        options.out.write_text(json.dumps(found, indent=1) + "\n")
    found["rms"] = _errors(nominal, _robot_of(nominal, found["fit"]))
    options.out.write_text(json.dumps(found, indent=1) + "\n")
    if options.figure:
        _draw(nominal, _robot_of(nominal, found["fit"]), options.figure)


def _fit(robot: Robot, first: int, last: int, threads: int) -> dict[str, Any]:
    trial = trial_of(robot, *positions_and_commands(robot), first, last)
    fit = calibrate(robot, [trial], threads).joints
    if fit is None:
        raise ValueError(f"{robot.name} has no fixed base")
    return fit.to_dict()


def _robot_of(robot: Robot, fit: dict[str, Any]) -> Robot:
    values = {
        quantity: np.array([r["value"] for r in fit["parameters"] if r["quantity"] == quantity])
        for quantity in QUANTITIES
    }
    model = model_with_joint_parameters(robot, JointParameters(values))
    return with_model(robot, model, fit["delay"])


def _errors(nominal: Robot, fitted: Robot) -> dict[str, Any]:
    """Returns the root mean square errors of simulations of the whole recording, mrad."""
    positions, commands = positions_and_commands(nominal)
    errors = {}
    for name, robot in (("nominal", nominal), ("calibrated", fitted)):
        squares = np.square(1e3 * (simulated(robot, positions, commands) - positions))
        errors[name] = {
            "first 10 s": float(np.sqrt(squares[:FITTED].mean())),
            "last 5 s": float(np.sqrt(squares[FITTED:].mean())),
            "last 5 s by joint": dict(
                zip(
                    robot.anatomy.hinges,
                    np.sqrt(squares[FITTED:].mean(axis=0)).round(2).tolist(),
                    strict=True,
                )
            ),
        }
    return errors


def _hypotheses(robot: Robot, threads: int) -> dict[str, Any]:
    """Returns the weak-motor hypotheses that predict the healthy robot better than ``INTACT``."""
    evidence = Evidence(Simulator(robot, threads), COMPARATOR)
    trial = trial_of(robot, *positions_and_commands(robot), FITTED, ALL)
    hypotheses = [
        Hypothesis((Fault(WEAK_MOTOR, joint.name, torque),))
        for joint in robot.anatomy.joints
        for torque in (0.95, 0.9, 0.7, 0.5, 0.0)
    ]
    intact, *rows = evidence.losses([INTACT, *hypotheses], [trial])
    return {
        "hypotheses": len(hypotheses),
        "smaller loss": sum(bool(row.mean() < intact.mean()) for row in rows),
        "significantly better": sum(is_better(row, intact) for row in rows),
    }


def _verdict(
    robot: Robot, healthy_part: tuple[int, int], part: tuple[int, int], threads: int
) -> dict[str, Any]:
    """Returns the diagnosis of a part of the recording, given the part that the model is fitted to.

    Parts are the first row and the row after the last.
    """
    positions, commands = positions_and_commands(robot)
    trial = trial_of(robot, positions, commands, *part)
    healthy = trial_of(robot, positions, commands, *healthy_part)
    settings = Settings(generations=5).scaled(40)
    search = DiagnosticSearch(
        Simulator(robot, threads), COMPARATOR, settings, KINDS, intact=[healthy]
    )
    return search([trial], [], np.random.default_rng(0), lambda _: None).to_dict()


def _exchanged(nominal: Robot, threads: int) -> dict[str, Any]:
    """Returns fit, verdict and injected faults: the last 10 s fitted, the first 5 s tested."""
    healthy, part = (ALL - FITTED, ALL), (0, ALL - FITTED)
    fit = _fit(nominal, *healthy, threads)
    robot = _robot_of(nominal, fit)
    verdict = _verdict(robot, healthy, part, threads)
    injected = _injected(robot, part, verdict["detectable"], threads)
    return {"fit": fit, "verdict": verdict, "injected": injected}


def _injected(
    robot: Robot, part: tuple[int, int], detectable: list[dict[str, Any]], threads: int
) -> list[dict[str, Any]]:
    """Returns the best of all single faults for each weak motor put into a part of the recording.

    Args:
        robot: The calibrated robot.
        part: First row, and the row after the last.
        detectable: Smallest detectable weakness of each motor, as in the diagnosis of the part.
        threads: Threads of MuJoCo's steps.
    """
    shown = {row["joint"]: row["torque"] for row in detectable}
    positions, commands = positions_and_commands(robot)
    whole = trial_of(robot, positions, commands)
    space = HypothesisSpace.of(KINDS, robot.anatomy)
    singles = list(
        dict.fromkeys(
            space.canonical([Fault(kind, part, level)])
            for kind in space.kinds
            for part in kind.parts(robot.anatomy)
            for level in (
                (0.95, 0.9, 0.8, 0.7, 0.6, 0.4, 0.2, 0.0)
                if kind == WEAK_MOTOR
                else kind.levels(robot.anatomy, part)
            )
        )
    )
    rows = []
    for joint in robot.anatomy.joints:
        for torque in TORQUES:
            fault = Hypothesis((Fault(WEAK_MOTOR, joint.name, torque),))
            damaged = with_fault(whole, robot, positions, commands, fault)
            trial = trial_of(robot, damaged.behaviour["joint_positions"], commands, *part)
            simulator = Simulator(robot, threads)
            rough = Evidence(simulator, COMPARATOR.surrogate).losses(singles, [trial])
            few = [singles[i] for i in np.argsort(rough.mean(axis=1), kind="stable")[:SHORTLIST]]
            losses = Evidence(simulator, COMPARATOR).losses([INTACT, *few], [trial])
            best = int(np.argmin(losses[1:].mean(axis=1)))
            significant = is_better(losses[1 + best], losses[0])
            rows.append(
                {
                    "injected": str(fault),
                    "best": str(few[best]),
                    "significant": significant,
                    "found": significant and few[best].faults[0].part == joint.name,
                    "said to show": torque <= (shown[joint.name] or 0.0),
                }
            )
            print(rows[-1], flush=True)
    return rows


def _draw(nominal: Robot, fitted: Robot, path: Path) -> None:
    positions, commands = positions_and_commands(nominal)
    time = np.arange(FITTED, ALL) / RATE
    chosen = ("FL_hip_joint", "FL_thigh_joint", "FL_calf_joint", "RL_calf_joint")
    lines = {
        "measured": (positions, "black", 1.4),
        "nominal": (simulated(nominal, positions, commands), "tab:red", 1.0),
        "calibrated": (simulated(fitted, positions, commands), "tab:blue", 1.0),
    }
    figure, axes = plt.subplots(len(chosen), 2, figsize=(11, 9), sharex=True)
    for (left, right), name in zip(axes, chosen, strict=True):
        column = nominal.anatomy.hinges.index(name)
        left.plot(time, commands[FITTED:, column], color="0.7", lw=0.8, label="command")
        for label, (values, color, width) in lines.items():
            left.plot(time, values[FITTED:, column], color=color, lw=width, label=label)
            if label != "measured":
                error = 1e3 * (values - positions)[FITTED:, column]
                right.plot(time, error, color=color, lw=width)
        left.set_ylabel(f"{name.removesuffix('_joint')}, rad")
        right.set_ylabel("error, mrad")
        right.grid(alpha=0.3)
    axes[0, 0].legend(fontsize=7, ncol=4, loc="upper center", bbox_to_anchor=(0.5, 1.25))
    for axis in axes[-1]:
        axis.set_xlabel("time, s")
    figure.tight_layout()
    figure.savefig(path, dpi=100)


if __name__ == "__main__":
    main()
