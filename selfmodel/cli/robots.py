"""``selfmodel robots``: the robots that come with it, and the parts of one."""

import json
from typing import TYPE_CHECKING, Annotated, Any

import typer

from selfmodel.cli.options import Json

if TYPE_CHECKING:
    from selfmodel.tasks import Entry


def robots(
    robot: Annotated[
        str | None, typer.Argument(metavar="[ROBOT]", help="Show the parts of this one.")
    ] = None,
    *,
    as_json: Json = False,
) -> None:
    """List the robots, or the parts and failure cases of one."""
    # The robots bring MuJoCo, which takes longer to import than the help takes to print.
    from selfmodel.cli.resolve import robot_entry  # noqa: PLC0415
    from selfmodel.tasks import ROBOTS  # noqa: PLC0415

    names = [robot] if robot else list(ROBOTS)
    facts = [_facts(name, robot_entry(name)) for name in names]
    if as_json:
        typer.echo(json.dumps(facts[0] if robot else {"robots": facts}, indent=2))
    elif robot:
        _print_one(facts[0])
    else:
        _print_all(facts)


def _facts(name: str, entry: "Entry") -> dict[str, Any]:
    made = entry.robot()
    return {
        "robot": name,
        "joints": [joint.name for joint in made.anatomy.joints],
        "hinges": list(made.anatomy.hinges),
        "sensors": [sensor.name for sensor in made.anatomy.sensors],
        "motors": list(made.anatomy.motors),
        "hidden_neurons": made.anatomy.neurons,
        "weights": made.network.weights,
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
    typer.echo("`selfmodel robots ROBOT` lists its parts and cases.")


def _print_one(facts: dict[str, Any]) -> None:
    from rich.console import Console  # noqa: PLC0415  # only where a table is drawn
    from rich.table import Table  # noqa: PLC0415

    table = Table("part", "names", title=facts["robot"])
    for kind in ("joints", "hinges", "sensors", "motors"):
        table.add_row(kind, ", ".join(facts[kind]))
    cases = Table("case", "damage", title="failures of Table I")
    cases.columns[1].overflow = "fold"
    for number, notation in facts["cases"].items():
        cases.add_row(number, notation)
    Console().print(table, cases)
