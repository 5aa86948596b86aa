"""Editable copy of a robot's model and sensors, to which fault kinds are applied.

Edits keep the layout of the model, so that all hypotheses share one batch: a detached limb stays in
the model without mass and contacts, a welded joint stays as a joint of near-infinite inertia.
"""

import copy
from collections.abc import Sequence
from dataclasses import dataclass, field

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot import model_edits
from selfmodel.robot.actuators import motor_bodies, motor_joints
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.contacts import can_touch, static_geoms
from selfmodel.robot.model_edits import (
    add_point_mass,
    inertia_box_reach,
    turn_about_origin,
    turned_by_hinge,
)

DETACHED_ARMATURE = 1.0
"""Rotor inertia of a hinge of a detached body, kg m^2. Any positive value keeps the mass matrix
invertible; a detached body is not coupled to the rest of the robot."""

WELD_ARMATURE = 1e10
"""Rotor inertia of a welded hinge, kg m^2. In the limit of infinite inertia the equations of motion
are those of welded bodies; at this value a torque of 10 N m turns the hinge by 5e-8 rad in 10 s."""


@dataclass(frozen=True, eq=False)
class Embodiment:
    """Copy of a robot's model and sensor parameters, edited by fault kinds.

    A run starts in the model's reference configuration, ``model.qpos0``.

    Attributes:
        model: Copy of the robot's model, of the same layout.
        gain: Factor of each nominal sensor reading, ``(sensors,)``.
        offset: Summand of each reading after the gain, scaled with the reading, ``(sensors,)``.
        bias: Summand of each reading after the gain, independent of it, ``(sensors,)``.
        noise: Standard deviation of the sensor noise, ``(sensors,)``; see ``SensorNoise``.
        added_delay: Control delay in addition to the robot's, control steps, ``(1,)``; see
            ``control_delay.added_steps``.
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
    def of(cls, model: mujoco.MjModel, anatomy: Anatomy, seed: int = 0) -> "Embodiment":
        """Returns the embodiment of a nominal model: a copy, with unmodified readings.

        Args:
            model: A compiled model of the robot.
            anatomy: The robot's parts.
            seed: Seed of the random parts of faults.
        """
        sensors = len(anatomy.sensors)
        return cls(
            model=copy.copy(model),
            gain=np.ones(sensors),
            offset=np.zeros(sensors),
            bias=np.zeros(sensors),
            noise=np.zeros(sensors),
            added_delay=np.zeros(1),
            encoder_offset=np.zeros(len(anatomy.hinges)),
            seed=seed,
        )

    def detach_body(self, name: str) -> None:
        """Detaches a body: zeroes its mass, inertia, collisions, actuation and couplings."""
        model, body = self.model, self.model.body(name).id
        self.detached.update(model.joint(j).name for j in np.flatnonzero(model.jnt_bodyid == body))
        model.body_mass[body] = 0.0
        model.body_inertia[body] = 0.0
        model.geom_contype[model.geom_bodyid == body] = 0
        model.geom_conaffinity[model.geom_bodyid == body] = 0
        dofs = model.dof_bodyid == body
        model.dof_armature[dofs] = DETACHED_ARMATURE
        model.dof_frictionloss[dofs] = 0.0
        model.jnt_stiffness[model.jnt_bodyid == body] = 0.0
        model.jnt_stiffnesspoly[model.jnt_bodyid == body] = 0.0
        # A limit has a force if the initial pose, or an encoder error, is beyond the range.
        model.jnt_limited[model.jnt_bodyid == body] = 0
        for motor in range(model.nu):
            if body in motor_bodies(model, motor):
                self.release_motor(motor)
        model_edits.release(model, body)

    def weld_hinge(self, name: str, angle: float) -> None:
        """Welds a hinge at an angle, rad.

        The angle becomes the reference of the hinge and part of the body's frame, as in a model
        whose bodies are welded at that angle. The hinges of one body are welded together, in
        their order. Motors that move welded joints only are released.
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
        model_edits.rebase_equality(model, int(hinge.id), shift)
        addresses = [address for address, _, _ in self.welded]
        welded = frozenset(np.flatnonzero(np.isin(model.jnt_qposadr, addresses)).tolist())
        model_edits.disable_welded(model, welded)
        for motor in range(model.nu):
            moved = motor_joints(model, motor)
            if moved and moved <= welded:
                self.release_motor(motor)

    def release_motor(self, motor: int) -> None:
        """Zeroes the force of a motor.

        Args:
            motor: Id of the motor.
        """
        self.model.actuator_gainprm[motor] = 0.0
        self.model.actuator_biasprm[motor] = 0.0

    def weaken_motors(self, motors: Sequence[int], factor: float) -> None:
        """Scales the forces and the force limits of motors.

        Args:
            motors: Ids of the motors.
            factor: Factor of the force, from 0 to 1.
        """
        self.model.actuator_gainprm[motors] *= factor
        self.model.actuator_biasprm[motors] *= factor
        self.model.actuator_forcerange[motors] *= factor
        # A joint that several of the motors drive is scaled once.
        joints = {joint for motor in motors for joint in motor_joints(self.model, motor)}
        self.model.jnt_actfrcrange[sorted(joints)] *= factor

    def shift_feedback(self, hinge: str, offset: float) -> None:
        """Adds an offset, rad, to the angle that the servos of a hinge measure."""
        model_edits.shift_feedback(self.model, hinge, offset)

    def scale_damping(self, hinge: str, factor: float) -> None:
        """Scales the viscous damping of a hinge; see ``model_edits.scale_damping``."""
        model_edits.scale_damping(self.model, hinge, factor)

    def add_dry_friction(self, hinge: str, fraction: float) -> None:
        """Adds dry friction to a hinge; see ``model_edits.add_dry_friction``."""
        model_edits.add_dry_friction(self.model, hinge, fraction)

    def scale_grip(self, bodies: Sequence[str], factor: float) -> None:
        """Scales the sliding friction of all contacts of some bodies, given by name."""
        ids = np.array([self.model.body(name).id for name in bodies], dtype=np.intp)
        model_edits.scale_grip(self.model, ids, factor)

    def load_body(self, name: str, fraction: float, forward: float) -> None:
        """Adds a point mass to the root body of a robot.

        Args:
            name: Name of the root body.
            fraction: The mass, as a fraction of the mass of the healthy robot.
            forward: Place of the mass along the forward direction of the initial pose: 0 is the
                centre of mass of the body, 1 and -1 are its ends, by the box of its inertia.
        """
        model, body = self.model, self.model.body(name)
        # Of the model before the faults: ``mj_setConst`` is called after all of them.
        mass = fraction * float(body.subtreemass[0])
        ahead, inverse = np.empty(3), body.quat * (1.0, -1.0, -1.0, -1.0)
        mujoco.mju_rotVecQuat(ahead, np.array([1.0, 0.0, 0.0]), inverse)
        offset = forward * inertia_box_reach(model, name, ahead) * ahead
        add_point_mass(model, name, mass, offset)

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
            turn_about_origin(model.geom_pos[geom], model.geom_quat[geom], tilt)
        for body in np.flatnonzero(model.body_parentid == 0)[1:]:
            turn_about_origin(model.body_pos[body], model.body_quat[body], tilt)
            joint = model.body_jntadr[body]
            if joint >= 0 and model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
                pose = model.qpos0[model.jnt_qposadr[joint] :]
                pose[:3], pose[3:7] = model.body_pos[body], model.body_quat[body]

    def scale_reading(self, sensor: int, factor: float) -> None:
        """Scales the reading of a sensor.

        Args:
            sensor: Column of the sensor.
            factor: Factor of the reading.
        """
        self.gain[sensor] *= factor
        self.offset[sensor] *= factor

    def shift_reading(self, sensor: int, shift: float) -> None:
        """Adds a constant to what a sensor measures; its gain applies to the constant too.

        Args:
            sensor: Column of the sensor.
            shift: The constant, in units of the nominal reading.
        """
        self.offset[sensor] += self.gain[sensor] * shift

    def fix_reading(self, sensor: int, value: float) -> None:
        """Sets the reading of a sensor to a constant.

        Args:
            sensor: Column of the sensor.
            value: The reading.
        """
        self.gain[sensor] = 0.0
        self.offset[sensor] = value
