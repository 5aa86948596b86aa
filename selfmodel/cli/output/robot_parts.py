"""The parts of a robot and the faults that apply to them, as JSON values and as tables."""

from typing import Any

import mujoco

from selfmodel.cli.output.tables import folding, print_tables
from selfmodel.faults.registry import ALL_KINDS
from selfmodel.robot.actuators import command_ranges, motor_joints
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import FixedBase, FreeBase, read_base


def parts(robot: Robot) -> dict[str, Any]:
    """Returns root body, joints, sensors, motors and applicable faults as JSON values."""
    anatomy, model = robot.anatomy, robot.model
    base = read_base([model], robot.root)
    ranges = command_ranges(model)
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
                "drives": [model.joint(j).name for j in sorted(motor_joints(model, number))],
                "commands": [centre - half, centre + half],
                "force": _force(model, number),
            }
            for number, (name, (centre, half)) in enumerate(
                zip(anatomy.motors, ranges, strict=True)
            )
        ],
        "faults": [
            {
                "kind": kind.name,
                "parts": len(found),
                "example": str(found[-1]),
            }
            for kind in ALL_KINDS
            if (found := kind.candidates(anatomy))
        ],
    }


def print_parts(facts: dict[str, Any]) -> None:
    """Prints the parts and the cases of Table I.

    Args:
        facts: Result of ``parts``, with the robot's name, its controller and its cases.
    """
    root = "slides, and turns about one axis"
    if facts["root"]["floats"] or facts["root"]["fixed"]:
        root = "floating" if facts["root"]["floats"] else "fixed to the world"
    tables = [
        folding(
            ("part", "value"),
            [
                ("root", f"{facts['root']['body']}, {root}"),
                ("commands", f"every {facts['control_timestep']:g} s"),
                ("physics", f"every {facts['physics_timestep']:g} s"),
                ("controller", f"{facts['hidden_neurons']} neurons, {facts['weights']} weights"),
            ],
            title=facts["robot"],
        ),
        folding(
            ("joint", "hinges, rad", "motors", "limb beyond it"),
            [
                (one["name"], _limits(one), ", ".join(one["motors"]), ", ".join(one["limb"]))
                for one in facts["joint_details"]
            ],
            title="joints, which can break or jam",
        ),
        folding(
            ("sensor", "kind", "of"),
            [(one["name"], one["kind"], one["of"]) for one in facts["sensor_details"]],
            title="sensors, which can fail",
        ),
        folding(
            ("motor", "drives", "commands", "force"),
            [
                (one["name"], ", ".join(one["drives"]), _span(one["commands"]), _span(one["force"]))
                for one in facts["motor_details"]
            ],
            title="motors",
        ),
        folding(
            ("kind", "faults", "such as"),
            [(one["kind"], str(one["parts"]), one["example"]) for one in facts["faults"]],
            title="faults that can be hypothesised",
        ),
    ]
    if facts["cases"]:
        tables.append(
            folding(("case", "damage"), facts["cases"].items(), title="failures of Table I")
        )
    print_tables(*tables)


def _limits(joint: dict[str, Any]) -> str:
    hinges = zip(joint["hinges"], joint["limits"], joint["limited"], strict=True)
    return ", ".join(
        f"{hinge} {_span(ends)}" if limited else f"{hinge}, no limits"
        for hinge, ends, limited in hinges
    )


def _span(ends: list[float] | None) -> str:
    return f"{ends[0]:.3g} to {ends[1]:.3g}" if ends else "no limits"


def _force(model: mujoco.MjModel, motor: int) -> list[float] | None:
    if not model.actuator_forcelimited[motor]:
        return None
    return [float(end) for end in model.actuator_forcerange[motor]]
