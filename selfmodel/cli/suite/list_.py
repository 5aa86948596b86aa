"""``selfmodel suite list``: every body that comes with selfmodel or with dm_control's suite."""

import json
from typing import Any

import typer

from selfmodel.cli.options import Json


def list_bodies(*, as_json: Json = False) -> None:
    """List the domains: their tasks, joints, sensors, motors, time steps and failures."""
    # Whatever brings MuJoCo waits until the command runs.
    from selfmodel.cli.output.tables import show  # noqa: PLC0415
    from selfmodel.experiments.suite.bodies import DOMAINS  # noqa: PLC0415

    found = [_facts(domain) for domain in DOMAINS]
    if as_json:
        typer.echo(json.dumps({"domains": found}, indent=2, allow_nan=False))
        return
    columns = ("domain", "tasks", "cases", "joints", "sensors", "motors", "weights", "step, s")
    rows = [
        [
            one["domain"],
            ", ".join(one["tasks"]),
            _ranges([int(number) for number in one["cases"]]),
            *(str(one[key]) for key in ("joints", "sensors", "motors", "weights")),
            f"{one['physics_timestep']:g} x {one['substeps']}",
        ]
        for one in found
    ]
    show(columns, rows, texts=3)
    typer.echo("A robot's name is DOMAIN-TASK for those of the suite: `selfmodel robots NAME`.")


def _facts(domain: str) -> dict[str, Any]:
    from selfmodel.experiments.robots import robot_entry  # noqa: PLC0415
    from selfmodel.experiments.suite.bodies import DOMAINS, bodies  # noqa: PLC0415
    from selfmodel.robot.designs import network_for  # noqa: PLC0415

    entry = robot_entry(bodies([domain], None)[0])
    robot = entry.robot()
    return {
        "domain": domain,
        "tasks": list(DOMAINS[domain]),
        "robots": list(bodies([domain], DOMAINS[domain])),
        "joints": len(robot.anatomy.joints),
        "hinges": len(robot.anatomy.hinges),
        "sensors": len(robot.anatomy.sensors),
        "motors": len(robot.anatomy.motors),
        "weights": network_for(robot).weights,
        "physics_timestep": float(robot.model.opt.timestep),
        "substeps": robot.substeps,
        "control_timestep": robot.control_timestep,
        "cases": {str(number): notation for number, notation in entry.cases.items()},
    }


def _ranges(numbers: list[int]) -> str:
    """Numbers in their order, what follows on one another as ``1 to 3``."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and runs[-1][-1] == number - 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(
        f"{run[0]} to {run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in runs
    )
