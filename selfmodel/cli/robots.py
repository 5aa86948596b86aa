"""``selfmodel robots``: the robots that come with it, and the parts of one or of your own."""

import json
from typing import TYPE_CHECKING, Annotated, Any

import typer

from selfmodel.cli.options import Json, ModelSettings
from selfmodel.cli.output.plain import plain

if TYPE_CHECKING:
    from selfmodel.tasks import Entry


def robots(
    robot: Annotated[
        str | None,
        typer.Argument(
            metavar="[ROBOT|ROBOT.xml]", help="Show the parts of this one, or of an MJCF of yours."
        ),
    ] = None,
    *,
    model_settings: ModelSettings = None,
    as_json: Json = False,
) -> None:
    """List the robots, or the parts and failure cases of one."""
    # The robots bring MuJoCo, which takes longer to import than the help takes to print.
    from selfmodel.cli.output.robot_parts import parts, print_parts  # noqa: PLC0415
    from selfmodel.experiments.robots import is_model, notes_on, robot_entry  # noqa: PLC0415
    from selfmodel.tasks import ROBOTS  # noqa: PLC0415

    if robot is None:
        every = [_facts(robot_entry(name)) for name in ROBOTS]
        if as_json:
            typer.echo(json.dumps({"robots": every}, indent=2))
        else:
            _print_all(every)
        return
    entry = robot_entry(robot, model_settings or ())
    notes = notes_on(robot, model_settings or ()) if is_model(robot) else ()
    facts = {**_facts(entry), **parts(entry.robot()), "notes": list(notes)}
    if as_json:
        typer.echo(json.dumps(facts, indent=2, allow_nan=False))
        return
    print_parts(facts)
    _print_cases(facts)
    for note in notes:
        typer.echo(plain(f"note: {note}"))


def _facts(entry: "Entry") -> dict[str, Any]:
    from selfmodel.robot.designs import network_for  # noqa: PLC0415  # imports MuJoCo

    made = entry.robot()
    network = network_for(made)
    return {
        "robot": made.name,
        "joints": [joint.name for joint in made.anatomy.joints],
        "hinges": list(made.anatomy.hinges),
        "sensors": [sensor.name for sensor in made.anatomy.sensors],
        "motors": list(made.anatomy.motors),
        "hidden_neurons": network.hidden,
        "weights": network.weights,
        "control_timestep": made.control_timestep,
        "tasks": list(entry.suite),
        "cases": {str(number): notation for number, notation in entry.cases.items()},
    }


def _print_all(facts: list[dict[str, Any]]) -> None:
    from rich.console import Console  # noqa: PLC0415  # only where a table is drawn
    from rich.table import Table  # noqa: PLC0415

    table = Table("robot", "joints", "hinges", "sensors", "weights", "tasks", "cases")
    for one in facts:
        counts = (len(one["joints"]), len(one["hinges"]), len(one["sensors"]), one["weights"])
        table.add_row(
            one["robot"], *map(str, counts), ", ".join(one["tasks"]), f"1 to {len(one['cases'])}"
        )
    Console().print(table)
    typer.echo(
        "`selfmodel robots ROBOT` lists its parts and cases; `selfmodel suite list` the bodies of "
        "dm_control's suite."
    )


def _print_cases(facts: dict[str, Any]) -> None:
    from rich.console import Console  # noqa: PLC0415  # only where a table is drawn
    from rich.table import Table  # noqa: PLC0415

    if not facts["cases"]:
        return
    cases = Table("case", "damage", title="failures of Table I")
    cases.columns[1].overflow = "fold"
    for number, notation in facts["cases"].items():
        cases.add_row(number, notation)
    Console().print(cases)
