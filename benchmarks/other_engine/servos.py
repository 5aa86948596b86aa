"""Position servos: a motor with a rotor, and an elastic gear between the rotor and the joint.

PyBullet's own position control is a velocity constraint with a largest force: up to that force it
is infinitely stiff, whatever the gain, so the softness of a servo, on which the gaits live, would
be lost. MuJoCo's actuators are a spring and a damper on the joint, with the inertia of the rotor
added to that of the joint, which Bullet's multibodies do not offer. Here the rotor is a body of its
own, as in hardware: the servo controls the angle of the rotor with the gains and the torque limits
of the MJCF; the armature of the joint is its inertia, and the damping of the joint acts on it. The
gear transmits the torque; an elastic gear is the usual model of one.
Source: M. W. Spong, Modeling and control of elastic joint robots, J. Dyn. Syst. 109 (1987).
"""

from dataclasses import dataclass

import numpy as np

from benchmarks.other_engine.reality import SUBSTEP, Reality
from selfmodel.robot.robot import Robot

GEAR_DAMPING = 0.001
"""Damping of a gear per stiffness, s: oscillations of a lower leg end within some 10 ms."""


@dataclass(frozen=True, eq=False)
class Motors:
    """Constants of some motors, ``(motors,)`` each.

    Attributes:
        hinges: Name of the hinge of each.
        stiffness: Torque per angle of the position control, N m/rad.
        damping: Torque per angular velocity of the control, N m s/rad.
        limit: Largest torque, N m.
        factor: Factor of the torque.
        inertia: Inertia of the rotor at the joint, kg m^2.
        friction: Viscous friction of the rotor, N m s/rad.
        gear_stiffness: N m/rad.
    """

    hinges: tuple[str, ...]
    stiffness: np.ndarray
    damping: np.ndarray
    limit: np.ndarray
    factor: np.ndarray
    inertia: np.ndarray
    friction: np.ndarray
    gear_stiffness: float


def motors_of(robot: Robot, reality: Reality) -> Motors:
    """Returns the motors of a robot, in the order of its model."""
    model = robot.model
    joints = model.actuator_trnid[:, 0]
    dofs = model.jnt_dofadr[joints]
    return Motors(
        hinges=tuple(model.joint(joint).name for joint in joints),
        stiffness=model.actuator_gainprm[:, 0].copy(),
        damping=-model.actuator_biasprm[:, 2],
        limit=model.actuator_forcerange[:, 1].copy(),
        factor=np.array(reality.torques),
        inertia=model.dof_armature[dofs].copy(),
        friction=model.dof_damping[dofs].copy(),
        gear_stiffness=reality.gear_stiffness,
    )


class Servos:
    """The servos in motion.

    Args:
        motors: The motors.
        angles: Angles of the joints at rest, rad, ``(motors,)``.
    """

    def __init__(self, motors: Motors, angles: np.ndarray) -> None:
        self._motors = motors
        self._angles, self._speeds = angles.copy(), np.zeros_like(angles)

    def step(self, targets: np.ndarray, angles: np.ndarray, speeds: np.ndarray) -> np.ndarray:
        """Returns the torques of the gears on the joints over a substep, ``(motors,)`` N m.

        Args:
            targets: Target angles, rad.
            angles: Angles of the joints, rad.
            speeds: Angular velocities of the joints, rad/s.
        """
        motors = self._motors
        torque = motors.stiffness * (targets - self._angles) - motors.damping * self._speeds
        torque = np.clip(motors.factor * torque, -motors.limit, motors.limit)
        twist = self._angles - angles + GEAR_DAMPING * (self._speeds - speeds)
        gear = motors.gear_stiffness * twist
        acceleration = (torque - motors.friction * self._speeds - gear) / motors.inertia
        self._speeds = self._speeds + SUBSTEP * acceleration
        self._angles = self._angles + SUBSTEP * self._speeds
        return np.asarray(gear)
