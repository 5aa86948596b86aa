"""``selfmodel calibrate``: a self-model fitted to logs of the intact robot."""

import json
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer

from selfmodel.cli.options import Json, LogFiles, RobotOrModel, Threads
from selfmodel.errors import InputError

if TYPE_CHECKING:
    from selfmodel.robot.robot import Robot


def calibrate(
    files: LogFiles,
    *,
    out: Annotated[
        Path,
        typer.Option(
            "--out", "-o", metavar="MODEL.xml", help="The MJCF to write; it must not exist."
        ),
    ],
    robot: RobotOrModel = None,
    threads: Threads = 0,
    as_json: Json = False,
) -> None:
    """Fit masses, friction, damping, motors and delay of the self-model to logged trials.

    Give trials of the robot with nothing wrong: what is wrong in them would become part of the
    model. What is written is a model for --robot of diagnose and replay.
    """
    # Whatever brings MuJoCo waits until the command runs.
    from selfmodel.experiments import trial_logs  # noqa: PLC0415
    from selfmodel.logs.files import as_write_error, create_partial, publish, refuse_existing  # noqa: PLC0415
    from selfmodel.robot.parameters import factor_names  # noqa: PLC0415
    from selfmodel.simulation.calibrate import calibrate as fit_to  # noqa: PLC0415
    from selfmodel.simulation.threads import thread_count  # noqa: PLC0415

    start = perf_counter()
    if out.suffix.lower() != ".xml":
        raise InputError(f"--out needs a name that ends in .xml, got {str(out)!r}")
    refuse_existing(out)
    logs = trial_logs.logs(files)
    before = trial_logs.robot_of_logs(logs, robot)
    _refuse_assets(before, robot or str(files[0]))
    fit = fit_to(before, [log.trial for log in logs], thread_count(threads))
    with create_partial(out) as file, as_write_error(out):
        file.write(fit.robot.mjcf.encode())
        publish(file, out)
    result = {
        "robot": before.name,
        "logs": [str(path) for path in files],
        "model": str(out),
        "parameters": [
            {"name": name, "factor": float(factor), "deviation": float(deviation)}
            for name, factor, deviation in zip(
                factor_names(before), fit.parameters.factors, fit.deviations, strict=True
            )
        ],
        "delay": fit.parameters.delay,
        "delay_before": before.control_delay,
        "error_before": fit.error_before,
        "error": fit.error,
        "as_it_was": fit.robot is before,
        "seconds": perf_counter() - start,
    }
    if as_json:
        typer.echo(json.dumps(result, indent=2, allow_nan=False))
    else:
        _print(result)


def _refuse_assets(robot: "Robot", where: str) -> None:
    if robot.assets:
        raise InputError(
            f"{where}: its model names other files ({', '.join(sorted(robot.assets))}), and what "
            f"calibrate writes is one MJCF that stands alone: give --robot a model without them, "
            f"or let diagnose calibrate for itself by giving it these logs too"
        )


def _print(result: dict[str, Any]) -> None:
    from selfmodel.cli.output.plain import plain  # noqa: PLC0415  # only where it is printed
    from selfmodel.cli.output.tables import show  # noqa: PLC0415  # the same

    rows = [
        (plain(one["name"]), "1", f"{one['factor']:.3f}", f"± {100 * one['deviation']:.1f} %")
        for one in result["parameters"]
    ]
    show(("factor of", "before", "fitted", "uncertainty"), rows)
    typer.echo(f"delay, control steps: {result['delay']} ({result['delay_before']} before)")
    typer.echo(
        f"error of predicted motion: {result['error']:.3f} ({result['error_before']:.3f} before), "
        f"the root mean square over 10 steps, in the units of docs/calibration.md"
    )
    if result["as_it_was"]:
        typer.echo("The model predicts the logs exactly already: it is left as it was.")
    count = len(result["logs"])
    typer.echo(
        plain(
            f"{result['model']}: {result['robot']} as fitted to "
            f"{count} {'log' if count == 1 else 'logs'} in {result['seconds']:.1f} s"
        )
    )
