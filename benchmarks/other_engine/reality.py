"""What distinguishes one robot in PyBullet from its model: drawn once from a seed."""

from dataclasses import dataclass

import numpy as np

from selfmodel.robot.robot import Robot

SUBSTEP = 0.001
"""Time step of Bullet's physics and of the servos, s: a gear's oscillation takes 15 of them."""


@dataclass(frozen=True)
class Reality:
    """The draws of one robot. Noise is white and normal; levels are standard deviations.

    Attributes:
        seed: Seed of the draws and of the noise.
        masses: Factor of the mass and inertia of each body, in the order of the model.
        torques: Factor of the torque of each motor, in the order of the model.
        gear_stiffness: Torsional stiffness of the gears, N m/rad.
        delay: Time from a command to its effect, in substeps.
        friction: Coefficient of friction between robot and ground.
        restitution: Coefficient of restitution of contacts.
        start_angle: Deviation of the initial joint angles, rad.
        start_tilt: Deviation of the initial roll and pitch of the base, rad.
        angle_noise: Noise of the angle sensors, as a fraction of the range of their hinges.
        touch_flips: Probability that a touch sensor reads the opposite.
        encoder_noise: Noise of the encoders, rad.
        speed_noise: Noise of the angular velocities of joints, rad/s.
        position_noise: Noise of the base position, m.
        tilt_noise: Noise of the base orientation, rad.
        velocity_noise: Noise of the linear velocity of the base, m/s.
        turn_noise: Noise of the angular velocity of the base, rad/s.
    """

    seed: int
    masses: tuple[float, ...]
    torques: tuple[float, ...]
    gear_stiffness: float
    delay: int
    friction: float
    restitution: float
    start_angle: float
    start_tilt: float
    angle_noise: float
    touch_flips: float
    encoder_noise: float
    speed_noise: float
    position_noise: float
    tilt_noise: float
    velocity_noise: float
    turn_noise: float


def draw_reality(robot: Robot, seed: int) -> Reality:
    """Returns the draws of a seed; equal seeds have equal draws."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0,)))
    # The largest coefficient of two geoms is that of their contact in MuJoCo.
    nominal_friction = float(robot.model.geom_friction[:, 0].max())
    return Reality(
        seed=seed,
        masses=_factors(rng, robot.model.nbody),
        torques=_factors(rng, robot.model.nu),
        gear_stiffness=float(rng.uniform(300, 600)),
        delay=int(rng.integers(5, 21)),
        friction=nominal_friction * float(rng.uniform(0.7, 1.1)),
        restitution=float(rng.uniform(0.0, 0.1)),
        start_angle=float(rng.uniform(0.01, 0.03)),
        start_tilt=float(rng.uniform(0.0, 0.01)),
        angle_noise=float(rng.uniform(0.01, 0.05)),
        touch_flips=float(rng.uniform(0.0, 0.02)),
        encoder_noise=float(rng.uniform(0.005, 0.02)),
        speed_noise=float(rng.uniform(0.05, 0.2)),
        position_noise=float(rng.uniform(0.002, 0.01)),
        tilt_noise=float(rng.uniform(0.002, 0.01)),
        velocity_noise=float(rng.uniform(0.02, 0.05)),
        turn_noise=float(rng.uniform(0.02, 0.1)),
    )


def ideal_reality(robot: Robot, seed: int = 0) -> Reality:
    """Returns a robot without noise, delay or deviations of its masses and motors.

    Bullet's contacts and the gears of the servos remain.
    """
    return Reality(
        seed=seed,
        masses=(1.0,) * robot.model.nbody,
        torques=(1.0,) * robot.model.nu,
        gear_stiffness=450.0,
        delay=0,
        friction=float(robot.model.geom_friction[:, 0].max()),
        **dict.fromkeys(("restitution", "start_angle", "start_tilt", "angle_noise"), 0.0),
        **dict.fromkeys(("touch_flips", "encoder_noise", "speed_noise"), 0.0),
        **dict.fromkeys(("position_noise", "tilt_noise", "velocity_noise", "turn_noise"), 0.0),
    )


def _factors(rng: np.random.Generator, count: int) -> tuple[float, ...]:
    """Returns factors within 5 % of 1."""
    return tuple(float(factor) for factor in rng.uniform(0.95, 1.05, count))
