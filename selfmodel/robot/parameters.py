"""Continuous parameters of a self-model, and robots with other parameters."""

import dataclasses
from dataclasses import dataclass

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot.control_delay import CONTROL_DELAY, FITTED_CONTACTS
from selfmodel.robot.robot import Robot
from selfmodel.robot.scaling import scale_contacts, scale_model


@dataclass(frozen=True)
class Parameters:
    """Parameters of a self-model as factors of its nominal parameters.

    Attributes:
        root_mass: Factor of the mass and inertia of the root body.
        limb_mass: Factor of the mass and inertia of all other bodies.
        friction: Factor of the sliding friction of all geoms and contact pairs.
        damping: Factor of the damping of all joints.
        motor_gains: Factor of the torque per motor, in the model's order.
        delay: Control delay, in control steps; a multiple of a physics step.
        contact_stiffness: Factor of the stiffness of all contacts.
        contact_damping: Factor of their damping.
    """

    root_mass: float
    limb_mass: float
    friction: float
    damping: float
    motor_gains: tuple[float, ...]
    delay: float = 0
    contact_stiffness: float = 1.0
    contact_damping: float = 1.0

    @property
    def has_other_contacts(self) -> bool:
        """Whether contacts differ from the robot's own."""
        return (self.contact_stiffness, self.contact_damping) != (1.0, 1.0)

    @property
    def factors(self) -> FloatArray:
        """All factors, ``(4 + motors,)``: root, limbs, friction, damping, motors."""
        shared = (self.root_mass, self.limb_mass, self.friction, self.damping)
        return np.array([*shared, *self.motor_gains])


def factor_names(robot: Robot) -> tuple[str, ...]:
    """Returns the names of the scaled quantities, in the order of ``Parameters.factors``."""
    shared = ("mass of the root", "mass of the limbs", "friction", "damping")
    return (*shared, *(f"motor {motor}" for motor in robot.anatomy.motors))


def nominal(robot: Robot) -> Parameters:
    """Returns the parameters of a robot's own model: factors of 1, and its control delay."""
    return Parameters(1.0, 1.0, 1.0, 1.0, (1.0,) * robot.model.nu, robot.control_delay)


def from_factors(factors: FloatArray, delay: float) -> Parameters:
    """Returns parameters from their factors.

    Args:
        factors: ``(4 + motors,)``, in the order of ``Parameters.factors``.
        delay: Control delay, in control steps.
    """
    root, limbs, friction, damping, *motors = (float(factor) for factor in factors)
    return Parameters(root, limbs, friction, damping, tuple(motors), delay)


def model_with_parameters(
    robot: Robot, parameters: Parameters, model: mujoco.MjModel | None = None
) -> mujoco.MjModel:
    """Returns a copy of a model with scaled parameters; the control delay is unchanged.

    Args:
        robot: The robot.
        parameters: The parameters.
        model: Model of the robot with edits of its specification; the robot's own by default.
    """
    model = robot.model if model is None else model
    masses = np.full(model.nbody, parameters.limb_mass)
    masses[0] = 1.0
    masses[model.body(robot.root).id] = parameters.root_mass
    scaled = scale_model(
        model,
        mass=masses,
        inertia=masses,
        friction=parameters.friction,
        damping=parameters.damping,
        motor_gains=np.array(parameters.motor_gains),
    )
    scale_contacts(scaled, parameters.contact_stiffness, parameters.contact_damping)
    return scaled


def with_parameters(robot: Robot, parameters: Parameters) -> Robot:
    """Returns a robot whose MJCF has scaled parameters and their control delay.

    MuJoCo writes numbers of six digits into an MJCF, so the model of the robot equals that of
    ``model_with_parameters`` to one part in a million. Other contacts are marked as fitted.
    """
    fitted = with_model(robot, model_with_parameters(robot, parameters), parameters.delay)
    if robot.has_fitted_contacts or not parameters.has_other_contacts:
        return fitted
    spec = fitted.specification()
    spec.add_numeric(name=FITTED_CONTACTS, data=[1.0])
    return dataclasses.replace(fitted, mjcf=spec.to_xml())


def with_model(robot: Robot, model: mujoco.MjModel, delay: float) -> Robot:
    """Returns a robot whose MJCF has the parameters of an edited copy of its compiled model.

    Args:
        robot: The robot.
        model: A copy of the robot's model with other masses, friction, contacts or motor gains,
            or other damping, dry friction and armature of joints.
        delay: Control delay, in control steps.
    """
    spec = robot.specification()
    spec.compile()  # assigns the ids of the parts
    compiler = spec.compiler
    # Settings with which the compiler would change the explicit masses.
    compiler.settotalmass, compiler.inertiafromgeom = -1.0, _EXPLICIT_OR_FROM_GEOMS
    compiler.boundmass = compiler.boundinertia = 0.0
    for body in spec.bodies[1:]:
        body.explicitinertial = True
        body.fullinertia = np.full(6, np.nan)
        body.mass, body.inertia = model.body_mass[body.id], model.body_inertia[body.id]
        body.ipos, body.iquat = model.body_ipos[body.id], model.body_iquat[body.id]
    for geom in spec.geoms:
        geom.friction = model.geom_friction[geom.id]
        geom.solref = model.geom_solref[geom.id]
    for pair in spec.pairs:
        pair.friction = model.pair_friction[pair.id]
        pair.solref = model.pair_solref[pair.id]
    for joint in spec.joints:
        dof = model.jnt_dofadr[joint.id]
        joint.damping = [model.dof_damping[dof], *model.dof_dampingpoly[dof]]
        joint.armature = model.dof_armature[dof]
        joint.frictionloss = model.dof_frictionloss[dof]
    for motor in spec.actuators:
        motor.gainprm = model.actuator_gainprm[motor.id]
        motor.biasprm = model.actuator_biasprm[motor.id]
    for numeric in spec.numerics:
        if numeric.name == CONTROL_DELAY:
            spec.delete(numeric)
    spec.add_numeric(name=CONTROL_DELAY, data=[float(delay)])
    return dataclasses.replace(robot, mjcf=spec.to_xml())


_EXPLICIT_OR_FROM_GEOMS = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
