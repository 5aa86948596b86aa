"""Checks the numbers of a robot's model: does its motion depend on the physics time step, and why?

A search finds the controllers that a coarse step flatters. MuJoCo integrates damping implicitly,
but computes contacts without it: a joint that its damping stops within a step moves where its
contacts do not hold it.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np

from selfmodel.controllers.controller import Controller, draw_genomes
from selfmodel.errors import listed
from selfmodel.faults.hypothesis import INTACT
from selfmodel.robot.actuators import has_feedback, motor_joints
from selfmodel.robot.designs import cpg_for
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator

GAITS, SECONDS, SAMPLE = 16, 2.0, 0.1
"""Number of random gaits from the initial pose, their length, and the time between two places of
the base, s, whose distances are summed: that from the start to the end differs by chance more."""

PARTS = (1, 2, 4)
"""Physics steps in place of each, under which the gaits are compared."""

TOLERANCE = 0.1
"""Relative change of path or joint speed at a quarter of the time step, from which on the motion
depends on it. Robots of selfmodel and bodies of dm_control's suite change by at most 0.07."""

STABLE = 2.0
"""Largest damping times time step, relative to the inertia of the joint, without a note: from there
on, an explicit integration of the damping would be unstable."""

MARGIN = 1.05
"""Factor of the least armature that is advised."""

_MAX_LISTED = 6


@dataclass(frozen=True)
class Motion:
    """Mean path of the base, m, joint speed (root mean square), rad/s, and simulations that failed.

    A fixed base has no path.
    """

    path: float
    speed: float
    diverged: int


def model_notes(robot: Robot) -> tuple[str, ...]:
    """Returns what is found about a model whose motion depends on the time step; () for others.

    Each note is one or two sentences, with the setting that it advises.
    """
    motions = [motion_of(robot.finer(parts)) for parts in PARTS]
    if _alike(motions[0], motions[-1]):
        return ()
    return (_of_motion(robot, motions), *_of_damping(robot.model), *_of_contacts(robot.model))


def motion_of(robot: Robot) -> Motion:
    """Returns the motion of a robot with random gaits, the same at any time step."""
    design = cpg_for(robot)
    genomes = draw_genomes(np.random.default_rng(0), (GAITS, design.weights))
    steps = max(2, round(SECONDS / robot.control_timestep))
    outcome = Simulator(robot).run(
        [(INTACT, Controller(design, genome)) for genome in genomes],
        steps,
        ["base_position", "joint_velocities"],
    )
    every = max(1, round(SAMPLE / robot.control_timestep))
    places, well = outcome.trajectory["base_position"][:, ::every], ~outcome.diverged
    speeds = outcome.trajectory["joint_velocities"][well]
    ways = np.linalg.norm(np.diff(places[well], axis=1), axis=-1).sum(axis=1)
    mean = [float(np.mean(of)) if well.any() else np.nan for of in (ways, speeds**2)]
    return Motion(mean[0], float(np.sqrt(mean[1])), int(outcome.diverged.sum()))


def _alike(coarse: Motion, fine: Motion) -> bool:
    pairs = ((coarse.path, fine.path), (coarse.speed, fine.speed))
    same = all(abs(one - other) <= TOLERANCE * other for one, other in pairs)
    return same and not coarse.diverged and not fine.diverged


def _of_motion(robot: Robot, motions: list[Motion]) -> str:
    step = float(robot.model.opt.timestep)
    paths, speeds, failed = (
        "{}, {} and {}".format(*(f"{getattr(one, name):.3g}" for one in motions))
        for name in ("path", "speed", "diverged")
    )
    went = "" if robot.has_fixed_base else f"the base goes {paths} m, and "
    diverged = f", and {failed} diverge" if any(one.diverged for one in motions) else ""
    parts = 2 if _alike(motions[1], motions[2]) else PARTS[-1]
    return (
        f"the motion depends on the physics time step: in {GAITS} random gaits of {SECONDS:g} s, "
        f"at {step:.4g} s, a half and a quarter of it, {went}the joints turn at {speeds} rad/s"
        f"{diverged}. A search may find gaits that no robot walks: set timestep to "
        f"{step / parts:.6g}{'' if parts == 2 else ' or less'}"
    )


def _of_damping(model: mujoco.MjModel) -> Iterator[str]:
    """Yields a note on the servos whose damping, and that of the joint, stops it within a step."""
    step, steps, armature = float(model.opt.timestep), dict[str, float](), 0.0
    for motor in range(model.nu):
        joints = motor_joints(model, motor)
        if len(joints) != 1 or not has_feedback(model, motor):
            continue
        dof = int(model.jnt_dofadr[min(joints)])
        own = -model.actuator_biasprm[motor, 2] * model.actuator_gear[motor, 0] ** 2
        damping, inertia = float(own + model.dof_damping[dof]), float(model.dof_M0[dof])
        if damping * step > STABLE * inertia:
            steps[model.joint(min(joints)).name] = inertia / (damping * step)
            lacking = damping * step / STABLE - inertia
            armature = max(armature, float(model.dof_armature[dof]) + MARGIN * lacking)
    if steps:
        yield (
            f"the joints {listed([*steps], _MAX_LISTED)} and the rotors of their servos have so "
            f"little inertia that their damping (kd and damping) stops them within "
            f"{min(steps.values()):.2g} time steps: set armature, the inertia of the rotors at the "
            f"joints, to {armature:.2g} kg m², or less damping"
        )


def _of_contacts(model: mujoco.MjModel) -> Iterator[str]:
    """Yields a note on contacts whose time constant MuJoCo lengthens to two time steps."""
    least = 2 * float(model.opt.timestep)
    limited = not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_REFSAFE
    constants = model.geom_solref[model.geom_contype | model.geom_conaffinity > 0, 0]
    short = constants[(constants > 0) & (constants < least)]
    if limited and len(short):
        yield (
            f"contacts have a time constant of {short.min():.3g} s, which MuJoCo lengthens to two "
            f"time steps: set solref to [{least:.4g}, 1], or timestep to {short.min() / 2:.4g}"
        )
