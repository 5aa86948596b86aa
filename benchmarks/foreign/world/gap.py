"""The difference between a robot as it is and its model: drawn once per robot of a case."""

from dataclasses import dataclass

import mujoco
import numpy as np

from benchmarks.foreign.robots import Robot

LEVELS = {"none": 0.0, "moderate": 0.5, "large": 1.0}
"""Size of each gap, relative to the large one."""


@dataclass(frozen=True)
class Gap:
    """One robot's gap. Factors are by name, so that a robot with fewer parts has the same ones.

    Attributes:
        size: Size relative to the large gap.
        mass: Factor of the mass of each body.
        gain: Factor of the gain of each motor.
        damping: Factor of the damping of each hinge.
        joint_friction: Dry friction of each hinge, N m.
        grip: Factor of the friction of each foot's body.
        shift: Displacement of the root body's centre of mass, ``(3,)`` m.
        ground: Factor of the friction of the ground.
        latency: Delay of commands, s.
        latency_spread: Largest deviation of the delay of one command, s.
        timestep: Physics time step, s; None for the model's.
    """

    size: float
    mass: dict[str, float]
    gain: dict[str, float]
    damping: dict[str, float]
    joint_friction: dict[str, float]
    grip: dict[str, float]
    shift: np.ndarray
    ground: float
    latency: float
    latency_spread: float
    timestep: float | None


def draw_gap(robot: Robot, size: float, rng: np.random.Generator) -> Gap:
    """Returns the gap of a robot; the draws are the same for every size."""
    bodies = [body.name for body in robot.spec().bodies if body.name]

    def factors(names: list[str], spread: float) -> dict[str, float]:
        return {name: 1 + size * spread * rng.uniform(-1, 1) for name in names}

    return Gap(
        size=size,
        mass=factors(bodies, 0.1),
        gain=factors(list(robot.motors), 0.1),
        damping=factors(list(robot.hinges), 0.2),
        joint_friction={name: size * rng.uniform(0, 0.1) for name in robot.hinges},
        grip=factors(list(robot.touches.values()), 0.1),
        shift=size * 0.01 * rng.uniform(-1, 1, 3) / np.sqrt(3),
        ground=1 - 0.2 * size,
        latency=0.02 * size,
        latency_spread=0.004 * size,
        timestep=0.001 if size else None,
    )


def apply_gap(model: mujoco.MjModel, robot: Robot, gap: Gap) -> None:
    """Changes a compiled model by a gap; without a gap, nothing changes."""
    if not gap.size:
        return
    for name, factor in gap.mass.items():
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
        if body > 0:
            model.body_mass[body] *= factor
            model.body_inertia[body] *= factor
    model.body(robot.root).ipos += gap.shift
    for name, factor in gap.gain.items():
        motor = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, name)
        if motor >= 0:
            model.actuator_gainprm[motor] *= factor
            model.actuator_biasprm[motor] *= factor
    for name, factor in gap.damping.items():
        joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
        if joint >= 0:
            model.dof_damping[model.jnt_dofadr[joint]] *= factor
            model.dof_frictionloss[model.jnt_dofadr[joint]] += gap.joint_friction[name]
    model.geom_friction[:, 0] *= gap.ground
    for name, factor in gap.grip.items():
        set_grip(model, name, factor)
    model.opt.timestep = gap.timestep
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    mujoco.mj_setConst(model, mujoco.MjData(model))


def set_grip(model: mujoco.MjModel, body: str, factor: float) -> None:
    """Scales the friction of a foot, which then takes precedence over that of the ground."""
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, body)
    if number > 0:
        geoms = np.flatnonzero(model.geom_bodyid == number)
        model.geom_friction[geoms, 0] *= factor
        model.geom_priority[geoms] = 1
