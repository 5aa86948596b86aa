"""The compiled model of a robot with its gap and its faults."""

import mujoco
import numpy as np

from benchmarks.foreign.faults import Fault
from benchmarks.foreign.robots import Robot
from benchmarks.foreign.world.damage import damaged
from benchmarks.foreign.world.gap import Gap, apply_gap, set_grip


def compiled(
    robot: Robot, gap: Gap, faults: tuple[Fault, ...], angles: dict[str, float] | None = None
) -> mujoco.MjModel:
    """Returns the model of a robot.

    Args:
        robot: The robot.
        gap: Difference between the robot and its model.
        faults: The faults.
        angles: Angle of each hinge that jams where it is, rad.
    """
    model = damaged(robot, faults, angles or {}).compile()
    apply_gap(model, robot, gap)
    for fault in faults:
        _change(model, robot, gap, fault)
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def _change(model: mujoco.MjModel, robot: Robot, gap: Gap, fault: Fault) -> None:
    """Changes the numbers of a compiled model by a fault of a joint, a body or the ground."""
    match fault.kind:
        case "motor" | "damping" | "joint-friction":
            _change_joint(model, robot, fault)
        case "friction":
            model.geom_friction[:, 0] = fault.value
            for name, factor in gap.grip.items():
                set_grip(model, name, factor)
        case "grip":
            set_grip(model, robot.part(fault.part).body, fault.value)
        case "heavy-limb":
            body = model.body(fault.part).id
            model.body_mass[body] *= fault.value
            model.body_inertia[body] *= fault.value
        case "soft-ground":
            model.geom_solref[:] = (-fault.value, -fault.value / 20)
        case "short-range":
            middle = float(model.joint(fault.part).range.mean())
            model.joint(fault.part).range = (middle - fault.value, middle + fault.value)


def _change_joint(model: mujoco.MjModel, robot: Robot, fault: Fault) -> None:
    """Changes the motors, the damping or the dry friction of the hinges of a part."""
    motors, dofs = _motors(model, robot, fault.part), _dofs(model, robot, fault.part)
    match fault.kind:
        case "motor":
            model.actuator_gainprm[motors] *= fault.value
            model.actuator_biasprm[motors] *= fault.value
            model.actuator_forcerange[motors] *= fault.value
        case "damping":
            model.dof_damping[dofs] *= fault.value
        case "joint-friction":
            model.dof_frictionloss[dofs] += fault.value * model.actuator_forcerange[motors, 1]


def _dofs(model: mujoco.MjModel, robot: Robot, part: str) -> list[int]:
    return [int(model.joint(hinge).dofadr[0]) for hinge in robot.part(part).hinges]


def _motors(model: mujoco.MjModel, robot: Robot, part: str) -> list[int]:
    hinges = robot.part(part).hinges
    names = [motor for motor, hinge in robot.motors.items() if hinge in hinges]
    found = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, name) for name in names]
    return [int(number) for number in np.array(found, dtype=int) if number >= 0]
