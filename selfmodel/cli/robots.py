"""``selfmodel robots`` and ``suite list``: the robots, their parts, faults and cases of Table I."""

from itertools import groupby
from typing import Any

from selfmodel import arguments
from selfmodel.cli.commands import ListSuite, Robots
from selfmodel.cli.output import print_json, print_lines
from selfmodel.cli.tables import folding, print_tables, show
from selfmodel.faults.registry import ALL_KINDS
from selfmodel.robot.actuators import command_ranges, motor_joints
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import FixedBase, FreeBase, read_base
from selfmodel.simulation.model_check import model_notes
from selfmodel.studies import bodies
from selfmodel.tasks import ROBOTS, Entry


def robots(options: Robots) -> None:
    """List the robots; with ROBOT, its joints, sensors, motors, faults and cases of Table I."""
    if options.robot is None:
        every = [_facts(arguments.robot_entry(name)) for name in ROBOTS]
        if options.as_json:
            print_json({"robots": every})
        else:
            _print_all(every)
        return
    entry = arguments.robot_entry(options.robot, options.model_settings or ())
    robot, notes = entry.robot(), list[str]()
    if arguments.is_model(options.robot):
        notes = [*robot.notes, *model_notes(robot)]
    facts = {**_facts(entry), **_parts(robot), "notes": notes}
    if options.as_json:
        print_json(facts)
        return
    _print_parts(facts)
    print_lines(*(f"note: {note}" for note in notes))


def list_bodies(options: ListSuite) -> None:
    """List the domains with their tasks, cases, joints, sensors, motors and time steps."""
    found = [_domain_facts(domain) for domain in bodies.DOMAINS]
    if options.as_json:
        print_json({"domains": found})
        return
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
    columns = ("domain", "tasks", "cases", "joints", "sensors", "motors", "weights", "step, s")
    show(columns, rows, texts=3)
    print_lines(
        "Robots of the suite are called DOMAIN-TASK: `selfmodel robots NAME` lists the parts."
    )


def _facts(entry: Entry) -> dict[str, Any]:
    robot = entry.robot()
    network = network_for(robot)
    return {
        "robot": robot.name,
        "joints": [joint.name for joint in robot.anatomy.joints],
        "hinges": list(robot.anatomy.hinges),
        "sensors": [sensor.name for sensor in robot.anatomy.sensors],
        "motors": list(robot.anatomy.motors),
        "hidden_neurons": network.hidden,
        "weights": network.weights,
        "control_timestep": robot.control_timestep,
        "tasks": list(entry.suite),
        "cases": {str(number): notation for number, notation in entry.cases.items()},
    }


def _domain_facts(domain: str) -> dict[str, Any]:
    entry = arguments.robot_entry(bodies.bodies_of([domain], None)[0])
    facts, robot = _facts(entry), entry.robot()
    return {
        "domain": domain,
        "tasks": list(bodies.DOMAINS[domain]),
        "robots": list(bodies.bodies_of([domain], bodies.DOMAINS[domain])),
        **{parts: len(facts[parts]) for parts in ("joints", "hinges", "sensors", "motors")},
        "weights": facts["weights"],
        "physics_timestep": float(robot.model.opt.timestep),
        "substeps": robot.substeps,
        **{key: facts[key] for key in ("control_timestep", "cases")},
    }


def _ranges(numbers: list[int]) -> str:
    """Returns ascending numbers as text, with three or more consecutive ones as ``1 to 3``."""
    runs = groupby(enumerate(numbers), key=lambda item: item[1] - item[0])
    found = [[number for _, number in run] for _, run in runs]
    return ", ".join(
        f"{run[0]} to {run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in found
    )


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


def _parts(robot: Robot) -> dict[str, Any]:
    """Returns root body, joints, sensors, motors and applicable faults as JSON values."""
    anatomy, model = robot.anatomy, robot.model
    base = read_base([model], robot.root)
    motors = zip(anatomy.motors, command_ranges(model), strict=True)
    kinds = {kind.name: kind.candidates(anatomy) for kind in ALL_KINDS}
    return {
        "root": {
            "body": robot.root,
            "floats": isinstance(base, FreeBase),
            "fixed": isinstance(base, FixedBase),
        },
        "physics_timestep": float(model.opt.timestep),
        "joint_details": [
            {
                "name": joint.name,
                "hinges": list(joint.hinges),
                "limits": [list(ends) for ends in joint.limits],
                "limited": [bool(model.joint(hinge).limited[0]) for hinge in joint.hinges],
                "motors": list(joint.motors),
                "limb": sorted(joint.bodies, key=lambda name: int(model.body(name).id)),
            }
            for joint in anatomy.joints
        ],
        "sensor_details": [
            {"name": s.name, "kind": s.kind, "of": s.hinge or s.body} for s in anatomy.sensors
        ],
        "motor_details": [
            {
                "name": name,
                "drives": [model.joint(j).name for j in sorted(motor_joints(model, motor))],
                "commands": [centre - half, centre + half],
                "force": model.actuator_forcerange[motor].tolist()
                if model.actuator_forcelimited[motor]
                else None,
            }
            for motor, (name, (centre, half)) in enumerate(motors)
        ],
        "faults": [
            {"kind": name, "parts": len(found), "example": str(found[-1])}
            for name, found in kinds.items()
            if found
        ],
    }


def _print_parts(facts: dict[str, Any]) -> None:
    root = "slides, and turns about one axis"
    if facts["root"]["floats"] or facts["root"]["fixed"]:
        root = "floating" if facts["root"]["floats"] else "fixed to the world"
    about = (
        ("root", f"{facts['root']['body']}, {root}"),
        ("commands", f"every {facts['control_timestep']:g} s"),
        ("physics", f"every {facts['physics_timestep']:g} s"),
        ("controller", f"{facts['hidden_neurons']} neurons, {facts['weights']} weights"),
    )
    joints = (
        (one["name"], _limits(one), ", ".join(one["motors"]), ", ".join(one["limb"]))
        for one in facts["joint_details"]
    )
    sensors = ((one["name"], one["kind"], one["of"]) for one in facts["sensor_details"])
    motors = (
        (one["name"], ", ".join(one["drives"]), _span(one["commands"]), _span(one["force"]))
        for one in facts["motor_details"]
    )
    faults = ((one["kind"], str(one["parts"]), one["example"]) for one in facts["faults"])
    limits = ("joint", "hinges, rad", "motors", "limb beyond it")
    drives = ("motor", "drives", "commands", "force")
    tables = [
        folding(("part", "value"), about, title=facts["robot"]),
        folding(limits, joints, title="joints, which can break or jam"),
        folding(("sensor", "kind", "of"), sensors, title="sensors, which can fail"),
        folding(drives, motors, title="motors"),
        folding(("kind", "faults", "such as"), faults, title="faults that can be hypothesised"),
    ]
    if cases := facts["cases"]:
        tables.append(folding(("case", "damage"), cases.items(), title="failures of Table I"))
    print_tables(*tables)


def _limits(joint: dict[str, Any]) -> str:
    hinges = zip(joint["hinges"], joint["limits"], joint["limited"], strict=True)
    return ", ".join(
        f"{hinge} {_span(ends)}" if limited else f"{hinge}, no limits"
        for hinge, ends, limited in hinges
    )


def _span(ends: list[float] | None) -> str:
    return f"{ends[0]:.3g} to {ends[1]:.3g}" if ends else "no limits"
