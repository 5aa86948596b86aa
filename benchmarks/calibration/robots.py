"""Physical robots with known parameters, for ``benchmarks.calibration.coverage``: plain MuJoCo.

A drawn robot is the model of a robot with edited arrays, stepped by ``mj_step``. Its commands are
those of a gait of the bank on the nominal model, played back.
"""

from collections import deque
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.robot.scaling import scale_contacts
from selfmodel.studies.recoveries import bank_gait
from selfmodel.trials.trajectory import collect
from selfmodel.trials.trial import Trial

MAX_DELAY = 2
"""Largest control delay, control steps."""

NOISE = {
    "joint_positions": 0.01,
    "joint_velocities": 0.1,
    "base_position": 0.005,
    "base_linear_velocity": 0.03,
    "base_angular_velocity": 0.03,
}
"""Standard deviation of the noise of each logged signal at a spread of 0.1, in its unit."""

TILT_NOISE = 0.01
"""Standard deviation of the logged orientation at a spread of 0.1, rad."""


@dataclass(frozen=True, eq=False)
class Truth:
    """Parameters of one physical robot, as factors of the nominal ones.

    Attributes:
        masses: Factor of the mass and inertia of each body, ``(bodies,)``.
        friction: Factor of the sliding friction.
        damping: Factor of the damping of the joints.
        gains: Factor of the torque of each motor, ``(motors,)``.
        delay: Control delay, control steps.
        noise: Noise of the log, in units of ``NOISE``.
        contacts: Factors of the stiffness and of the damping of contacts.
    """

    masses: FloatArray
    friction: float
    damping: float
    gains: FloatArray
    delay: int
    noise: float
    contacts: tuple[float, float] = (1.0, 1.0)

    def factors(self, model: mujoco.MjModel, root: str) -> FloatArray:
        """Returns the factors in the order of ``Parameters.factors``.

        The factor of the limbs is that of their total mass.
        """
        limbs = np.ones(model.nbody, dtype=bool)
        limbs[[0, model.body(root).id]] = False
        mass = model.body_mass[limbs]
        limb = float(mass @ self.masses[limbs] / mass.sum())
        root_mass = float(self.masses[model.body(root).id])
        return np.array([root_mass, limb, self.friction, self.damping, *self.gains])


def drawn(model: mujoco.MjModel, spread: float, rng: np.random.Generator) -> Truth:
    """Returns a random robot: masses, gains 1 + spread N; friction, damping 1 + 2 spread N."""
    friction, damping = 1 + 2 * spread * rng.standard_normal(2)
    return Truth(
        masses=np.maximum(0.2, 1 + spread * rng.standard_normal(model.nbody)),
        friction=float(max(0.2, friction)),
        damping=float(max(0.2, damping)),
        gains=np.maximum(0.2, 1 + spread * rng.standard_normal(model.nu)),
        delay=int(rng.integers(MAX_DELAY + 1)),
        noise=spread / 0.1,
    )


def commands_of(robot: Robot, bank: Path, number: int, steps: int) -> FloatArray:
    """Returns the commands of a gait of the bank on the nominal model, ``(steps, motors)``."""
    samples = SimulatedRobot(robot).run(bank_gait(bank, robot.name, number), steps)
    return np.asarray(collect(robot.anatomy.names, samples)["commands"])


def logged(
    robot: Robot, truth: Truth, commands: FloatArray, rng: np.random.Generator, name: str
) -> Trial:
    """Returns the noisy log of a physical robot under commands."""
    model = mujoco.MjModel.from_xml_string(robot.mjcf)
    model.body_mass *= truth.masses
    model.body_inertia *= truth.masses[:, np.newaxis]
    model.geom_friction[:, 0] *= truth.friction
    model.pair_friction[:, :2] *= truth.friction
    model.dof_damping *= truth.damping
    scale_contacts(model, *truth.contacts)
    model.actuator_gainprm *= truth.gains[:, np.newaxis]
    model.actuator_biasprm *= truth.gains[:, np.newaxis]
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    mujoco.mj_resetData(model, data)
    hinges = [model.joint(hinge) for hinge in robot.anatomy.hinges]
    positions = [int(hinge.qposadr[0]) for hinge in hinges]
    velocities = [int(hinge.dofadr[0]) for hinge in hinges]
    line = deque(np.zeros((truth.delay, model.nu)))
    states = []
    for command in commands:
        states.append((data.qpos.copy(), data.qvel.copy()))
        line.append(command)
        data.ctrl[:] = line.popleft()
        mujoco.mj_step(model, data, robot.substeps)
    qpos, qvel = (np.array(values) for values in zip(*states, strict=True))
    exact = {
        "joint_positions": qpos[:, positions],
        "joint_velocities": qvel[:, velocities],
        "base_position": qpos[:, :3],
        "base_linear_velocity": qvel[:, :3],
        "base_angular_velocity": qvel[:, 3:6],
    }
    noisy = {
        signal: values + truth.noise * NOISE[signal] * rng.standard_normal(values.shape)
        for signal, values in exact.items()
    }
    orientation = qpos[:, 3:7].copy()
    for row in orientation:
        mujoco.mju_quatIntegrate(row, truth.noise * TILT_NOISE * rng.standard_normal(3), 1.0)
    return Trial.from_arrays(
        robot,
        noisy["joint_positions"],
        commands,
        joint_velocities=noisy["joint_velocities"],
        base_position=noisy["base_position"],
        base_orientation=orientation,
        base_linear_velocity=noisy["base_linear_velocity"],
        base_angular_velocity=noisy["base_angular_velocity"],
        stage="before",
        name=name,
    )
