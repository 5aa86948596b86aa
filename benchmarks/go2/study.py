"""Stages of the study: fits, errors, verdicts and injected faults; each returns JSON values."""

import copy
from typing import Any

import numpy as np

from benchmarks.go2.sample import (
    RATE,
    positions_and_commands,
    simulated,
    trial_of,
    with_fault,
)
from selfmodel.comparators.segment_prediction import SegmentPrediction
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.losses import LossTable
from selfmodel.diagnosis.significance import is_better
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.joints import BROKEN, JAMMED, WEAK_MOTOR
from selfmodel.faults.kind import Fault
from selfmodel.faults.sensors import FAILED_SENSOR
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.calibration import calibrate
from selfmodel.simulation.model_factors import with_model
from selfmodel.simulation.simulator import Simulator

FITTED, ALL = 10 * RATE, 15 * RATE
KINDS = (BROKEN, JAMMED, FAILED_SENSOR, WEAK_MOTOR)
COMPARATOR = SegmentPrediction("segment-prediction")
SHORTLIST = 8
TORQUES = (0.95, 0.9, 0.8, 0.7)
"""Parts of the torque that remain of the motors that are weak in the recording."""


def fit_to(robot: Robot, first: int, last: int, threads: int) -> dict[str, Any]:
    """Returns the fit to a part of the recording: its first row, and the row after the last."""
    trial = trial_of(robot, *positions_and_commands(robot), first, last)
    fit = calibrate(robot, [trial], threads).joints
    if fit is None:
        raise ValueError(f"{robot.name} has no fixed base")
    return fit


def robot_of(robot: Robot, fit: dict[str, Any]) -> Robot:
    """Returns the robot with the parameters and the delay of a fit."""
    model = copy.copy(robot.model)
    fields = {"damping": "dof_damping", "dry friction": "dof_frictionloss"}
    fields["armature"] = "dof_armature"
    for row in fit["parameters"]:
        if row["quantity"] == "gain":
            motor = model.actuator(row["name"]).id
            model.actuator_gainprm[motor] *= row["value"]
            model.actuator_biasprm[motor] *= row["value"]
        else:
            dof = model.joint(row["name"]).dofadr[0]
            getattr(model, fields[row["quantity"]])[dof] = row["value"]
    return with_model(robot, model, fit["delay"])


def rms_errors(nominal: Robot, fitted: Robot) -> dict[str, Any]:
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


def better_hypotheses(robot: Robot, threads: int) -> dict[str, Any]:
    """Returns the weak-motor hypotheses that predict the healthy robot better than ``INTACT``."""
    evidence = LossTable(Simulator(robot, threads), COMPARATOR)
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


def verdict_of(
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
        Simulator(robot, threads), COMPARATOR, settings, KINDS, healthy_trials=[healthy]
    )
    return search([trial], [], np.random.default_rng(0), lambda _: None).to_dict()


def exchanged_parts(nominal: Robot, threads: int) -> dict[str, Any]:
    """Returns fit, verdict and injected faults: the last 10 s fitted, the first 5 s tested."""
    healthy, part = (ALL - FITTED, ALL), (0, ALL - FITTED)
    fit = fit_to(nominal, *healthy, threads)
    robot = robot_of(nominal, fit)
    verdict = verdict_of(robot, healthy, part, threads)
    injected = injected_faults(robot, part, verdict["detectable"], threads)
    return {"fit": fit, "verdict": verdict, "injected": injected}


def injected_faults(
    robot: Robot, part: tuple[int, int], detectable: list[dict[str, Any]], threads: int
) -> list[dict[str, Any]]:
    """Returns the best of all single faults for each weak motor put into a part of the recording.

    Args:
        robot: The calibrated robot.
        part: First row, and the row after the last.
        detectable: Smallest detectable severities, as in the diagnosis of the part.
        threads: Threads of MuJoCo's steps.
    """
    shown = {row["part"]: row["below"] for row in detectable if row["kind"] == "motor"}
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
                else kind.levels_at(robot.anatomy, part)
            )
        )
    )
    rows = []
    for joint in robot.anatomy.joints:
        for torque in TORQUES:
            fault = Hypothesis((Fault(WEAK_MOTOR, joint.name, torque),))
            damaged = with_fault(whole, robot, positions, commands, fault)
            trial = trial_of(robot, damaged.trajectory["joint_positions"], commands, *part)
            simulator = Simulator(robot, threads)
            rough = LossTable(simulator, COMPARATOR.surrogate).losses(singles, [trial])
            few = [singles[i] for i in np.argsort(rough.mean(axis=1), kind="stable")[:SHORTLIST]]
            losses = LossTable(simulator, COMPARATOR).losses([INTACT, *few], [trial])
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
