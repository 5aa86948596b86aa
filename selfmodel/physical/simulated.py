"""Simulated physical robot: hidden faults, a reality gap with noise, and debris of lost limbs."""

import dataclasses
from collections.abc import Iterator, Mapping
from functools import partial

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import CommandSource
from selfmodel.errors import TrialError, typed
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.joints import BROKEN
from selfmodel.robot.model_variant import ModelVariant
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import BASE_SIGNALS
from selfmodel.simulation.domain import (
    dead_sensors,
    joint_half_ranges,
    randomize_initial_pose,
    rotated_by_vector,
    start_spread,
)
from selfmodel.simulation.reality_gap import (
    DEBRIS_PREFIX,
    RealityGap,
    draw_gap_of,
    perturbed_model,
)
from selfmodel.simulation.rollout import Rollout
from selfmodel.trials.signals import MEASUREMENT_FULL_SCALES, SIGNALS, Signal
from selfmodel.trials.trajectory import Sample

OWN_SEED = 1
"""Seed of the randomness of a fault, such as terrain, in a physical robot without a gap; the
self-model's seed is 0."""

CONTACT_MEMORY = 4 * 2**20
"""Size of MuJoCo's arena for the contacts of a robot with its debris, bytes."""


@typed
def draw_gap(robot: Robot, level: float, rng: np.random.Generator) -> RealityGap:
    """Returns a random reality gap for a robot; see ``draw_gap_of``."""
    return draw_gap_of(robot.model, robot.anatomy, level, rng)


class Measurement:
    """Measurements without noise, from true values to received readings and logged signals."""

    def corrupt_readings(self, readings: FloatArray) -> None:
        """Replaces true readings, ``(sensors,)``, by the readings that the controller receives."""

    def measure(self, _signal: Signal, values: FloatArray) -> FloatArray:
        """Returns the logged row of a signal, ``(width,)``; it may be ``values`` itself."""
        return values


class NoisyMeasurement(Measurement):
    """Measurements with white noise in proportion to the full scale of each signal.

    An angle reading has normal noise with a standard deviation of ``level`` (half of the range is a
    reading of 1). A touch reading is flipped with a probability of ``level / 2``. A dead sensor
    reads exactly 0. Logged signals have noise independent of what the controller observes.
    """

    def __init__(
        self, level: float, robot: Robot, variant: ModelVariant, rng: np.random.Generator
    ) -> None:
        self._level, self._rng = level, rng
        self._dead = dead_sensors(robot.anatomy, variant)
        self._touch = np.array([sensor.kind == "touch" for sensor in robot.anatomy.sensors])
        self._half_ranges = joint_half_ranges(robot)

    def corrupt_readings(self, readings: FloatArray) -> None:
        """Adds noise to the readings."""
        # The draws do not depend on the dead sensors: a fault leaves all other noise unchanged.
        wrong = self._rng.random(readings.shape) < self._level / 2
        noise = self._level * self._rng.standard_normal(readings.shape)
        flipped = np.where(wrong, 1 - readings, readings)
        noisy = np.where(self._touch, flipped, readings + noise)
        readings[:] = np.where(self._dead, 0.0, noisy)

    def measure(self, signal: Signal, values: FloatArray) -> FloatArray:
        """Returns the values with noise."""
        if signal in ("sensors", "commands"):
            return values
        if signal == "base_orientation":
            turn = self._level * MEASUREMENT_FULL_SCALES[signal] * self._rng.standard_normal(3)
            return rotated_by_vector(values, turn)
        joints = signal == "joint_positions"
        scale = self._half_ranges if joints else MEASUREMENT_FULL_SCALES[signal]
        return np.asarray(values + self._level * scale * self._rng.standard_normal(values.shape))


@typed
class SimulatedRobot:
    """Simulated physical robot with a hidden fault.

    Args:
        robot: The robot as its model describes it.
        hidden: Hidden faults of the physical robot, as a hypothesis.
        gap: Reality gap; None or a level of 0 for no gap.
        stream: Number of the robot's random number stream among those of the gap's seed. Robots
            that share a gap, such as one robot before and after its failure, have different
            streams.
    """

    def __init__(
        self,
        robot: Robot,
        hidden: Hypothesis = INTACT,
        gap: RealityGap | None = None,
        stream: int = 0,
    ) -> None:
        self.robot = robot
        self._gap = gap if gap is not None and gap.level > 0 else None
        seed = gap.seed if gap else OWN_SEED
        self._variant, self._limbs = physical_variant(robot, hidden, seed, self._gap)
        self._noise = np.random.SeedSequence(seed, spawn_key=(stream,))

    def run(self, controller: CommandSource, steps: int) -> Iterator[Sample]:
        """Runs a controller; see ``PhysicalRobot``.

        Without a gap, the samples are bit-identical to the ``Simulator``'s, unless the fault is
        random, such as terrain, which differs from the self-model's. With a gap, each run has the
        next random number stream: two runs differ, and the n-th runs of two robots with the same
        seed are bit-identical.

        Raises:
            TrialError: The simulation diverged.
            InputError: MuJoCo cannot simulate the model.
        """
        (child,) = self._noise.spawn(1)
        return self._run(child, controller, steps)

    def _run(
        self, child: np.random.SeedSequence, controller: CommandSource, steps: int
    ) -> Iterator[Sample]:
        robot, variant, gap = self.robot, self._variant, self._gap
        measurement, start = Measurement(), None
        if gap is not None:
            (of_faults,) = child.spawn(1)
            seed = int(of_faults.generate_state(1)[0])
            variant = dataclasses.replace(variant, seed=seed)
            rng = np.random.default_rng(child)
            measurement = NoisyMeasurement(gap.level, robot, variant, rng)
            data = mujoco.MjData(variant.model)
            randomize_initial_pose(robot, data, start_spread(gap.level), rng)
            place_debris(variant.model, data, self._limbs)
            start = data.qpos[np.newaxis]
        # The pose of a fixed base is known, so no sensor measures it.
        known = BASE_SIGNALS if robot.has_fixed_base else ()

        def disturb(readings: FloatArray, observed: Mapping[str, FloatArray]) -> None:
            measurement.corrupt_readings(readings[0])
            for signal in SIGNALS:
                if signal in observed and signal not in known:
                    observed[signal][0] = measurement.measure(signal, observed[signal][0])

        rollout = Rollout(
            robot,
            [variant],
            [controller],
            SIGNALS,
            start=start,
            disturb=disturb,
            added_delay=0 if gap is None else gap.delay,
        )
        for k in rollout.steps(steps):
            if rollout.diverged()[0]:
                raise TrialError(
                    f"the simulation of the physical robot diverged after step {max(0, k - 1)}: "
                    f"its model is unstable under this controller; try a smaller physics time step"
                )
            true = {signal: rollout.live[signal]()[0] for signal in SIGNALS}
            if not np.isfinite(true["commands"]).all():  # of a network that divides by 0
                raise TrialError(f"the controller's commands are not finite at step {k}")
            yield Sample(
                time=k * robot.control_timestep,
                values={
                    signal: (row if signal in known else measurement.measure(signal, row)).copy()
                    for signal, row in true.items()
                },
            )


def physical_variant(
    robot: Robot, hidden: Hypothesis, seed: int, gap: RealityGap | None
) -> tuple[ModelVariant, tuple[str, ...]]:
    """Returns the model of a physical robot, and the root body of each limb of its debris.

    A robot with a gap has the debris of the limbs that a hypothesis detaches, in the order of its
    faults. The seed is that of the random parts of the faults.
    """
    if gap is None:
        return build(robot, hidden, seed), ()
    joints = [robot.anatomy.joint(each.part) for each in hidden.faults if each.kind is BROKEN]
    limbs = tuple(min(one.bodies, key=lambda name: robot.model.body(name).id) for one in joints)
    edits = [partial(add_debris, limbs=limbs)] if limbs else []
    perturb = partial(perturbed_model, gap=gap)
    return build(robot, hidden, seed, edits=edits, perturb=perturb), limbs


def add_debris(spec: mujoco.MjSpec, limbs: tuple[str, ...]) -> None:
    """Adds a free copy of each limb to a physical robot's model, after all other bodies.

    The robot's own limb remains as a detached body, so that the layout of the logged signals is
    unchanged. The copy has no motors, tendons and sensors, and its joints are free. The copy
    collides with the ground, the robot and other debris, but not with a body that it overlaps at
    the start: the contact force would throw the copy away.
    """
    bare = spec.copy()
    own = (bare.actuators, bare.sensors, bare.equalities, bare.tendons)
    # _overlapping_pairs computes the excluded pairs anew.
    for parts in (*own, bare.excludes, bare.pairs):
        for part in list(parts):
            bare.delete(part)
    for k, limb in enumerate(limbs):
        _add_limb(spec, bare, limb, k)
    spec.memory = max(spec.memory, CONTACT_MEMORY)
    for first, second in _overlapping_pairs(spec, limbs):
        spec.add_exclude(bodyname1=first, bodyname2=second)


def _add_limb(spec: mujoco.MjSpec, bare: mujoco.MjSpec, limb: str, number: int) -> None:
    # Every attachment has copies of its materials and meshes: a prefix per limb keeps them apart.
    prefix = f"{DEBRIS_PREFIX}{number}_"
    spec.worldbody.add_frame().attach_body(bare.copy().body(limb), prefix, "")
    root = spec.body(prefix + limb)
    for part in (root, *(p for kind in ("body", "joint", "geom") for p in root.find_all(kind))):
        part.name = part.name.replace(prefix, DEBRIS_PREFIX, 1)
    for joint in list(root.joints):
        spec.delete(joint)
    root.add_freejoint(name=DEBRIS_PREFIX + limb)
    affinities = int(np.bitwise_or.reduce([int(geom.conaffinity) for geom in bare.geoms]))
    for geom in root.find_all("geom"):
        if geom.contype or geom.conaffinity:
            geom.contype |= affinities
            geom.conaffinity |= affinities


def _overlapping_pairs(spec: mujoco.MjSpec, limbs: tuple[str, ...]) -> list[tuple[str, str]]:
    """Returns the pairs of a body and a debris body that overlap when the limbs are detached."""
    model = spec.compile()
    data = mujoco.MjData(model)
    place_debris(model, data, limbs)
    mujoco.mj_forward(model, data)
    geoms = data.contact.geom[data.contact.dist < 0]
    pairs = np.unique(np.sort(model.geom_bodyid[geoms], axis=1), axis=0)
    # Debris has the highest body numbers, so the second of a pair; the world is body 0.
    return [
        (model.body(first).name, model.body(second).name)
        for first, second in pairs
        if first != 0 and model.body(second).name.startswith(DEBRIS_PREFIX)
    ]


def place_debris(model: mujoco.MjModel, data: mujoco.MjData, limbs: tuple[str, ...]) -> None:
    """Sets the pose of each debris body to the pose of the limb that the body is a copy of."""
    mujoco.mj_kinematics(model, data)
    for limb in limbs:
        body = data.body(limb)
        data.joint(DEBRIS_PREFIX + limb).qpos[:] = np.concatenate([body.xpos, body.xquat])
    for j in range(model.njnt):
        name = model.joint(j).name
        if name.startswith(DEBRIS_PREFIX) and model.jnt_type[j] != mujoco.mjtJoint.mjJNT_FREE:
            data.joint(j).qpos[:] = data.joint(name.removeprefix(DEBRIS_PREFIX)).qpos
