"""``selfmodel replay``: a logged trial simulated again, and compared with its log."""

import math
from typing import Any

import mujoco

from selfmodel.cli.commands import ReplayTrial
from selfmodel.cli.output.plain import counted
from selfmodel.cli.output.printing import print_json, print_lines
from selfmodel.cli.output.replay_figure import check_figure, draw
from selfmodel.cli.output.tables import show
from selfmodel.cli.replayed_log import replayed_log
from selfmodel.errors import InputError
from selfmodel.logs import TrialLog
from selfmodel.simulation.simulator import Simulator, thread_count
from selfmodel.simulation.trial_replay import Replay, replay as simulate
from selfmodel.trials.signals import SIGNALS, Signal

TOLERANCE = 1e-6
"""Largest difference that counts as equal between versions of MuJoCo or after an import, SI
units: some thousand roundings, before contacts amplify them."""

WINDOWS = 10
"""Rows of the table of errors over time."""

COLUMNS: tuple[tuple[Signal, str], ...] = (
    ("base_position", "base, m"),
    ("joint_positions", "joints, rad"),
    ("joint_velocities", "joints, rad/s"),
    ("commands", "commands"),
    ("sensors", "sensors"),
)


def replay(options: ReplayTrial) -> None:
    """Simulate a logged trial again from its log, and compare the two bit by bit."""
    if options.out is not None:
        check_figure(options.out)
    given = replayed_log(
        options.file, options.hypothesis, kinds=options.kinds, model=options.self_model
    )
    log, robot, assumed = given.log, given.robot, given.hypothesis
    logged = log.software.get("mujoco", "unknown")
    exact = logged == mujoco.__version__ and not log.imported
    tolerance = 0.0 if exact else TOLERANCE
    simulator = Simulator(robot, thread_count(options.threads))
    found = simulate(log.trial, assumed, simulator, tolerance)
    if not found.observed:
        raise InputError(
            f"{options.file}: nothing was observed: every number of the log is NaN, so there "
            f"is nothing to compare a simulation with: give a log with observations"
        )
    result = {
        "log": str(options.file),
        "robot": robot.name,
        "model": options.self_model,
        "hypothesis": str(assumed),
        "steps": log.trial.behaviour.steps,
        "identical": found.identical,
        "first_divergence_step": found.first_divergence_step,
        "rms": {signal: _finite(found.rms(signal)) for signal in SIGNALS},
        "tolerance": tolerance,
        "diverged": found.diverged,
        "mujoco": {"logged": logged, "running": mujoco.__version__},
    }
    if options.out is not None:
        draw(options.out, log, found, str(assumed))
        result["figure"] = str(options.out)
    if options.as_json:
        print_json(result)
    else:
        _print(result, log, found)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _print(result: dict[str, Any], log: TrialLog, found: Replay) -> None:
    print_lines(
        f"{result['log']}: {counted(result['steps'], 'step')} of {result['robot']}, replayed as "
        f"{result['hypothesis']}"
    )
    versions = result["mujoco"]
    if versions["logged"] != versions["running"]:
        print_lines(
            f"The log was made with MuJoCo {versions['logged']}, this is "
            f"{versions['running']}: differences below {TOLERANCE:g} count as equal."
        )
    if log.imported:
        print_lines(
            f"The log was imported, and resampled: differences below {TOLERANCE:g} count as equal."
        )
    if found.diverged:
        print_lines("The simulation diverged: with this hypothesis the model is unstable.")
    if found.identical:
        print_lines("identical: every observed number equals the simulated one, to the bit.")
        return
    step = found.first_divergence_step
    if step is None:
        print_lines(f"equal at every step, within {result['tolerance']:g}.")
    else:
        time = step * log.control_timestep
        print_lines(f"They differ from step {step} ({time:g} s). Root mean square difference:")
    show(("time, s", *(title for _, title in COLUMNS)), _rows(log, found), texts=0)


def _rows(log: TrialLog, found: Replay) -> list[tuple[str, ...]]:
    """Returns the error of each signal in each window of the trial."""
    steps = log.trial.behaviour.steps
    windows = min(WINDOWS, steps)
    rows = []
    for k in range(windows):
        first, last = steps * k // windows, steps * (k + 1) // windows
        errors = [found.rms(signal, slice(first, last)) for signal, _ in COLUMNS]
        start, end = first * log.control_timestep, (last - 1) * log.control_timestep
        texts = ("-" if math.isnan(error) else f"{error:.3g}" for error in errors)
        rows.append((f"{start:.2f}-{end:.2f}", *texts))
    return rows
