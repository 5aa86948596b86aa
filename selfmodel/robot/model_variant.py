"""Editable copy of a robot's model and sensors, to which fault kinds are applied.

Edits keep the layout of the model, so that all hypotheses share one batch: a detached limb stays in
the model without mass and contacts, a welded joint stays as a joint of near-infinite inertia.
``selfmodel.rotation`` rotates whole trajectories; its results differ in the last bits from
those of MuJoCo's functions, which are used here.
"""

import copy
from collections.abc import Sequence
from dataclasses import dataclass, field

import mujoco
import numpy as np
from numpy.polynomial import Polynomial

from selfmodel.arrays import FloatArray
from selfmodel.robot import actuators
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.contacts import can_touch, static_geoms

DETACHED_ARMATURE = 1.0
"""Rotor inertia of a hinge of a detached body, kg m^2. Any positive value keeps the mass matrix
invertible; a detached body is not coupled to the rest of the robot."""

WELD_ARMATURE = 1e10
"""Rotor inertia of a welded hinge, kg m^2. In the limit of infinite inertia the equations of motion
are those of welded bodies; at this value a torque of 10 N m turns the hinge by 5e-8 rad in 10 s."""

NO_CONTACT_MARGIN = -100.0
"""Contact margin that disables a contact pair, m: a contact has a force only while the distance of
its geoms is below the margin."""

_MIN_MIX = 1e-15
"""Smallest weight of a geom in the mean of contact parameters (MuJoCo's ``mjMINVAL``)."""

_UNREAD = [
    int(kind)
    for name, kind in mujoco.mjtSensor.__members__.items()
    if any(part in name for part in ("FRAME", "JOINTPOS", "CONTACT"))
]
"""Sensors that nothing reads from a simulation: 8 % of the time of a Go1 of mujoco_playground."""

_EQ_JOINT, _EQ_TENDON = int(mujoco.mjtEq.mjEQ_JOINT), int(mujoco.mjtEq.mjEQ_TENDON)
_SITE = int(mujoco.mjtObj.mjOBJ_SITE)


@dataclass(frozen=True, eq=False)
class ModelVariant:
    """Copy of a robot's model and sensor parameters, edited by fault kinds.

    A run starts in the model's reference configuration, ``model.qpos0``.

    Attributes:
        model: Copy of the robot's model, of the same layout.
        gain: Factor of each nominal sensor reading, ``(sensors,)``.
        offset: Summand of each reading after the gain, scaled with the reading, ``(sensors,)``.
        bias: Summand of each reading after the gain, independent of it, ``(sensors,)``.
        noise: Standard deviation of the sensor noise, ``(sensors,)``; see ``SensorNoise``.
        added_delay: Control delay in addition to the robot's, control steps, ``(1,)``; see
            ``anatomy.added_steps``.
        encoder_offset: Logged minus true angle of each hinge, ``(hinges,)``, rad.
        silent_neurons: Indices of the silent hidden neurons of the controller.
        welded: Index in ``qpos``, index in ``qvel`` and angle (rad) of each welded hinge.
        detached: Names of the joints of detached bodies.
        seed: Seed of the random parts of faults: sensor noise and the shape of rough terrain.
        normal: Unit normal of the ground, world frame, ``(3,)``.
    """

    model: mujoco.MjModel
    gain: FloatArray
    offset: FloatArray
    bias: FloatArray
    noise: FloatArray
    added_delay: FloatArray
    encoder_offset: FloatArray
    silent_neurons: set[int] = field(default_factory=set)
    welded: list[tuple[int, int, float]] = field(default_factory=list)
    detached: set[str] = field(default_factory=set)
    seed: int = 0
    normal: FloatArray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))

    @classmethod
    def of(cls, model: mujoco.MjModel, anatomy: Anatomy, seed: int = 0) -> "ModelVariant":
        """Returns the variant of a nominal model: a copy, with unmodified readings."""
        gain, offset, bias, noise = np.array([[1.0], [0.0], [0.0], [0.0]]).repeat(
            len(anatomy.sensors), axis=1
        )
        own = copy.copy(model)
        own.sensor_needstage[np.isin(own.sensor_type, _UNREAD)] = 0  # of no stage of a step
        return cls(
            *(own, gain, offset, bias, noise, np.zeros(1)),
            encoder_offset=np.zeros(len(anatomy.hinges)),
            seed=seed,
        )

    def detach_body(self, name: str) -> None:
        """Detaches a body: zeroes its mass, inertia, collisions, actuation and couplings."""
        model, body = self.model, int(self.model.body(name).id)
        joints, geoms = model.jnt_bodyid == body, model.geom_bodyid == body
        self.detached.update(model.joint(j).name for j in np.flatnonzero(joints))
        model.body_mass[body] = 0.0
        model.body_inertia[body] = 0.0
        model.geom_contype[geoms] = model.geom_conaffinity[geoms] = 0
        model.dof_armature[model.dof_bodyid == body] = DETACHED_ARMATURE
        model.dof_frictionloss[model.dof_bodyid == body] = 0.0
        model.jnt_stiffness[joints] = 0.0
        model.jnt_stiffnesspoly[joints] = 0.0
        # A limit has a force if the initial pose, or an encoder error, is beyond the range.
        model.jnt_limited[joints] = 0
        for motor in range(model.nu):
            if body in actuators.motor_bodies(model, motor):
                self.release_motor(motor)
        for tendon in range(model.ntendon):
            if body in actuators.tendon_bodies(model, tendon):
                _slacken(model, tendon)
        for constraint in range(model.neq):
            if body in _constrained(model, constraint)[1]:
                model.eq_active0[constraint] = 0
        # Contact masks do not affect explicit contact pairs.
        paired = geoms[model.pair_geom1] | geoms[model.pair_geom2]
        model.pair_margin[paired] = NO_CONTACT_MARGIN

    def weld_hinge(self, name: str, angle: float) -> None:
        """Welds a hinge at an angle, rad.

        The angle becomes the reference of the hinge and part of the body's frame, as in a model
        whose bodies are welded at that angle. The hinges of one body are welded together, in
        their order. What moves or couples welded joints only is released: it would act against the
        weld.
        """
        model, hinge = self.model, self.model.joint(name)
        body = model.body(hinge.bodyid[0])
        shift = angle - float(hinge.qpos0[0])
        position, orientation = turned_by_hinge(body.pos, body.quat, hinge.axis, hinge.pos, shift)
        body.pos, body.quat = position, orientation
        hinge.qpos0 = angle
        model.dof_armature[hinge.dofadr[0]] = WELD_ARMATURE
        # The force of a limit would act against the weld.
        model.jnt_limited[hinge.id] = 0
        self.welded.append((int(hinge.qposadr[0]), int(hinge.dofadr[0]), angle))
        _rebase_equality(model, int(hinge.id), shift)
        addresses = [address for address, _, _ in self.welded]
        welded = frozenset(np.flatnonzero(np.isin(model.jnt_qposadr, addresses)).tolist())
        for tendon in range(model.ntendon):
            if actuators.tendon_joints(model, tendon) <= welded:
                _slacken(model, tendon)
        for constraint in range(model.neq):
            joints, _ = _constrained(model, constraint)
            if joints and joints <= welded:
                model.eq_active0[constraint] = 0
        for motor in range(model.nu):
            moved = actuators.motor_joints(model, motor)
            if moved and moved <= welded:
                self.release_motor(motor)

    def release_motor(self, motor: int) -> None:
        """Zeroes the force of a motor, given by id."""
        self.model.actuator_gainprm[motor] = 0.0
        self.model.actuator_biasprm[motor] = 0.0

    def scale_gains(self, motors: Sequence[int], factor: float) -> None:
        """Scales the forces of motors, given by id, before their limits."""
        self.model.actuator_gainprm[motors] *= factor
        self.model.actuator_biasprm[motors] *= factor

    def weaken_motors(self, motors: Sequence[int], factor: float) -> None:
        """Scales the forces, the force limits and the damping of motors, given by id."""
        self.scale_gains(motors, factor)
        self.model.actuator_forcerange[motors] *= factor
        self.model.actuator_damping[motors] *= factor
        self.model.actuator_dampingpoly[motors] *= factor
        # A joint that several of the motors drive is scaled once.
        joints = {joint for motor in motors for joint in actuators.motor_joints(self.model, motor)}
        self.model.jnt_actfrcrange[sorted(joints)] *= factor

    def shift_feedback(self, hinge: str, offset: float) -> None:
        """Adds an offset, rad, to the angle of a hinge that the servos of its motors measure.

        The force of a motor with an affine bias is ``gain * command + bias[0] + bias[1] * length +
        bias[2] * velocity``. The offset adds ``length_per_angle * offset`` to the length, a
        constant force. A motor without position feedback has a ``bias[1]`` of 0.
        """
        model, joint = self.model, int(self.model.joint(hinge).id)
        for motor in range(model.nu):
            if actuators.has_feedback(model, motor):
                bias = model.actuator_biasprm[motor]
                bias[0] += bias[1] * actuators.length_per_angle(model, motor, joint) * offset

    def scale_damping(self, hinge: str, factor: float) -> None:
        """Scales the viscous damping of a hinge.

        A hinge without damping has none to scale. Its damping is increased by ``factor - 1`` times
        the damping that slows the hinge, with all that it carries, with a time constant of 1 s.
        """
        model, dof = self.model, int(self.model.joint(hinge).dofadr[0])
        model.dof_dampingpoly[dof] *= factor
        if model.dof_damping[dof]:
            model.dof_damping[dof] *= factor
        else:
            model.dof_damping[dof] = max(factor - 1, 0.0) * model.dof_M0[dof]

    def add_dry_friction(self, hinge: str, fraction: float) -> None:
        """Adds dry friction to a hinge: a fraction of the largest torque of its motors."""
        joint = self.model.joint(hinge)
        torque = fraction * largest_torque(self.model, int(joint.id))
        self.model.dof_frictionloss[joint.dofadr[0]] += torque

    def scale_grip(self, bodies: Sequence[str], factor: float) -> None:
        """Scales the sliding friction of all contacts of some bodies, given by name.

        A contact has the larger friction of its two geoms, so that less friction of one geom alone
        has no effect. The geoms of the bodies get a higher priority than all other geoms: a contact
        then has the parameters of the geom with the higher priority. The parameters that they had
        in a contact with the ground are written into these geoms.
        """
        model = self.model
        ids = [model.body(name).id for name in bodies]
        geoms = np.flatnonzero(np.isin(model.geom_bodyid, ids))
        for geom in geoms:
            ground = np.flatnonzero(static_geoms(model) & can_touch(model, np.array([geom])))
            if len(ground):
                _adopt_contact_parameters(model, int(geom), int(ground[0]))
        model.geom_friction[geoms, 0] *= factor
        model.geom_priority[geoms] = int(model.geom_priority.max()) + 1
        paired = np.isin(model.pair_geom1, geoms) | np.isin(model.pair_geom2, geoms)
        model.pair_friction[paired, :2] *= factor

    def load_body(self, name: str, fraction: float, forward: float) -> None:
        """Adds a point mass, a fraction of the mass of the healthy robot, to the root body.

        Its place is along the forward direction of the initial pose: 0 is the centre of mass of the
        body, 1 and -1 are its ends, by the box of even density with its mass and inertia.
        """
        body = self.model.body(name)
        # Of the model before the faults: ``mj_setConst`` is called after all of them.
        mass = fraction * float(body.subtreemass[0])
        ahead, inverse = np.empty(3), body.quat * (1.0, -1.0, -1.0, -1.0)
        mujoco.mju_rotVecQuat(ahead, np.array([1.0, 0.0, 0.0]), inverse)
        moments = np.asarray(body.inertia)
        squares = 6 * np.maximum(moments.sum() - 2 * moments, 0.0) / float(body.mass[0])
        reach = float(np.abs(_matrix(body.iquat).T @ ahead) @ np.sqrt(squares)) / 2
        _add_point_mass(body, mass, forward * reach * ahead)

    def load_link(self, hinge: str, mass: float) -> None:
        """Adds a point mass, kg, at the centre of mass of the body that a hinge moves.

        A detached body has no mass.
        """
        if hinge not in self.detached:
            body = self.model.body(self.model.joint(hinge).bodyid[0])
            _add_point_mass(body, mass, np.zeros(3))

    def set_friction(self, coefficient: float) -> None:
        """Sets the sliding friction between static geoms and the geoms that can touch them."""
        model = self.model
        world = static_geoms(model)
        # A contact has the larger coefficient of its two geoms.
        model.geom_friction[world | can_touch(model, world), 0] = coefficient
        paired = world[model.pair_geom1] | world[model.pair_geom2]
        model.pair_friction[paired, :2] = coefficient

    def tilt_ground(self, angle: float) -> None:
        """Tilts the static geoms and the root bodies by an angle, rad, uphill along x."""
        model = self.model
        tilt = np.empty(4)
        mujoco.mju_axisAngle2Quat(tilt, np.array([0.0, 1.0, 0.0]), -angle)
        mujoco.mju_rotVecQuat(self.normal, self.normal.copy(), tilt)
        for geom in np.flatnonzero(model.geom_bodyid == 0):
            _turn_about_origin(model.geom_pos[geom], model.geom_quat[geom], tilt)
        for body in np.flatnonzero(model.body_parentid == 0)[1:]:
            _turn_about_origin(model.body_pos[body], model.body_quat[body], tilt)
            joint = model.body_jntadr[body]
            if joint >= 0 and model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
                pose = model.qpos0[model.jnt_qposadr[joint] :]
                pose[:3], pose[3:7] = model.body_pos[body], model.body_quat[body]

    def fix_reading(self, sensor: int, value: float) -> None:
        """Sets the reading of a sensor, given by its column, to a constant."""
        self.gain[sensor] = 0.0
        self.offset[sensor] = value


def largest_torque(model: mujoco.MjModel, hinge: int) -> float:
    """Returns the largest torque of the motors of a hinge, given by id, N m; 0 without motors.

    Without a limit of its force, a motor is assumed to have the gain times the largest command, or
    times 1 without a limit of the command.
    """
    torque = 0.0
    for motor in range(model.nu):
        if hinge not in actuators.motor_joints(model, motor):
            continue
        if model.actuator_forcelimited[motor]:
            force = float(abs(model.actuator_forcerange[motor]).max())
        else:
            limited = model.actuator_ctrllimited[motor]
            command = float(abs(model.actuator_ctrlrange[motor]).max()) if limited else 1.0
            force = abs(float(model.actuator_gainprm[motor, 0])) * command
        torque += abs(float(model.actuator_gear[motor, 0])) * force
    if model.jnt_actfrclimited[hinge]:
        return min(torque, float(abs(model.jnt_actfrcrange[hinge]).max()))
    return torque


def turned_by_hinge(
    position: FloatArray,
    orientation: FloatArray,
    axis: FloatArray,
    anchor: FloatArray,
    angle: float,
) -> tuple[FloatArray, FloatArray]:
    """Returns the frame of a body after a rotation about one of its hinges, rad.

    The frame of the body is in that of its parent, axis and anchor of the hinge in the body's.
    """
    rotation, rotated = np.empty(4), np.empty(4)
    mujoco.mju_axisAngle2Quat(rotation, axis, angle)
    mujoco.mju_mulQuat(rotated, orientation, rotation)
    before, after = np.empty(3), np.empty(3)
    mujoco.mju_rotVecQuat(before, anchor, orientation)
    mujoco.mju_rotVecQuat(after, anchor, rotated)
    return position + (before - after), rotated


def _turn_about_origin(position: FloatArray, orientation: FloatArray, turn: FloatArray) -> None:
    """Rotates a frame about the origin of its parent frame, in place."""
    mujoco.mju_rotVecQuat(position, position.copy(), turn)
    mujoco.mju_mulQuat(orientation, turn, orientation.copy())


def _matrix(quaternion: FloatArray) -> FloatArray:
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)


def _add_point_mass(body: mujoco.MjModel, mass: float, offset: FloatArray) -> None:
    """Adds a point mass, kg, to a body, which is edited in place.

    Its offset is from the body's centre of mass, in the frame of the body, ``(3,)``, m; with zeros,
    the inertia is unchanged to the bit.
    """
    before = float(body.mass[0])
    body.mass = before + mass
    if not offset.any():
        return
    axes = _matrix(body.iquat)
    # About the common centre of mass, two masses have the inertia of the reduced mass.
    reduced = before * mass / (before + mass)
    inertia = axes @ np.diag(body.inertia) @ axes.T
    inertia += reduced * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    moments, vectors = np.linalg.eigh(inertia)
    vectors[:, 0] *= np.linalg.det(vectors)  # a rotation, not a reflection
    mujoco.mju_mat2Quat(body.iquat, vectors.ravel())
    body.inertia = moments
    body.ipos = body.ipos + offset * mass / (before + mass)


def _adopt_contact_parameters(model: mujoco.MjModel, geom: int, other: int) -> None:
    """Writes into a geom the parameters of its contacts with another geom.

    Source: MuJoCo's ``mj_contactParam``.
    """
    condim, friction, solref, solimp = (
        getattr(model, f"geom_{name}") for name in ("condim", "friction", "solref", "solimp")
    )
    if model.geom_priority[geom] > model.geom_priority[other]:
        return
    if model.geom_priority[geom] < model.geom_priority[other]:
        for values in (condim, friction, solref, solimp):
            values[geom] = values[other]
        return
    weight = _weight(float(model.geom_solmix[geom]), float(model.geom_solmix[other]))
    condim[geom] = max(condim[geom], condim[other])
    friction[geom] = np.maximum(friction[geom], friction[other])
    if solref[geom, 0] > 0 and solref[other, 0] > 0:
        solref[geom] = weight * solref[geom] + (1 - weight) * solref[other]
    else:
        solref[geom] = np.minimum(solref[geom], solref[other])
    solimp[geom] = weight * solimp[geom] + (1 - weight) * solimp[other]


def _weight(mix: float, other: float) -> float:
    """Returns the weight of a geom in a mean, given the ``solmix`` of both geoms."""
    if mix >= _MIN_MIX and other >= _MIN_MIX:
        return mix / (mix + other)
    return 0.5 + 0.5 * ((mix >= _MIN_MIX) - (other >= _MIN_MIX))


def _rebase_equality(model: mujoco.MjModel, joint: int, shift: float) -> None:
    """Rewrites joint equality constraints for a new reference angle; their effect is unchanged.

    A joint equality constraint relates the angles from the references of both joints, by a
    polynomial of the second joint's angle. ``shift`` is the new minus the old reference, rad.
    """
    for constraint in np.flatnonzero(model.eq_type == _EQ_JOINT):
        if model.eq_obj2id[constraint] == joint:
            shifted = Polynomial(model.eq_data[constraint, :5])(Polynomial([shift, 1.0]))
            model.eq_data[constraint, :5] = 0.0
            model.eq_data[constraint, : len(shifted.coef)] = shifted.coef
        if model.eq_obj1id[constraint] == joint:
            model.eq_data[constraint, 0] -= shift


def _slacken(model: mujoco.MjModel, tendon: int) -> None:
    model.tendon_limited[tendon] = 0
    for force in (
        *(model.tendon_stiffness, model.tendon_stiffnesspoly, model.tendon_frictionloss),
        *(model.tendon_damping, model.tendon_dampingpoly, model.tendon_armature),
    ):
        force[tendon] = 0.0


def _constrained(model: mujoco.MjModel, constraint: int) -> tuple[frozenset[int], frozenset[int]]:
    """Returns the joints that an equality constraint couples, if any, and the bodies involved."""
    ends = model.eq_obj1id[constraint], model.eq_obj2id[constraint]
    objects = [int(number) for number in ends if number >= 0]
    kind, nothing = int(model.eq_type[constraint]), frozenset[int]()
    if kind == _EQ_TENDON:
        bodies = nothing.union(*(actuators.tendon_bodies(model, one) for one in objects))
        return nothing.union(*(actuators.tendon_joints(model, one) for one in objects)), bodies
    if kind == _EQ_JOINT:
        return frozenset(objects), frozenset(model.jnt_bodyid[objects].tolist())
    if int(model.eq_objtype[constraint]) == _SITE:
        objects = model.site_bodyid[objects].tolist()
    return nothing, frozenset(objects)
