"""Model factors: one named vector of what may differ between a robot and its model.

Every quantity is a factor of the value in the robot's own model, except where that value is 0.
Calibration fits nested sets of them (``bases``) with a Gaussian prior on their logarithms, the
robust repair draws them, and a calibrated MJCF contains them.
"""

import copy
import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.robot.actuators import motor_joints
from selfmodel.robot.anatomy import FITTED_CONTACTS, write_control_delay
from selfmodel.robot.robot import Robot, mjcf_of

SHARED = ("root_mass", "limb_mass", "friction", "damping")
"""Quantities with one factor for the whole robot."""

JOINT_FIELDS = {
    "joint_damping": ("dof_damping", 1.0),
    "dry_friction": ("dof_frictionloss", 1.0),
    "armature": ("dof_armature", 0.1),
}
"""Quantities of each joint: viscous damping, N m s/rad; dry friction, N m; armature, kg m^2. Each
has its field of the model, and the unit of a value that is 0 in the model, relative to the joint's
inertia: the damping that stops it within about 1 s, the friction that slows it by 1 rad/s^2."""


@dataclass(frozen=True)
class Parameters:
    """Parameters of a self-model as factors of its nominal parameters; an empty tuple is all 1.

    Attributes:
        root_mass: Factor of the mass and inertia of the root body.
        limb_mass: Factor of the mass and inertia of all other bodies.
        friction: Factor of the sliding friction of all geoms and contact pairs.
        damping: Factor of the damping of all joints.
        motor_gains: Factor of the torque of each motor.
        delay: Control delay, control steps; a multiple of a physics step.
        contact_stiffness: Factor of the stiffness of all contacts.
        contact_damping: Factor of their damping.
        force_limits: Factor of the largest force of each motor, and of the joints that it drives.
        joint_damping: Factor of the damping of each hinge. A value that is 0 in the model is
            increased by its unit (``JOINT_FIELDS``) times the factor minus one.
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
    force_limits: tuple[float, ...] = ()
    joint_damping: tuple[float, ...] = ()
    dry_friction: tuple[float, ...] = ()
    armature: tuple[float, ...] = ()
    body_mass: tuple[float, ...] = ()
    body_inertia: tuple[float, ...] = ()

    @property
    def contacts(self) -> tuple[float, float]:
        """Factors of the stiffness and of the damping of contacts."""
        return self.contact_stiffness, self.contact_damping

    @property
    def factors(self) -> FloatArray:
        """Shared factors and motor gains, ``(4 + motors,)``: root, limbs, friction, damping."""
        return np.array([*(getattr(self, name) for name in SHARED), *self.motor_gains])

    @property
    def differs(self) -> bool:
        """Whether the model differs from the nominal one; the control delay does not count."""
        every = dataclasses.astuple(dataclasses.replace(self, delay=1))
        return any(np.any(np.array(factors) != 1) for factors in every)


def factor_names(robot: Robot) -> tuple[str, ...]:
    """Returns the names of ``Parameters.factors``."""
    shared = ("mass of the root", "mass of the limbs", "friction", "damping")
    return (*shared, *(f"motor {motor}" for motor in robot.anatomy.motors))


def nominal(robot: Robot) -> Parameters:
    """Returns the parameters of a robot's own model: factors of 1, and its control delay."""
    return Parameters(motor_gains=(1.0,) * robot.model.nu, delay=robot.control_delay)


def scale_model(
    model: mujoco.MjModel,
    *,
    mass: FloatArray,
    inertia: FloatArray,
    friction: float,
    damping: float,
    motor_gains: FloatArray,
) -> mujoco.MjModel:
    """Returns a copy of a model with scaled parameters; its layout is the same.

    Args:
        model: A compiled model; it is not changed.
        mass: Factor of each body's mass, ``(bodies,)``.
        inertia: Factor of each body's principal moments of inertia, ``(bodies,)``.
        friction: Factor of the sliding friction of every geom and contact pair.
        damping: Factor of the damping of every joint.
        motor_gains: Factor of each actuator's force before its limits, ``(motors,)``.
    """
    model = copy.copy(model)
    model.body_mass *= mass
    model.body_inertia *= inertia[:, np.newaxis]
    model.geom_friction[:, 0] *= friction
    model.pair_friction[:, :2] *= friction
    model.dof_damping *= damping
    model.dof_dampingpoly *= damping
    # Both contain the stiffness of a position servo: one factor scales the torque at each target.
    model.actuator_gainprm *= motor_gains[:, np.newaxis]
    model.actuator_biasprm *= motor_gains[:, np.newaxis]
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def scale_contacts(model: mujoco.MjModel, stiffness: float, damping: float) -> None:
    """Scales the stiffness and the damping of the contacts of a compiled model, in place.

    Both are per unit of mass. Neither is raised above the largest that a physics step of length h
    integrates: the stiffness above 1 / h^2, a stated damping above 1 / h, and that of a time
    constant above 1 / h, as MuJoCo limits it. Contacts whose two parameters have different signs,
    which MuJoCo replaces, and factors of 1 change nothing, to the bit.

    Source: MuJoCo's documentation, Modeling, Solver parameters, ``solref``.
    """
    if (stiffness, damping) == (1.0, 1.0):
        return
    step = model.opt.timestep
    limited = not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_REFSAFE
    least = 2 * step if limited else 0.0
    for solref in (model.geom_solref, model.pair_solref):
        constants, stated = (solref > 0).all(axis=1), (solref < 0).all(axis=1)
        # With the time constant t that MuJoCo uses, and the ratio r, the stiffness is 1 / (t r)^2,
        # and the damping 2 / t.
        constant = np.maximum(solref[constants, 0], least)
        product = constant * solref[constants, 1]
        scaled = np.maximum(constant / damping, least)
        products = np.maximum(product / np.sqrt(stiffness), np.minimum(product, step))
        solref[constants] = np.column_stack([scaled, products / scaled])
        # Stated numbers have the opposite sign.
        own = -solref[stated]
        limits = np.maximum(own, (1 / step**2, 1 / step))
        solref[stated] = -np.minimum(own * (stiffness, damping), limits)


def model_with_parameters(
    robot: Robot, parameters: Parameters, model: mujoco.MjModel | None = None
) -> mujoco.MjModel:
    """Returns a copy of the robot's own or an edited model with scaled parameters.

    The control delay is unchanged.
    """
    model = robot.model if model is None else model
    masses = np.full(model.nbody, parameters.limb_mass)
    masses[model.body(robot.root).id] = parameters.root_mass
    scaled = scale_model(
        model,
        mass=masses,
        inertia=masses,
        friction=parameters.friction,
        damping=parameters.damping,
        motor_gains=np.array(parameters.motor_gains),
    )
    scale_contacts(scaled, *parameters.contacts)
    of_joints: dict[int, float] = {}
    for motor, factor in enumerate(parameters.force_limits):
        scaled.actuator_forcerange[motor] *= factor
        of_joints |= dict.fromkeys(motor_joints(model, motor), factor)
    # A joint that several motors drive is scaled once.
    for joint, factor in of_joints.items():
        scaled.jnt_actfrcrange[joint] *= factor
    further = [quantity for quantity in JOINT_FIELDS if getattr(parameters, quantity)]
    for quantity in further:
        values = joint_values(robot, parameters, quantity)
        getattr(scaled, JOINT_FIELDS[quantity][0])[_dofs(robot)] = values
    if parameters.body_mass:
        scaled.body_mass *= np.array(parameters.body_mass)
        scaled.body_inertia *= np.array(parameters.body_inertia)[:, np.newaxis]
    if further or parameters.body_mass:
        mujoco.mj_setConst(scaled, mujoco.MjData(scaled))
    return scaled


def joint_values(robot: Robot, parameters: Parameters, quantity: str) -> FloatArray:
    """Returns the values of a quantity of ``JOINT_FIELDS``, ``(hinges,)``, in its unit.

    A factor of 1 gives the robot's own value, to the bit.
    """
    dofs, (field, unit_at_zero) = _dofs(robot), JOINT_FIELDS[quantity]
    own = getattr(robot.model, field)[dofs]
    unit = np.where(own > 0, own, unit_at_zero * robot.model.dof_M0[dofs])
    factors = np.array(getattr(parameters, quantity) or (1.0,) * len(dofs))
    return np.asarray(np.maximum(own + unit * (factors - 1), 0.0))


def with_parameters(robot: Robot, parameters: Parameters) -> Robot:
    """Returns a robot whose MJCF has scaled parameters and their control delay, to six digits.

    Contacts other than the robot's own are marked as fitted.
    """
    fitted = with_model(robot, model_with_parameters(robot, parameters), parameters.delay)
    if robot.has_fitted_contacts or parameters.contacts == (1.0, 1.0):
        return fitted
    spec = fitted.specification()
    spec.add_numeric(name=FITTED_CONTACTS, data=[1.0])
    return dataclasses.replace(fitted, mjcf=mjcf_of(spec))


def with_model(robot: Robot, model: mujoco.MjModel, delay: float) -> Robot:
    """Returns a robot whose MJCF has the parameters of an edited model, and a control delay."""
    spec = robot.specification()
    own, compiler = spec.compile(), spec.compiler
    # Settings with which the compiler would change the explicit masses.
    compiler.settotalmass = -1.0
    compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
    compiler.boundmass = compiler.boundinertia = 0.0
    for body in spec.bodies[1:]:
        body.explicitinertial = True
        body.fullinertia = np.full(6, np.nan)
        body.mass, body.inertia = own.body_mass[body.id], own.body_inertia[body.id]
        body.ipos, body.iquat = own.body_ipos[body.id], own.body_iquat[body.id]
    spec.compile()
    spec.copy_back(model)
    write_control_delay(spec, delay)
    return dataclasses.replace(robot, mjcf=mjcf_of(spec))


def kinds_of_joints(robot: Robot) -> IndexArray:
    """Returns the number of the kind of each hinge, ``(hinges,)``.

    Hinges are of one kind if the masses of their body and of all that it carries are equal to a
    thousandth, and so is the inertia about the hinge: left and right, front and rear.
    """
    model, dofs = robot.model, _dofs(robot)
    bodies = model.dof_bodyid[dofs]
    numbers = (model.body_mass[bodies], model.body_subtreemass[bodies], model.dof_M0[dofs])
    keys = [
        f"{mass:.3g} {carried:.3g} {inertia:.3g}"
        for mass, carried, inertia in zip(*numbers, strict=True)
    ]
    return np.array([keys.index(key) for key in keys], dtype=np.intp)


def joint_of_motor(robot: Robot) -> IndexArray:
    """Returns the number of the first hinge that each motor drives, ``(motors,)``; 0 without."""
    model = robot.model
    hinges = [int(model.joint(name).id) for name in robot.anatomy.hinges]
    driven = [sorted(motor_joints(model, motor) & set(hinges)) for motor in range(model.nu)]
    return np.array([hinges.index(own[0]) if own else 0 for own in driven], dtype=np.intp)


def _dofs(robot: Robot) -> IndexArray:
    addresses = [int(robot.model.joint(name).dofadr[0]) for name in robot.anatomy.hinges]
    return np.array(addresses, dtype=np.intp)


@dataclass(frozen=True, eq=False)
class LogNormal:
    """Independent log-normal factors with a median of 1.

    Attributes:
        factors: Standard deviation of the logarithm of each factor of ``Parameters.factors``.
        bodies: That of the further factor of the mass, and of that of the inertia, of each body.
        contacts: That of the factors of the stiffness and of the damping of contacts.
    """

    factors: FloatArray
    bodies: FloatArray
    contacts: float = 0.0

    @property
    def is_exact(self) -> bool:
        """Whether all draws are the self-model."""
        return not (self.factors.any() or self.bodies.any() or self.contacts)

    def draw(self, rng: np.random.Generator) -> Parameters:
        """Returns random parameters; contacts that are known take no random numbers."""
        contacts = np.full(2 if self.contacts else 0, self.contacts)
        factors, masses, inertias, contact = (
            np.exp(deviations * rng.standard_normal(len(deviations)))
            for deviations in (self.factors, self.bodies, self.bodies, contacts)
        )
        shared, motors = np.split(factors, [len(SHARED)])
        names = (*SHARED, "contact_stiffness", "contact_damping")
        return Parameters(
            motor_gains=tuple(motors.tolist()),
            body_mass=tuple(masses.tolist()),
            body_inertia=tuple(inertias.tolist()),
            **dict(zip(names, [*shared.tolist(), *contact.tolist()], strict=False)),
        )


@dataclass(frozen=True, eq=False)
class Weighted:
    """A sample of models, and their probabilities, ``(models,)``."""

    models: Sequence[Parameters]
    weights: FloatArray

    @property
    def is_exact(self) -> bool:
        """Whether all draws are the self-model."""
        return not any(model.differs for model in self.models)

    def draw(self, rng: np.random.Generator) -> Parameters:
        """Returns one of the models."""
        return self.models[int(rng.choice(len(self.models), p=self.weights))]


ModelDistribution = LogNormal | Weighted
"""Distribution of a model's parameters."""


def exact(robot: Robot) -> LogNormal:
    """Returns the distribution of a robot whose parameters are those of its self-model."""
    return LogNormal(np.zeros(4 + robot.model.nu), np.zeros(robot.model.nbody))


FORCE_LIMITS = "force_limits"
"""Quantity of a robot with a fixed base whose healthy trials reach the limits."""

FACTORS, JOINT_SETS = "factors", ("shared", "kinds", "joints")
"""Names of the set of factors of a robot with a floating base; and of the nested sets of one with a
fixed base: one factor per quantity, per quantity and kind of joint, per quantity and joint."""

PRIOR_DEVIATIONS = {
    "root_mass": 0.15,
    "limb_mass": 0.15,
    "friction": 0.3,
    "damping": 0.3,
    "motor_gains": 0.15,
}
"""Standard deviation of the prior on the logarithm of a factor. Friction and damping are guesses in
many models."""

JOINT_PRIOR_DEVIATIONS = {
    "motor_gains": 0.3,
    FORCE_LIMITS: 0.3,
    "joint_damping": 0.5,
    "dry_friction": 1.0,
    "armature": 1.0,
}
"""As ``PRIOR_DEVIATIONS``, of a robot with a fixed base. The gains include the unknown masses."""

MAX_LOG_FACTOR, MAX_JOINT_LOG_FACTOR = 1.2, 3.0
"""Bound on the absolute logarithm of a factor, 0.3 to 3.3; and of damping, dry friction and
armature of a joint, 0.05 to 20."""


def prior_deviations(robot: Robot) -> dict[str, FloatArray]:
    """Returns the standard deviation of the prior of each factor's logarithm, by quantity."""
    sizes = dict.fromkeys(("motor_gains", FORCE_LIMITS), robot.model.nu)
    sizes |= dict.fromkeys(JOINT_FIELDS, len(_dofs(robot)))
    prior = PRIOR_DEVIATIONS | (JOINT_PRIOR_DEVIATIONS if robot.has_fixed_base else {})
    return {name: np.full(sizes.get(name, 1), deviation) for name, deviation in prior.items()}


@dataclass(frozen=True, eq=False)
class Basis:
    """Coordinates of a set of factors: each is shared by a group of motors or hinges.

    Attributes:
        groups: For each quantity the coordinate of each of its factors.
        prior: Standard deviation of the prior of each coordinate.
        bounds: Bound on the absolute value of each coordinate.
    """

    groups: dict[str, IndexArray]
    prior: FloatArray
    bounds: FloatArray

    def by_quantity(self, coordinates: FloatArray) -> dict[str, FloatArray]:
        """Returns the value of each factor by quantity, given that of each coordinate."""
        return {quantity: coordinates[groups] for quantity, groups in self.groups.items()}

    def applied(self, start: Parameters, logarithms: FloatArray) -> Parameters:
        """Returns parameters with the factors of some logarithms; all else is the start's."""
        factors: dict[str, Any] = {
            quantity: float(values[0]) if quantity in SHARED else tuple(values.tolist())
            for quantity, values in self.by_quantity(np.exp(logarithms)).items()
        }
        return dataclasses.replace(start, **factors)

    def coordinates(self, parameters: Parameters) -> FloatArray:
        """Returns the mean logarithm of each group, ``(coordinates,)``."""
        sums, counts = np.zeros((2, len(self.prior)))
        for quantity, groups in self.groups.items():
            factors = getattr(parameters, quantity) or (1.0,) * len(groups)
            np.add.at(sums, groups, np.log(factors))
            np.add.at(counts, groups, 1.0)
        return np.asarray(sums / counts)


def bases(robot: Robot, *, reaches_limits: bool = False) -> Iterator[tuple[str, Basis]]:
    """Yields the name and the coordinates of each set of factors of a robot.

    Those of a fixed base grow; one that is no larger than the set before, because all joints are of
    one kind or each is of its own, is left out. They have force limits if the trials reach them.
    """
    if not robot.has_fixed_base:
        groups = dict.fromkeys(SHARED, np.arange(1)) | {"motor_gains": np.arange(robot.model.nu)}
        yield FACTORS, _basis(groups, PRIOR_DEVIATIONS)
        return
    hinges, size = np.arange(len(robot.anatomy.hinges)), 0
    kinds = (np.zeros_like(hinges), kinds_of_joints(robot), hinges)
    for name, kind in zip(JOINT_SETS, kinds, strict=True):
        of_motors = ("motor_gains", *([FORCE_LIMITS] * reaches_limits))
        groups = dict.fromkeys(of_motors, kind[joint_of_motor(robot)])
        groups |= dict.fromkeys(JOINT_FIELDS, kind)
        basis = _basis(groups, JOINT_PRIOR_DEVIATIONS)
        if len(basis.prior) > size:
            size = len(basis.prior)
            yield name, basis


def _basis(kinds: dict[str, IndexArray], deviations: dict[str, float]) -> Basis:
    """Returns the coordinates of quantities, of which factors of one kind share one."""
    groups, prior, bounds = {}, list[float](), list[float]()
    for quantity, kind in kinds.items():
        values, group = np.unique(kind, return_inverse=True)
        groups[quantity] = len(prior) + group
        prior += [deviations[quantity]] * len(values)
        bound = MAX_JOINT_LOG_FACTOR if quantity in JOINT_FIELDS else MAX_LOG_FACTOR
        bounds += [bound] * len(values)
    return Basis(groups, np.array(prior), np.array(bounds))
