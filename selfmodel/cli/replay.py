"""``selfmodel replay``: a log simulated again, and compared."""

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from selfmodel.cli.options import Json, NamedKinds, RobotOrModel, Threads

if TYPE_CHECKING:
    from selfmodel.logs import TrialLog
    from selfmodel.simulation.trial_replay import Replay
    from selfmodel.trials.behaviour import Signal

TOLERANCE = 1e-6
"""By how much numbers may differ and count as the same between versions of MuJoCo, or after
an import, in their SI unit: some thousand roundings, before contact makes more of them."""

WINDOWS = 10
"""Rows of the table of errors over time."""

COLUMNS: "tuple[tuple[Signal, str], ...]" = (
    ("base_position", "base, m"),
    ("joint_positions", "joints, rad"),
    ("joint_velocities", "joints, rad/s"),
    ("commands", "commands"),
    ("sensors", "sensors"),
)


def replay(
    file: Annotated[Path, typer.Argument(metavar="LOG", help="A trial log, NAME.mcap.")],
    *,
    hypothesis: Annotated[
        str,
        typer.Option(
            metavar="NOTATION", help="What is taken to be wrong, such as break:front_left_knee."
        ),
    ] = "intact",
    kinds: NamedKinds = "all",
    model: RobotOrModel = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="FIGURE.png|svg|pdf", help="Draw the error over time."),
    ] = None,
    threads: Threads = 0,
    as_json: Json = False,
) -> None:
    """Simulate a logged trial again, from its log alone, and compare what it does to the bit."""
    # Whatever brings MuJoCo waits until the command runs.
    import mujoco  # noqa: PLC0415

    from selfmodel.cli.replay_figure import check_figure, draw  # noqa: PLC0415
    from selfmodel.experiments import plugins, trial_logs  # noqa: PLC0415
    from selfmodel.faults.notation import parse  # noqa: PLC0415
    from selfmodel.faults.registry import known  # noqa: PLC0415
    from selfmodel.simulation.simulator import Simulator  # noqa: PLC0415
    from selfmodel.simulation.threads import thread_count  # noqa: PLC0415
    from selfmodel.simulation.trial_replay import replay as simulate  # noqa: PLC0415
    from selfmodel.trials.behaviour import SIGNALS  # noqa: PLC0415

    if out is not None:
        check_figure(out)
    (log,) = trial_logs.logs([file])
    robot = trial_logs.robot_of_logs([log], model)
    assumed = parse(hypothesis, robot.anatomy, known(plugins.kinds(kinds)))
    logged = log.software.get("mujoco", "unknown")
    exact = logged == mujoco.__version__ and not log.imported
    tolerance = 0.0 if exact else TOLERANCE
    simulator = Simulator(robot, thread_count(threads))
    found = simulate(log.trial, assumed, simulator, tolerance)
    result = {
        "log": str(file),
        "robot": robot.name,
        "model": model,
        "hypothesis": str(assumed),
        "steps": log.trial.behaviour.steps,
        "identical": found.identical,
        "first_divergence_step": found.first_divergence_step,
        "rms": {signal: _finite(found.rms(signal)) for signal in SIGNALS},
        "tolerance": tolerance,
        "diverged": found.diverged,
        "mujoco": {"logged": logged, "running": mujoco.__version__},
    }
    if out is not None:
        draw(out, log, found, str(assumed))
        result["figure"] = str(out)
    if as_json:
        typer.echo(json.dumps(result, indent=2, allow_nan=False))
    else:
        _print(result, log, found)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _print(result: dict[str, Any], log: "TrialLog", found: "Replay") -> None:
    from selfmodel.cli.output.plain import plain  # noqa: PLC0415  # only where it is printed
    from selfmodel.cli.output.tables import show  # noqa: PLC0415  # the same

    typer.echo(
        plain(f"{result['log']}: {result['steps']} steps of {result['robot']}, replayed as ")
        + result["hypothesis"]
    )
    versions = result["mujoco"]
    if versions["logged"] != versions["running"]:
        typer.echo(
            f"The log was made with MuJoCo {plain(versions['logged'])}, this is "
            f"{versions['running']}: what differs by less than {TOLERANCE:g} counts as the same."
        )
    if log.imported:
        typer.echo(
            f"The log was imported, and resampled: what differs by less than {TOLERANCE:g} counts "
            f"as the same."
        )
    if found.diverged:
        typer.echo("The simulation broke down: with this hypothesis the model is unstable.")
    if found.identical:
        typer.echo("identical: every number that was observed is the simulated one, to the bit.")
        return
    step = found.first_divergence_step
    if step is None:
        typer.echo(f"the same all the way, but for what is within {result['tolerance']:g}.")
    else:
        time = step * log.control_timestep
        typer.echo(f"They part at step {step} ({time:g} s). Root mean square of the difference:")
    show(("time, s", *(title for _, title in COLUMNS)), _rows(log, found), texts=0)


def _rows(log: "TrialLog", found: "Replay") -> list[tuple[str, ...]]:
    """The error of each signal in each part of the trial."""
    steps = log.trial.behaviour.steps
    windows = min(WINDOWS, steps)
    rows = []
    for k in range(windows):
        first, last = steps * k // windows, steps * (k + 1) // windows
        errors = [found.rms(signal, slice(first, last)) for signal, _ in COLUMNS]
        start, end = first * log.control_timestep, (last - 1) * log.control_timestep
        told = ("-" if math.isnan(error) else f"{error:.3g}" for error in errors)
        rows.append((f"{start:.2f}-{end:.2f}", *told))
    return rows
