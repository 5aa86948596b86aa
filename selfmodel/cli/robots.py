"""``selfmodel robots``: the robots of selfmodel, and the parts of a robot or a file."""

from typing import Any

from selfmodel.arguments import is_model, notes_on, robot_entry
from selfmodel.cli.commands import Robots
from selfmodel.cli.output.printing import print_json, print_lines
from selfmodel.cli.output.robot_parts import parts, print_parts
from selfmodel.cli.output.tables import folding, print_tables
from selfmodel.robot.designs import network_for
from selfmodel.tasks import ROBOTS, Entry


def robots(options: Robots) -> None:
    """List the robots; with ROBOT, its joints, sensors, motors, faults and cases of Table I."""
    if options.robot is None:
        every = [_facts(robot_entry(name)) for name in ROBOTS]
        if options.as_json:
            print_json({"robots": every})
        else:
            _print_all(every)
        return
    entry = robot_entry(options.robot, options.model_settings or ())
    notes = notes_on(options.robot, options.model_settings or ()) if is_model(options.robot) else ()
    facts = {**_facts(entry), **parts(entry.robot()), "notes": list(notes)}
    if options.as_json:
        print_json(facts)
        return
    print_parts(facts)
    print_lines(*(f"note: {note}" for note in notes))


def _facts(entry: Entry) -> dict[str, Any]:
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
    rows = [
        (
            one["robot"],
            *(str(len(one[parts])) for parts in ("joints", "hinges", "sensors")),
            str(one["weights"]),
            ", ".join(one["tasks"]),
            f"1 to {len(one['cases'])}",
        )
        for one in facts
    ]
    columns = ("robot", "joints", "hinges", "sensors", "weights", "tasks", "cases")
    print_tables(folding(columns, rows))
    print_lines(
        "`selfmodel robots ROBOT` lists its parts and cases; `selfmodel suite list` the bodies of "
        "dm_control's suite."
    )
