"""``selfmodel suite list``: the bodies of selfmodel and of dm_control's suite."""

from typing import Any

from selfmodel.arguments import robot_entry
from selfmodel.cli.arguments.options import Json
from selfmodel.cli.output.printing import print_json, print_lines
from selfmodel.cli.output.tables import show
from selfmodel.experiments.suite.bodies import DOMAINS, bodies
from selfmodel.robot.designs import network_for


def list_bodies(*, as_json: Json = False) -> None:
    """List the domains with their tasks, cases, joints, sensors, motors and time steps."""
    found = [_facts(domain) for domain in DOMAINS]
    if as_json:
        print_json({"domains": found})
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
    print_lines(
        "Robots of the suite are called DOMAIN-TASK: `selfmodel robots NAME` lists the parts."
    )


def _facts(domain: str) -> dict[str, Any]:
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
    """Returns ascending numbers as text, with three or more consecutive ones as ``1 to 3``."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and runs[-1][-1] == number - 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(
        f"{run[0]} to {run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in runs
    )
