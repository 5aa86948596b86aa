"""Model factors: one named vector of what may differ between a robot and its model.

Every quantity is a factor of the value in the robot's own model, except where that value is 0.
Calibration fits some of them, the robust repair draws them, and a calibrated MJCF contains them.
"""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.robot.actuators import motor_joints
from selfmodel.robot.control_delay import CONTROL_DELAY, FITTED_CONTACTS
from selfmodel.robot.robot import Robot
from selfmodel.robot.scaling import scale_contacts, scale_model

SHARED = ("root_mass", "limb_mass", "friction", "damping")
"""Quantities with one factor for the whole robot."""

JOINT_QUANTITIES = ("joint_damping", "dry_friction", "armature")
"""Quantities of each joint: viscous damping, N m s/rad; dry friction, N m; reflected rotor inertia,
kg m^2."""

_REFERENCES = {"joint_damping": 1.0, "dry_friction": 1.0, "armature": 0.1}
"""Unit of a joint's quantity that is 0 in the model, relative to the joint's inertia: the damping
that stops the joint within about 1 s, the friction that slows it by 1 rad/s^2, a tenth of its
inertia."""

_FIELDS = {"joint_damping": "dof_damping", "dry_friction": "dof_frictionloss"}
_FIELDS |= {"armature": "dof_armature"}


@dataclass(frozen=True)
class Parameters:
    """Parameters of a self-model as factors of its nominal parameters.

    A tuple that is empty changes nothing.

    Attributes:
        root_mass: Factor of the mass and inertia of the root body.
        limb_mass: Factor of the mass and inertia of all other bodies.
        friction: Factor of the sliding friction of all geoms and contact pairs.
        damping: Factor of the damping of all joints.
        motor_gains: Factor of the torque per motor, in the model's order.
        delay: Control delay, in control steps; a multiple of a physics step.
        contact_stiffness: Factor of the stiffness of all contacts.
        contact_damping: Factor of their damping.
        joint_damping: Factor of the damping of each hinge. A value that is 0 in the model is
            increased by its reference (``_REFERENCES``) times the factor minus one.
        dry_friction: Factor of the dry friction of each hinge, in the same way.
        armature: Factor of the armature of each hinge, in the same way.
        body_mass: Further factor of the mass of each body.
        body_inertia: Further factor of the inertia of each body.
    """

    root_mass: float = 1.0
    limb_mass: float = 1.0
    friction: float = 1.0
    damping: float = 1.0
    motor_gains: tuple[float, ...] = ()
    delay: float = 0
    contact_stiffness: float = 1.0
    contact_damping: float = 1.0
    joint_damping: tuple[float, ...] = ()
    dry_friction: tuple[float, ...] = ()
    armature: tuple[float, ...] = ()
    body_mass: tuple[float, ...] = ()
    body_inertia: tuple[float, ...] = ()

    @property
    def has_other_contacts(self) -> bool:
        """Whether contacts differ from the robot's own."""
        return (self.contact_stiffness, self.contact_damping) != (1.0, 1.0)

    @property
    def factors(self) -> FloatArray:
        """Shared factors and motor gains, ``(4 + motors,)``: root, limbs, friction, damping."""
        return np.array([*(getattr(self, name) for name in SHARED), *self.motor_gains])

    @property
    def differs(self) -> bool:
        """Whether the model differs from the nominal one; the control delay does not count."""
        parts = (*self.joint_damping, *self.dry_friction, *self.armature)
        every = (*self.factors.tolist(), *parts, *self.body_mass, *self.body_inertia)
        return self.has_other_contacts or any(factor != 1 for factor in every)


def factor_names(robot: Robot) -> tuple[str, ...]:
    """Returns the names of the scaled quantities, in the order of ``Parameters.factors``."""
    shared = ("mass of the root", "mass of the limbs", "friction", "damping")
    return (*shared, *(f"motor {motor}" for motor in robot.anatomy.motors))


def nominal(robot: Robot) -> Parameters:
    """Returns the parameters of a robot's own model: factors of 1, and its control delay."""
    return Parameters(motor_gains=(1.0,) * robot.model.nu, delay=robot.control_delay)


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
    further = False
    for quantity in JOINT_QUANTITIES:
        if getattr(parameters, quantity):
            getattr(scaled, _FIELDS[quantity])[_dofs(robot)] = joint_values(
                robot, parameters, quantity
            )
            further = True
    if parameters.body_mass:
        scaled.body_mass *= np.array(parameters.body_mass)
        scaled.body_inertia *= np.array(parameters.body_inertia)[:, np.newaxis]
        further = True
    if further:
        mujoco.mj_setConst(scaled, mujoco.MjData(scaled))
    return scaled


def joint_values(robot: Robot, parameters: Parameters, quantity: str) -> FloatArray:
    """Returns the values of a quantity of ``JOINT_QUANTITIES``, ``(hinges,)``, in its unit.

    A factor of 1 gives the robot's own value, to the bit.
    """
    dofs = _dofs(robot)
    own = getattr(robot.model, _FIELDS[quantity])[dofs]
    unit = np.where(own > 0, own, _REFERENCES[quantity] * robot.model.dof_M0[dofs])
    factors = np.array(getattr(parameters, quantity) or (1.0,) * len(dofs))
    return np.asarray(np.maximum(own + unit * (factors - 1), 0.0))


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


def kinds_of_joints(robot: Robot) -> IndexArray:
    """Returns the number of the kind of each hinge, ``(hinges,)``.

    Hinges are of one kind if the masses of their body and of all that it carries are equal to a
    thousandth, and so is the inertia about the hinge: left and right, front and rear.
    """
    model, joints = robot.model, [robot.model.joint(name).id for name in robot.anatomy.hinges]
    bodies, dofs = model.jnt_bodyid[joints], _dofs(robot)
    numbers = zip(
        model.body_mass[bodies], model.body_subtreemass[bodies], model.dof_M0[dofs], strict=True
    )
    keys = [tuple(f"{number:.3g}" for number in row) for row in numbers]
    first = list(dict.fromkeys(keys))
    return np.array([first.index(key) for key in keys], dtype=np.intp)


def joint_of_motor(robot: Robot) -> IndexArray:
    """Returns the number of the first hinge that each motor drives, ``(motors,)``; 0 without."""
    model = robot.model
    hinges = [int(model.joint(name).id) for name in robot.anatomy.hinges]
    driven = [sorted(motor_joints(model, motor) & set(hinges)) for motor in range(model.nu)]
    return np.array([hinges.index(own[0]) if own else 0 for own in driven], dtype=np.intp)


def _dofs(robot: Robot) -> IndexArray:
    return np.array(
        [int(robot.model.joint(name).dofadr[0]) for name in robot.anatomy.hinges], dtype=np.intp
    )


class ModelDistribution(Protocol):
    """Distribution of a model's parameters."""

    @property
    def is_exact(self) -> bool:
        """Whether all draws are the self-model."""
        ...

    def draw(self, rng: np.random.Generator) -> Parameters:
        """Returns random parameters."""
        ...


@dataclass(frozen=True, eq=False)
class LogNormal:
    """Independent log-normal factors with a median of 1.

    Attributes:
        factors: Standard deviation of the logarithm of each factor of ``Parameters.factors``,
            ``(4 + motors,)``.
        bodies: Standard deviation of the logarithm of the further factor of the mass, and of that
            of the inertia, of each body, ``(bodies,)``.
        contacts: Standard deviation of the logarithm of the factors of the stiffness and of the
            damping of contacts.
    """

    factors: FloatArray
    bodies: FloatArray
    contacts: float = 0.0

    @property
    def is_exact(self) -> bool:
        """Whether all draws are the self-model."""
        return not (self.factors.any() or self.bodies.any() or self.contacts)

    def draw(self, rng: np.random.Generator) -> Parameters:
        """Returns random parameters."""

        def drawn(deviations: FloatArray) -> FloatArray:
            return np.exp(deviations * rng.standard_normal(len(deviations)))

        factors = from_factors(drawn(self.factors), 0)
        masses, inertias = (tuple(drawn(self.bodies).tolist()) for _ in range(2))
        # Contacts that are known take no random numbers.
        contacts = drawn(np.full(2, self.contacts)).tolist() if self.contacts else (1.0, 1.0)
        return dataclasses.replace(
            factors,
            body_mass=masses,
            body_inertia=inertias,
            contact_stiffness=contacts[0],
            contact_damping=contacts[1],
        )


@dataclass(frozen=True, eq=False)
class Weighted:
    """A weighted sample of models.

    Attributes:
        models: The models.
        weights: Their probabilities, ``(models,)``, with a sum of 1.
    """

    models: Sequence[Parameters]
    weights: FloatArray

    @property
    def is_exact(self) -> bool:
        """Whether all draws are the self-model."""
        return not any(model.differs for model in self.models)

    def draw(self, rng: np.random.Generator) -> Parameters:
        """Returns one of the models."""
        return self.models[int(rng.choice(len(self.models), p=self.weights))]


def exact(robot: Robot) -> LogNormal:
    """Returns the distribution of a robot whose parameters are those of its self-model."""
    return LogNormal(np.zeros(4 + robot.model.nu), np.zeros(robot.model.nbody))
