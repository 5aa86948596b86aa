"""Fault kinds of joints, their motors and encoders, and of feet."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.faults.sensors import FAILED_SENSOR, SENSOR_GAIN
from selfmodel.robot.anatomy import Anatomy, Joint

if TYPE_CHECKING:
    from selfmodel.robot.model_variant import ModelVariant

ANGLE_LEVELS = 12
"""Levels of the angle of a jam, evenly spaced inside the joint's range: 0.09 rad apart for 60
degrees."""


class JointFault(FaultKind):
    """A fault of a joint."""

    def parts(self, anatomy: Anatomy) -> tuple[str, ...]:
        """Returns the names of the joints that can have the fault."""
        return tuple(joint.name for joint in anatomy.joints if self._fits(joint, anatomy))

    def _fits(self, _joint: Joint, _anatomy: Anatomy) -> bool:
        return True


class MotorFault(JointFault):
    """A fault of a joint with motors; a motor of several joints belongs to the first joint."""

    def _fits(self, joint: Joint, _anatomy: Anatomy) -> bool:
        return bool(joint.motors)


class BrokenJoint(JointFault):
    """A joint with the bodies beyond it detached; faults refer to bodies by name."""

    def _fits(self, joint: Joint, _anatomy: Anatomy) -> bool:
        return "" not in joint.bodies

    def apply(self, variant: "ModelVariant", anatomy: Anatomy, fault: Fault) -> None:
        """Detaches the bodies of the limb and zeroes the readings of its sensors."""
        detached = anatomy.joint(fault.part).bodies
        for name in detached:
            variant.detach_body(name)
        for column, sensor in enumerate(anatomy.sensors):
            if sensor.body in detached:
                variant.fix_reading(column, 0.0)

    def absorbs(self, fault: Fault, other: Fault, anatomy: Anatomy) -> bool:
        """Returns whether the other fault is at a detached part, or of a motor without a load."""
        if other.part == fault.part:
            return other.kind != fault.kind
        broken = anatomy.joint(fault.part)
        if other.kind == LOCKED_LEG:
            return anatomy.limbs[other.part][0].name in (fault.part, *broken.descendants)
        if other.part in broken.descendants or other.kind not in OF_MOTORS:
            return other.part in broken.descendants
        return broken.motors_lost_if_broken.issuperset(anatomy.joint(other.part).motors)


class JammedAtAngle(JointFault):
    """A joint whose hinges are welded at one angle, rad, other than that of ``JAMMED``."""

    def _fits(self, joint: Joint, anatomy: Anatomy) -> bool:
        return bool(self.levels_at(anatomy, joint.name))

    def bounds_at(self, anatomy: Anatomy, part: str) -> tuple[float, float]:
        """Returns the range that all hinges of a joint have, rad."""
        limits = anatomy.joint(part).limits
        return max(low for low, _ in limits), min(high for _, high in limits)

    def levels_at(self, anatomy: Anatomy, part: str) -> tuple[float, ...]:
        """Returns angles inside the range of a joint, without 0, rad."""
        low, high = self.bounds_at(anatomy, part)
        if low >= high:
            return ()
        angles = (low + (high - low) * (k + 0.5) / ANGLE_LEVELS for k in range(ANGLE_LEVELS))
        return tuple(dict.fromkeys(round(angle, 3) + 0.0 for angle in angles if round(angle, 3)))

    def apply(self, variant: "ModelVariant", anatomy: Anatomy, fault: Fault) -> None:
        """Welds the hinges at the angle of the severity."""
        hinges = anatomy.joint(fault.part).hinges
        _weld(variant, anatomy, dict.fromkeys(hinges, fault.severity))

    def absorbs(self, fault: Fault, other: Fault, anatomy: Anatomy) -> bool:
        """Returns whether a fault of the joint's resistance or motor has no further effect.

        The motors of a welded joint have no effect unless they move another joint too.
        """
        if other.part != fault.part or other.kind not in OF_MOTORS:
            return other.part == fault.part and other.kind in (DAMPED_JOINT, JOINT_FRICTION)
        joint = anatomy.joint(fault.part)
        return joint.motors_lost_if_jammed.issuperset(joint.motors)


class Jammed(JointFault):
    """A joint whose hinges are welded at 0, or at the limit nearest to 0."""

    def apply(self, variant: "ModelVariant", anatomy: Anatomy, fault: Fault) -> None:
        """Welds the hinges."""
        _weld(variant, anatomy, _nearest_to_zero(anatomy.joint(fault.part)))

    def absorbs(self, fault: Fault, other: Fault, anatomy: Anatomy) -> bool:
        """Returns whether a fault of the joint's sensor, motor or angle has no further effect.

        A sensor of the welded hinge that reads 0 reads 0 if it fails or with any gain. A joint
        jammed at 0 and at another angle is jammed at 0.
        """
        if other.kind in (FAILED_SENSOR, SENSOR_GAIN):
            return _reads_zero(other, _nearest_to_zero(anatomy.joint(fault.part)), anatomy)
        if other.part == fault.part and other.kind == JAMMED_AT_ANGLE:
            return True
        return JAMMED_AT_ANGLE.absorbs(fault, other, anatomy)


def _reads_zero(fault: Fault, angles: Mapping[str, float], anatomy: Anatomy) -> bool:
    """Returns whether the sensor of a fault reads 0 of a hinge welded at one of the angles."""
    sensor = anatomy.sensor(fault.part)
    return sensor.hinge in angles and sensor.reading(angles[sensor.hinge]) == 0


def _weld(variant: "ModelVariant", anatomy: Anatomy, angles: Mapping[str, float]) -> None:
    for hinge, angle in angles.items():
        variant.weld_hinge(hinge, angle)
    for column, sensor in enumerate(anatomy.sensors):
        if sensor.hinge in angles:
            offset = variant.encoder_offset[anatomy.hinges.index(sensor.hinge)]
            variant.fix_reading(column, sensor.reading(angles[sensor.hinge] + offset))


def _nearest_to_zero(*joints: Joint) -> dict[str, float]:
    return {hinge: min(max(low, 0.0), high) for hinge, (low, high) in _limits(*joints).items()}


def _limits(*joints: Joint) -> dict[str, tuple[float, float]]:
    """Returns the range of each hinge, rad."""
    return {
        hinge: limits
        for joint in joints
        for hinge, limits in zip(joint.hinges, joint.limits, strict=True)
    }


class LockedLeg(FaultKind):
    """A limb whose hinges are all welded, at angles that the encoders show, or as ``JAMMED``."""

    def parts(self, anatomy: Anatomy) -> tuple[str, ...]:
        """Returns the names of the limbs of several hinges; see ``Anatomy.limbs``."""
        return tuple(name for name in anatomy.limbs if len(self.hinges(anatomy, name)) > 1)

    def hinges(self, anatomy: Anatomy, part: str) -> dict[str, tuple[float, float]]:
        """Returns the hinges of a limb, those nearest to the root body first."""
        return _limits(*anatomy.limbs[part])

    def apply(self, variant: "ModelVariant", anatomy: Anatomy, fault: Fault) -> None:
        """Welds the hinges."""
        _weld(variant, anatomy, self._angles(fault, anatomy))

    def _angles(self, fault: Fault, anatomy: Anatomy) -> dict[str, float]:
        angles = _nearest_to_zero(*anatomy.limbs[fault.part])
        return dict(zip(angles, fault.angles, strict=True)) if fault.angles else angles

    def absorbs(self, fault: Fault, other: Fault, anatomy: Anatomy) -> bool:
        """Returns whether the other fault is one of a joint of the limb that a jam is or absorbs.

        A joint of the limb that has come off stays a fault of its own.
        """
        if other.kind in (FAILED_SENSOR, SENSOR_GAIN):
            return _reads_zero(other, self._angles(fault, anatomy), anatomy)
        if other.part not in {joint.name for joint in anatomy.limbs[fault.part]}:
            return False
        jam = Fault(JAMMED_AT_ANGLE, other.part)
        return other.kind in (JAMMED, JAMMED_AT_ANGLE) or jam.kind.absorbs(jam, other, anatomy)


class WeakMotor(MotorFault):
    """A joint whose motors' torque is scaled by a factor below 1."""

    def apply(self, variant: "ModelVariant", anatomy: Anatomy, fault: Fault) -> None:
        """Scales the forces and the force limits of the motors."""
        motors = [anatomy.motors.index(motor) for motor in anatomy.joint(fault.part).motors]
        variant.weaken_motors(motors, fault.severity)

    def absorbs(self, fault: Fault, other: Fault, _anatomy: Anatomy) -> bool:
        """Returns whether the other fault is the gain of a servo without any torque."""
        return not fault.severity and other.part == fault.part and other.kind == SERVO_GAIN


class MotorOff(MotorFault):
    """A joint whose motors are off: no torque, and only a part of the joint's resistance.

    What a healthy trial shows as damping and dry friction of a joint is partly that of its motors:
    the voltage that they induce, and the friction of gears, which grows with the torque that they
    transmit. Both go with the torque. The severity is the share of damping and dry friction that is
    left; with all of it, the motor is a weak one without torque.
    """

    def apply(self, variant: "ModelVariant", anatomy: Anatomy, fault: Fault) -> None:
        """Zeroes the forces of the motors, and scales the resistance of the hinges."""
        joint, model = anatomy.joint(fault.part), variant.model
        variant.weaken_motors([anatomy.motors.index(motor) for motor in joint.motors], 0.0)
        dofs = [int(model.joint(hinge).dofadr[0]) for hinge in joint.hinges]
        for resistance in (model.dof_damping, model.dof_dampingpoly, model.dof_frictionloss):
            resistance[dofs] *= fault.severity

    def absorbs(self, fault: Fault, other: Fault, _anatomy: Anatomy) -> bool:
        """Returns whether the other fault is of the torque of the same motors."""
        return other.part == fault.part and other.kind in (WEAK_MOTOR, SERVO_GAIN)


class ServoGain(MotorFault):
    """A joint whose servos have a lower gain, such as that of a firmware, with the same limits.

    Half of the gain holds half of the load at the same error, and the same largest load. Where no
    limit is reached, it equals a weak motor. It changes the velocity gain of the servo too.
    """

    def _fits(self, joint: Joint, _anatomy: Anatomy) -> bool:
        return bool(joint.motors) and set(joint.servos) == set(joint.motors)

    def apply(self, variant: "ModelVariant", anatomy: Anatomy, fault: Fault) -> None:
        """Scales the forces of the servos before their limits."""
        servos = [anatomy.motors.index(motor) for motor in anatomy.joint(fault.part).servos]
        variant.scale_gains(servos, fault.severity)


class DampedJoint(JointFault):
    """A joint whose viscous damping is scaled by a factor.

    A joint without damping in the model gets ``factor - 1`` times the damping that slows it with a
    time constant of 1 s. The search proposes larger damping only: smaller damping has hardly an
    effect beside the velocity gain of a servo, which is no part of the damping.
    """

    def apply(self, variant: "ModelVariant", anatomy: Anatomy, fault: Fault) -> None:
        """Scales the damping of the hinges."""
        for hinge in anatomy.joint(fault.part).hinges:
            variant.scale_damping(hinge, fault.severity)


class JointFriction(MotorFault):
    """A joint with dry friction, which stops it below a threshold of torque.

    The severity is a fraction of the largest torque of the joint's motors, in addition to the dry
    friction in the model. A weak motor does not change it.
    """

    def apply(self, variant: "ModelVariant", anatomy: Anatomy, fault: Fault) -> None:
        """Adds the friction to the hinges."""
        for hinge in anatomy.joint(fault.part).hinges:
            variant.add_dry_friction(hinge, fault.severity)


class EncoderOffset(JointFault):
    """A joint whose encoder measures its angle plus a constant.

    The severity, the measured minus the true angle, shifts the logged joint positions and the
    readings of the angle sensors of the joint. A prediction begins at the true angle, the logged
    one minus the offset. The servo has a measurement of its own. Faults of both encoder kinds at
    one joint add up. A jammed joint does not absorb the fault: its angle is measured with it.
    """

    def apply(self, variant: "ModelVariant", anatomy: Anatomy, fault: Fault) -> None:
        """Shifts what the encoders of the joint measure."""
        hinges = anatomy.joint(fault.part).hinges
        for hinge in hinges:
            variant.encoder_offset[anatomy.hinges.index(hinge)] += fault.severity
        for column, sensor in enumerate(anatomy.sensors):
            if sensor.hinge in hinges:
                shift = fault.severity / sensor.half_range
                variant.offset[column] += variant.gain[column] * shift


class EncoderSlip(EncoderOffset):
    """A joint whose encoder, which its servo uses, measures its angle plus a constant.

    Under the same commands, the true angle is lower by the offset. A weak motor scales the force
    that the slip adds, as all of its force.
    """

    def _fits(self, joint: Joint, _anatomy: Anatomy) -> bool:
        return bool(joint.servos)

    def apply(self, variant: "ModelVariant", anatomy: Anatomy, fault: Fault) -> None:
        """Shifts what the encoders of the joint measure, and the feedback of its servos."""
        super().apply(variant, anatomy, fault)
        for hinge in anatomy.joint(fault.part).hinges:
            variant.shift_feedback(hinge, fault.severity)


class LostGrip(JointFault):
    """A foot, what the last joint of a limb moves, whose sliding friction is scaled by a factor.

    The friction of the ground, ``friction``, applies to all feet, and the factor to what results.
    """

    def _fits(self, joint: Joint, anatomy: Anatomy) -> bool:
        ends_limb = joint.descendants.isdisjoint(other.name for other in anatomy.joints)
        return ends_limb and "" not in joint.bodies

    def apply(self, variant: "ModelVariant", anatomy: Anatomy, fault: Fault) -> None:
        """Scales the friction of the bodies of the foot."""
        variant.scale_grip(sorted(anatomy.joint(fault.part).bodies), fault.severity)


class LoadedLink(JointFault):
    """A mass, kg, at the centre of mass of the link that a joint moves, such as in an arm's hand.

    A robot has at most one. A payload on the base of a walking robot is ``payload``.
    """

    def apply(self, variant: "ModelVariant", anatomy: Anatomy, fault: Fault) -> None:
        """Adds the mass."""
        variant.load_link(anatomy.joint(fault.part).hinges[0], fault.severity)


BROKEN = BrokenJoint(name="break", words="the limb has come off at the joint {part}")
JAMMED = Jammed(name="jam", words="the joint {part} is stuck", is_of_joint=True)
JAMMED_AT_ANGLE = JammedAtAngle(
    name="jam-angle",
    keyword="jam",
    bounds=(-math.inf, math.inf),  # narrower at each joint
    degenerates_to={0.0: JAMMED},
    unit="rad",
    words="the joint {part} is stuck at {severity:.2f} rad",
    is_of_joint=True,
)
LOCKED_LEG = LockedLeg(
    name="leg",
    prefix="locked",
    unit="rad",
    words="the leg {part} is stuck",
)
WEAK_MOTOR = WeakMotor(
    name="motor",
    bounds=(0.0, 1.0),
    levels=(0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9),
    degenerates_to={1.0: None},
    unit="of its torque",
    words="the motor of the joint {part} has {severity:.0%} of its torque left",
    is_of_joint=True,
)
MOTOR_OFF = MotorOff(
    name="motor-off",
    keyword="motor",
    prefix="off",
    base="fixed",
    bounds=(0.0, 1.0),
    levels=(0.0, 0.1, 0.2, 0.5),
    degenerates_to={1.0: WEAK_MOTOR},
    unit="of the joint's resistance",
    words="the motor of the joint {part} is off, with {severity:.0%} of the joint's friction left",
    is_of_joint=True,
)
SERVO_GAIN = ServoGain(
    name="servo-gain",
    base="fixed",
    bounds=(0.1, 1.0),
    levels=(0.2, 0.4, 0.6, 0.8),
    degenerates_to={1.0: None},
    unit="of its gain",
    words="the servo of the joint {part} has {severity:.0%} of its gain",
    is_of_joint=True,
)
DAMPED_JOINT = DampedJoint(
    name="damping",
    bounds=(0.0, 100.0),
    levels=(3.0, 10.0, 30.0),
    degenerates_to={1.0: None},
    unit="times",
    words="the damping of the joint {part} is too {side}, {severity:.3g} times that of its model",
    is_of_joint=True,
)
JOINT_FRICTION = JointFriction(
    name="joint-friction",
    bounds=(0.0, 1.0),
    levels=(0.1, 0.2, 0.4),
    degenerates_to={0.0: None},
    unit="of the motors' largest torque",
    words="the joint {part} rubs: friction takes {severity:.0%} of its motor's torque",
    is_of_joint=True,
)
ENCODER_OFFSET = EncoderOffset(
    name="encoder-offset",
    bounds=(-1.0, 1.0),
    levels=(-0.3, -0.1, 0.1, 0.3),
    degenerates_to={0.0: None},
    unit="rad",
    words="the logged angle of the joint {part} is {amount:.2g} rad too {side}",
    is_of_joint=True,
)
ENCODER_SLIP = EncoderSlip(
    name="encoder-slip",
    keyword="encoder-offset",
    prefix="slip",
    bounds=(-1.0, 1.0),
    levels=(-0.3, -0.1, 0.1, 0.3),
    degenerates_to={0.0: None},
    unit="rad",
    words="the position encoder of the joint {part} reads {amount:.2g} rad too {side}",
    is_of_joint=True,
)
LOST_GRIP = LostGrip(
    name="grip",
    base="free",
    bounds=(0.0, 1.0),
    levels=(0.1, 0.2, 0.4),
    degenerates_to={1.0: None},
    unit="of its friction",
    words="the foot below the joint {part} has {severity:.0%} of its grip left",
)
LOADED_LINK = LoadedLink(
    name="load",
    base="fixed",
    bounds=(0.0, 100.0),
    levels=(0.03, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0),
    degenerates_to={0.0: None},
    is_single=True,
    unit="kg",
    words="the link of the joint {part} carries {severity:.3g} kg more",
)
OF_MOTORS = (WEAK_MOTOR, MOTOR_OFF, SERVO_GAIN)
"""Kinds without effect on a motor that moves nothing."""


def joints_at(fault: Fault, anatomy: Anatomy) -> tuple[Joint, ...]:
    """Returns the joints that a fault names: all of a locked leg, or one."""
    is_leg = fault.kind == LOCKED_LEG
    return anatomy.limbs[fault.part] if is_leg else (anatomy.joint(fault.part),)
