"""``selfmodel replay``: a logged trial simulated again, and compared with its log."""

import io
import math
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from selfmodel import arguments, plugins
from selfmodel.cli.commands import ReplayTrial, Simulated
from selfmodel.cli.inputs import check_new_file
from selfmodel.cli.output import figure_text, print_json, print_lines
from selfmodel.cli.tables import show
from selfmodel.errors import InputError, counted
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.logs import TrialLog
from selfmodel.logs.files import replace_file
from selfmodel.robot.motion import POSE
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator, thread_count
from selfmodel.simulation.trial_replay import TOLERANCE, Replay, replay as simulate
from selfmodel.trials.signals import Signal
from selfmodel.trials.trial import check_magnitudes

WINDOWS = 10
"""Rows of the table of errors over time."""

COLUMNS: dict[Signal, str] = {
    "base_position": "base, m",
    "joint_positions": "joints, rad",
    "joint_velocities": "joints, rad/s",
    "commands": "commands",
    "sensors": "sensors",
}
"""Signals in the table and in the figure, and their titles."""


@dataclass(frozen=True, eq=False)
class ReplayedLog:
    """A log, and what its trial is simulated with: self-model, hypothesis, and threads."""

    log: TrialLog
    robot: Robot
    hypothesis: Hypothesis
    threads: int

    def simulated(self, tolerance: float = 0.0) -> Replay:
        """Returns the simulation of the trial under the hypothesis, compared with the log."""
        simulator = Simulator(self.robot, thread_count(self.threads))
        return simulate(self.log.trial, self.hypothesis, simulator, tolerance)

    def drawable(self) -> Replay:
        """Returns the simulation; raises ``InputError`` if a pose is too large to draw."""
        check_magnitudes(self.log.trial, POSE)
        return self.simulated()


def replayed_log(options: Simulated, hypothesis: str) -> ReplayedLog:
    """Returns a log, and what its trial is simulated with."""
    (log,) = arguments.read_logs([options.file])
    robot = arguments.robot_of_logs([log], options.self_model)
    assumed = HypothesisSpace(robot.anatomy, plugins.kinds(options.kinds)).parse(hypothesis)
    return ReplayedLog(log, robot, assumed, options.threads)


def replay(options: ReplayTrial) -> None:
    """Simulate a logged trial again from its log, and compare the two bit by bit."""
    if options.out is not None:
        check_new_file(options.out, ".png", ".svg", ".pdf")
    given = replayed_log(options, options.hypothesis)
    log = given.log
    logged = log.software.get("mujoco", "unknown")
    exact = logged == mujoco.__version__ and not log.imported
    tolerance = 0.0 if exact else TOLERANCE
    found = given.simulated(tolerance)
    tolerance = TOLERANCE if found.from_log else tolerance
    if not found.observed:
        raise InputError(
            f"{options.file}: nothing was observed: every number of the log is NaN, so there "
            f"is nothing to compare a simulation with: give a log with observations"
        )
    result = {
        "log": str(options.file),
        "robot": given.robot.name,
        "model": options.self_model,
        "hypothesis": str(given.hypothesis),
        "steps": log.trial.trajectory.steps,
        **found.to_dict(),
        "tolerance": tolerance,
        "mujoco": {"logged": logged, "running": mujoco.__version__},
    }
    if options.out is not None:
        kind = options.out.suffix.lower().removeprefix(".")
        replace_file(options.out, figure(log, found, str(given.hypothesis), kind))
        result["figure"] = str(options.out)
    if options.as_json:
        print_json(result)
    else:
        _print(result, log, found)


def _print(result: dict[str, Any], log: TrialLog, found: Replay) -> None:
    logged, running = result["mujoco"].values()
    equal = f"differences below {TOLERANCE:g} count as equal."
    step = found.first_divergence_step
    end = f"equal at every step, within {result['tolerance']:g}."
    if found.identical:
        end = "identical: every observed number equals the simulated one, to the bit."
    elif step is not None:
        time = step * log.control_timestep
        end = f"They differ from step {step} ({time:g} s). Root mean square difference:"
    sentences = {
        f"{result['log']}: {counted(result['steps'], 'step')} of {result['robot']}, replayed as "
        f"{result['hypothesis']}": True,
        f"The log was made with MuJoCo {logged}, this is {running}: {equal}": logged != running,
        f"The log was imported, and resampled: {equal}": log.imported,
        "The trial began in another pose than the model does, as episodes with a random start do: "
        f"replayed from the recorded state of step 0; {equal}": found.from_log,
        "The simulation diverged: with this hypothesis the model is unstable.": found.diverged,
        end: True,
    }
    print_lines(*(sentence for sentence, holds in sentences.items() if holds))
    if not found.identical:
        show(("time, s", *COLUMNS.values()), _rows(log, found), texts=0)


def _rows(log: TrialLog, found: Replay) -> list[tuple[str, ...]]:
    """Returns the error of each signal in each window of the trial."""
    steps, timestep = log.trial.trajectory.steps, log.control_timestep
    windows = min(WINDOWS, steps)
    rows = []
    for k in range(windows):
        first, last = steps * k // windows, steps * (k + 1) // windows
        errors = [found.rms(signal, slice(first, last)) for signal in COLUMNS]
        texts = ("-" if math.isnan(error) else f"{error:.3g}" for error in errors)
        rows.append((f"{first * timestep:.2f}-{(last - 1) * timestep:.2f}", *texts))
    return rows


def figure(log: TrialLog, found: Replay, hypothesis: str, kind: str) -> bytes:
    """Returns a figure file of the path of the base, logged and simulated, and of the errors."""
    from matplotlib.figure import Figure  # noqa: PLC0415  # most replays draw nothing

    logged, simulated = log.trial.trajectory, found.simulated
    drawn = Figure(figsize=(8, 6), layout="constrained")
    path, error = drawn.subplots(2, 1, sharex=True)
    path.plot(logged.time, logged["base_position"][:, 0], label="logged")
    label = figure_text(f"simulated: {hypothesis}")
    path.plot(logged.time, simulated["base_position"][:, 0], "--", label=label)
    path.set_ylabel("base, forward, m")
    for signal, title in COLUMNS.items():
        # Identical steps have an error of 0, which a logarithmic axis cannot show.
        shown = np.where(found.errors[signal] > 0, found.errors[signal], np.nan)
        error.plot(logged.time, shown, label=title)
    error.set(yscale="log", ylabel="difference, root mean square", xlabel="time, s")
    step, end = found.first_divergence_step, "equal at every step"
    if step is not None:
        end = f"they differ from step {step}"
        for axes in (path, error):
            axes.axvline(logged.time[step], color="0.6", linewidth=1)
    path.legend()
    error.legend()
    path.set_title(f"{figure_text(f'{log.trial.robot}, {log.trial.plan.name}')}: {end}")
    data = io.BytesIO()
    drawn.savefig(data, format=kind, dpi=150)
    return data.getvalue()
