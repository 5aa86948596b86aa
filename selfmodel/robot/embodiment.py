"""A robot built with a hypothesis: a model of the same layout, edited by name.

A hypothesis never changes the layout of the model, so that all hypotheses share one batch: a lost
limb stays as a ghost that touches nothing, a jammed joint stays as one that nothing can turn.
"""

import copy
from collections.abc import Sequence
from dataclasses import dataclass, field

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot import couplings
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.transmission import motor_bodies, motor_joints

DETACHED_ARMATURE = 1.0
"""Rotor inertia of a lost hinge, kg m^2; any positive value keeps the mass matrix invertible, and
nothing couples it to what is left of the robot."""

WELD_ARMATURE = 1e10
"""Rotor inertia of a held hinge, kg m^2. In the limit of infinite inertia the equations of motion
are those of welded bodies; at this value a torque of 10 N m turns it by 5e-8 rad in 10 s."""


@dataclass(frozen=True, eq=False)
class Embodiment:
    """What a hypothesis makes of a robot; the kinds of fault work themselves into it.

    A run starts in the model's reference configuration, ``model.qpos0``.

    Attributes:
        model: A copy of the robot's model, of the same layout.
        gain: Multiplies each nominal sensor reading, ``(sensors,)``.
        offset: Is added to it then, ``(sensors,)``.
        bias: Is added to that, whatever the sensor measures, ``(sensors,)``.
        noise: Standard deviation of what is added last, ``(sensors,)``; see ``robot.noise``.
        silent_neurons: Indices of the silent hidden neurons of the controller.
        welded: Of each hinge that is held still its places in ``qpos`` and ``qvel`` and its angle.
        detached: The joints of lost bodies, by name: nothing moves them.
        seed: Of what is random in it: the noise, and the shape of rough terrain.
        normal: Unit vector that stands on the ground, world frame, ``(3,)``.
    """

    model: mujoco.MjModel
    gain: FloatArray
    offset: FloatArray
    bias: FloatArray
    noise: FloatArray
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
            seed=seed,
        )

    def detach_body(self, name: str) -> None:
        """Makes a body a ghost: no mass, no collisions, no force from its motors and couplings."""
        model, body = self.model, self.model.body(name).id
        self.detached.update(model.joint(j).name for j in np.flatnonzero(model.jnt_bodyid == body))
        model.body_mass[body] = 0.0
        model.body_inertia[body] = 0.0
        model.geom_contype[model.geom_bodyid == body] = 0
        model.geom_conaffinity[model.geom_bodyid == body] = 0
        degrees = model.dof_bodyid == body
        model.dof_armature[degrees] = DETACHED_ARMATURE
        model.dof_frictionloss[degrees] = 0.0
        model.jnt_stiffness[model.jnt_bodyid == body] = 0.0
        model.jnt_stiffnesspoly[model.jnt_bodyid == body] = 0.0
        # A limit pushes, where a robot starts beyond it or an encoder errs.
        model.jnt_limited[model.jnt_bodyid == body] = 0
        for motor in range(model.nu):
            if body in motor_bodies(model, motor):
                self.release_motor(motor)
        couplings.cut(model, body)

    def weld_hinge(self, name: str, angle: float) -> None:
        """Holds a hinge rigidly at an angle, rad.

        The angle becomes the reference of the hinge and part of its body's frame, as in a model
        whose bodies are welded there. All hinges of a body are held together, in their order.
        Motors that move nothing else are released.
        """
        model, hinge = self.model, self.model.joint(name)
        body = model.body(hinge.bodyid[0])
        turn, frame = np.empty(4), np.empty(4)
        shift = angle - float(hinge.qpos0[0])
        mujoco.mju_axisAngle2Quat(turn, hinge.axis, shift)
        mujoco.mju_mulQuat(frame, body.quat, turn)
        before, after = np.empty(3), np.empty(3)
        mujoco.mju_rotVecQuat(before, hinge.pos, body.quat)
        mujoco.mju_rotVecQuat(after, hinge.pos, frame)
        body.pos += before - after
        body.quat = frame
        hinge.qpos0 = angle
        model.dof_armature[hinge.dofadr[0]] = WELD_ARMATURE
        # A limit that it touches must not push against the weld.
        model.jnt_limited[hinge.id] = 0
        self.welded.append((int(hinge.qposadr[0]), int(hinge.dofadr[0]), angle))
        couplings.keep_meaning(model, int(hinge.id), shift)
        places = [position for position, _, _ in self.welded]
        welded = frozenset(np.flatnonzero(np.isin(model.jnt_qposadr, places)).tolist())
        couplings.settle(model, welded)
        for motor in range(model.nu):
            moved = motor_joints(model, motor)
            if moved and moved <= welded:
                self.release_motor(motor)

    def release_motor(self, motor: int) -> None:
        """Takes all force from the motor of that number."""
        self.model.actuator_gainprm[motor] = 0.0
        self.model.actuator_biasprm[motor] = 0.0

    def weaken_motors(self, motors: Sequence[int], part: float) -> None:
        """Leaves the motors of these numbers a part of their torque, and of their largest."""
        self.model.actuator_gainprm[motors] *= part
        self.model.actuator_biasprm[motors] *= part
        self.model.actuator_forcerange[motors] *= part
        # Once, however many of them pull at a joint.
        joints = {joint for motor in motors for joint in motor_joints(self.model, motor)}
        self.model.jnt_actfrcrange[sorted(joints)] *= part

    def set_friction(self, coefficient: float) -> None:
        """Sets the sliding friction between the world and everything that can touch it."""
        model = self.model
        world = model.body_weldid[model.geom_bodyid] == 0
        contype, conaffinity = model.geom_contype, model.geom_conaffinity
        touching = (contype & np.bitwise_or.reduce(conaffinity[world])) | (
            conaffinity & np.bitwise_or.reduce(contype[world])
        )
        # Of two geoms that touch, the larger coefficient counts.
        model.geom_friction[world | (touching != 0), 0] = coefficient
        paired = world[model.pair_geom1] | world[model.pair_geom2]
        model.pair_friction[paired, :2] = coefficient

    def tilt_ground(self, angle: float) -> None:
        """Turns the world's shapes, and whatever stands in it, uphill along x by an angle, rad."""
        model = self.model
        tilt = np.empty(4)
        mujoco.mju_axisAngle2Quat(tilt, np.array([0.0, 1.0, 0.0]), -angle)
        mujoco.mju_rotVecQuat(self.normal, self.normal.copy(), tilt)
        for geom in np.flatnonzero(model.geom_bodyid == 0):
            _turn(model.geom_pos[geom], model.geom_quat[geom], tilt)
        for body in np.flatnonzero(model.body_parentid == 0)[1:]:
            _turn(model.body_pos[body], model.body_quat[body], tilt)
            joint = model.body_jntadr[body]
            if joint >= 0 and model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
                start = model.qpos0[model.jnt_qposadr[joint] :]
                start[:3], start[3:7] = model.body_pos[body], model.body_quat[body]

    def scale_reading(self, sensor: int, factor: float) -> None:
        """Multiplies what the sensor of that column measures."""
        self.gain[sensor] *= factor
        self.offset[sensor] *= factor

    def fix_reading(self, sensor: int, value: float) -> None:
        """Makes the sensor of that column read ``value`` whatever happens."""
        self.gain[sensor] = 0.0
        self.offset[sensor] = value


def _turn(position: FloatArray, orientation: FloatArray, by: FloatArray) -> None:
    """Turns a frame about the world's origin, in place."""
    mujoco.mju_rotVecQuat(position, position.copy(), by)
    mujoco.mju_mulQuat(orientation, by, orientation.copy())
