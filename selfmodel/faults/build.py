"""Builds the model of a robot under a hypothesis."""

from collections.abc import Callable, Sequence

import mujoco
import numpy as np
from mujoco import MjModel, MjSpec

from selfmodel.errors import typed
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.joints import BROKEN, JAMMED, JAMMED_AT_ANGLE, LOCKED_LEG, joints_at
from selfmodel.faults.kind import FaultKind
from selfmodel.robot.anatomy import Anatomy, Joint, added_steps, write_control_delay
from selfmodel.robot.model_variant import ModelVariant
from selfmodel.robot.mujoco_errors import mujoco_errors_as_input_errors
from selfmodel.robot.robot import Robot, mjcf_of

SpecEdit = Callable[[MjSpec], None]
"""Function that edits a specification, in place, before its compilation."""


@typed
def build(
    robot: Robot,
    hypothesis: Hypothesis,
    seed: int = 0,
    *,
    edits: Sequence[SpecEdit] = (),
    perturb: Callable[[MjModel], MjModel] | None = None,
) -> ModelVariant:
    """Returns the variant of a robot under a hypothesis.

    Args:
        robot: The nominal robot.
        hypothesis: Hypothesis in canonical form.
        seed: Seed of the random parts of the faults, such as the shape of rough terrain. The
            self-model's seed is 0; a simulated physical robot has another seed.
        edits: Further edits of the specification, after those of the hypothesis.
        perturb: Maps the compiled model to the model that the faults are applied to; identity by
            default.

    Raises:
        InputError: A fault does not apply to the model, such as roughness without a ground plane,
            or MuJoCo cannot simulate the model.
    """
    model = compile_model(robot, hypothesis, seed, edits)
    if perturb is not None:
        model = perturb(model)
    return apply_faults(model, robot.anatomy, hypothesis, seed)


def compile_model(
    robot: Robot, hypothesis: Hypothesis, seed: int = 0, edits: Sequence[SpecEdit] = ()
) -> MjModel:
    """Returns the compiled model with the faults that edit the specification; see ``build``.

    The result is the robot's own model, not a copy, if the specification is not edited.
    """
    if not hypothesis.spec_part.faults and not edits:
        return robot.model
    return _compiled(robot, hypothesis, seed, edits)[1]


def _compiled(
    robot: Robot, hypothesis: Hypothesis, seed: int, edits: Sequence[SpecEdit] = ()
) -> tuple[MjSpec, MjModel]:
    spec = robot.specification()
    for fault in hypothesis.spec_part.faults:
        fault.kind.edit_specification(spec, fault, seed)
    for edit in edits:
        edit(spec)
    with mujoco_errors_as_input_errors(f"compile the model of {hypothesis}"):
        return spec, spec.compile()


MIN_MASS = 1e-9
"""Mass, kg, and moments of inertia, kg m^2, of a detached body in an MJCF: 0 is refused."""


def edited_mjcf(robot: Robot, hypothesis: Hypothesis) -> str:
    """Returns the MJCF of a robot with the faults of a hypothesis, to six digits.

    Its parts are those of the robot's own, in the same order. A detached body has ``MIN_MASS``. A
    delay is the custom numeric ``CONTROL_DELAY``. Faults of readings and encoders are not in it.
    """
    spec, compiled = _compiled(robot, hypothesis, 0)
    variant = apply_faults(compiled, robot.anatomy, hypothesis)
    model, nominal = variant.model, robot.model
    moving = compiled.body_mass > 0
    model.body_mass[moving] = np.maximum(model.body_mass[moving], MIN_MASS)
    model.body_inertia[moving] = np.maximum(model.body_inertia[moving], MIN_MASS)
    # A range of 0 is refused; a motor without a gain needs none.
    for name in ("actuator_forcerange", "jnt_actfrcrange"):
        ranges = getattr(model, name)
        ranges[:] = np.where(ranges.any(axis=1, keepdims=True), ranges, getattr(nominal, name))
    with mujoco_errors_as_input_errors(f"write the model of {hypothesis}"):
        spec.copy_back(model)  # but for flags
        for geom in spec.geoms:
            for name in ("contype", "conaffinity", "condim", "priority"):
                setattr(geom, name, int(getattr(model, f"geom_{name}")[geom.id]))
        for joint in spec.joints:
            joint.limited = int(model.jnt_limited[joint.id])
        for tendon in spec.tendons:
            tendon.limited = int(model.tendon_limited[tendon.id])
        for equality in spec.equalities:
            equality.active = int(model.eq_active0[equality.id])
        if added := added_steps(robot.control_delay, float(variant.added_delay[0])):
            write_control_delay(spec, robot.control_delay + added)
        return mjcf_of(spec)


def apply_faults(
    model: MjModel, anatomy: Anatomy, hypothesis: Hypothesis, seed: int = 0
) -> ModelVariant:
    """Returns the variant of a model of ``compile_model`` with the faults of a hypothesis applied.

    The model is not changed. The seed is that of the random parts of the faults.
    """
    variant = ModelVariant.of(model, anatomy, seed)
    if not hypothesis.faults:
        return variant
    for fault in hypothesis.faults:
        fault.kind.apply(variant, anatomy, fault)
    with mujoco_errors_as_input_errors(f"simulate the model of {hypothesis}"):
        # One MjData for both models, which have one layout: its allocation takes the most time.
        data = mujoco.MjData(model)
        nominal = _mean_inertia(model, data)
        mujoco.mj_setConst(variant.model, data)
        # Tendons keep their length, although a welded joint's angle has become its reference.
        variant.model.tendon_length0[:] = model.tendon_length0
        # The solver's tolerance is relative to the mean inertia, and a welded hinge's armature
        # would make any solution converged. The absolute tolerance is kept.
        variant.model.opt.tolerance *= nominal / _mean_inertia(variant.model, data)
    return variant


def _mean_inertia(model: MjModel, data: mujoco.MjData) -> float:
    """Returns the mean of the mass matrix's diagonal in the reference configuration."""
    mujoco.mj_resetData(model, data)
    mujoco.mj_fwdPosition(model, data)
    return float(data.M[model.M_rowadr + model.M_rownnz - 1].mean())


def detached_bodies(anatomy: Anatomy, model: MjModel, hypothesis: Hypothesis) -> frozenset[int]:
    """Returns the ids in a model of the bodies that a hypothesis detaches."""
    broken = _joints_with((BROKEN,), anatomy, hypothesis)
    return frozenset(int(model.body(name).id) for joint in broken for name in joint.bodies)


def jammed_bodies(anatomy: Anatomy, model: MjModel, hypothesis: Hypothesis) -> frozenset[int]:
    """Returns the ids in a model of the bodies at the joints that a hypothesis jams."""
    jammed = _joints_with((JAMMED, JAMMED_AT_ANGLE, LOCKED_LEG), anatomy, hypothesis)
    return frozenset(int(model.joint(one).bodyid[0]) for joint in jammed for one in joint.hinges)


def _joints_with(
    kinds: Sequence[FaultKind], anatomy: Anatomy, hypothesis: Hypothesis
) -> list[Joint]:
    faults = [fault for fault in hypothesis.faults if fault.kind in kinds]
    return [joint for fault in faults for joint in joints_at(fault, anatomy)]
