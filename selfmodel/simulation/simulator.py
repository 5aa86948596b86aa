"""Simulator: batches of closed-loop rollouts, short predictions and ensembles of the self-model."""

import copy
import os
from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import lru_cache, partial
from typing import Any, TypeVar

import mujoco
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.controllers.controller import CommandSource
from selfmodel.errors import check_name, check_type, typed, whole_number
from selfmodel.faults.build import apply_faults, build
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.robot.actuators import ancestors
from selfmodel.robot.model_variant import ModelVariant
from selfmodel.robot.mujoco_errors import uncounted_warnings
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import bind_data, state_writer, with_known_base
from selfmodel.rotation import directions
from selfmodel.simulation import domain
from selfmodel.simulation.prediction import predict
from selfmodel.simulation.reality_gap import perturbed_models
from selfmodel.simulation.requests import Ensemble, Segments
from selfmodel.simulation.rollout import Rollout, SimulationResult, SimulationStats, batch_bytes
from selfmodel.trials.estimation import STATE, estimated_states, known_steps
from selfmodel.trials.signals import SIGNALS, Signal
from selfmodel.trials.trajectory import Trajectory

Run = tuple[Hypothesis, CommandSource]
"""A simulation: faults of the robot, and the source of its commands."""

Until = Callable[[Mapping[Signal, FloatArray]], BoolArray]
"""Function of the signals so far, ``(n, steps, width)`` each; which runs may end, ``(n,)``."""

UNTIL_EVERY = 10
"""Control steps between two calls of an ``Until``."""

MAX_CACHED_VARIANTS, MAX_CACHED_ENSEMBLES = 1024, 16
"""Largest numbers of cached models, and of cached ensembles of about 8 models, if the memory does
not limit them: each takes up to half of that of a batch. A dog with its meshes has 5 MB."""


def thread_count(requested: int) -> int:
    """Returns the number of threads to use: ``requested``, or all processors where it is 0."""
    return whole_number("threads", requested, 0, least=0) or len(os.sched_getaffinity(0))


@typed
class Simulator:
    """Batch simulator of one robot; a run is bit-identical in every batch and thread count.

    Example:
        >>> import selfmodel
        >>> robot = selfmodel.load_robot("quadruped")
        >>> walk = selfmodel.read_log("before.mcap").trial.plan.controller
        >>> damaged = selfmodel.parse_hypothesis("break:front_left_knee", robot)
        >>> runs = [(selfmodel.Hypothesis(), walk), (damaged, walk)]
        >>> result = selfmodel.Simulator(robot).run(runs, steps=20, record=["base_position"])
        >>> result.trajectory["base_position"].shape
        (2, 20, 3)

    Args:
        robot: The healthy robot.
        threads: Threads of MuJoCo's steps, including the caller's; 0 for all processors.
        stats: Statistics that are updated; new ones by default.
    """

    def __init__(
        self, robot: Robot, threads: int = 0, stats: SimulationStats | None = None
    ) -> None:
        self.robot = robot
        self.threads = thread_count(threads)
        self.stats = SimulationStats() if stats is None else stats
        affordable = batch_bytes() // (2 * int(robot.model.nbuffer))
        models = max(1, min(MAX_CACHED_VARIANTS, affordable))
        ensembles = max(1, min(MAX_CACHED_ENSEMBLES, affordable // 8))
        self._variant = lru_cache(models)(partial(build, robot))
        self._members = lru_cache(ensembles)(partial(perturbed_models, robot))
        self._contact_points = lru_cache(16)(partial(ground_contact_points, robot))

    def finer(self, parts: int) -> "Simulator":
        """Returns a simulator of the robot with that many physics steps in place of each."""
        return Simulator(self.robot.finer(parts), self.threads, self.stats)

    @typed
    def run(
        self,
        runs: Sequence[Run],
        steps: int,
        record: Sequence[Signal],
        state: Mapping[Signal, FloatArray] | None = None,
    ) -> SimulationResult:
        """Simulates each run (at least one) from the initial pose, ``(n, steps, width)``.

        Or from a state, signals of the joints and of the base, ``(1, width)`` each.
        """
        for signal in record:
            check_name("signal", str(signal), SIGNALS)
        check_type(runs[0] if runs else None, tuple, "pairs (Hypothesis, Controller) as runs")
        steps = whole_number("steps", steps, 1000, least=1)
        variants = [self._variant(hypothesis) for hypothesis, _ in runs]
        drivers = [driver for _, driver in runs]
        if state is None:
            return self._run(variants, drivers, steps, record)
        start = np.tile(self.robot.model.qpos0, (len(runs), 1))
        speeds = np.zeros((len(runs), self.robot.model.nv))
        bind = {"qpos": start, "qvel": speeds}.__getitem__
        state_writer(self.robot, bind, *(variant.model for variant in variants))(state)
        return self._run(variants, drivers, steps, record, start=start, speeds=speeds)

    def predict(
        self,
        hypotheses: Sequence[Hypothesis],
        segments: Segments,
        observed: Trajectory | None = None,
    ) -> SimulationResult:
        """Predicts segments of a trial under each hypothesis; see ``prediction.predict``.

        Fault kinds whose model adapts to ground contacts have those of the trial, ``observed``; if
        it is None, or without the base's position in the segments, the self-model's own ground.
        """
        variants = [self._variant(hypothesis) for hypothesis in hypotheses]
        if observed is not None and "base_position" in segments.states:
            for number, hypothesis in enumerate(hypotheses):
                faults = [fault for fault in hypothesis.faults if fault.kind.adapts_to_contacts]
                if faults:
                    variants[number] = copy.deepcopy(variants[number])  # the other is cached
                for fault in faults:
                    points = self._contact_points(observed)
                    fault.kind.adapt_to_contacts(variants[number], fault, points)
        first: dict[Hypothesis, int] = {}
        return predict(
            *(self.robot, variants, segments),
            same_dynamics_as=[
                first.setdefault(own.dynamics_part, i) for i, own in enumerate(hypotheses)
            ],
            threads=self.threads,
            stats=self.stats,
        )

    def run_ensemble(
        self,
        hypotheses: Sequence[Hypothesis],
        driver: CommandSource,
        steps: int,
        ensemble: Ensemble,
    ) -> SimulationResult:
        """Simulates each hypothesis with each member of an ensemble of perturbed self-models.

        Returns:
            Signals of ``(n, members, steps, width)``; a hypothesis has diverged if any member has.
        """
        variants = [
            apply_faults(model, self.robot.anatomy, hypothesis)
            for hypothesis in hypotheses
            for model in self._members(hypothesis.spec_part, ensemble.members, ensemble.level)
        ]
        flat = self._run(variants, [driver] * len(variants), steps, ensemble.record)
        grouped = flat.grouped(len(hypotheses), ensemble.members)
        return SimulationResult(grouped.trajectory, np.asarray(grouped.diverged.any(axis=1)))

    def run_under(
        self,
        conditions: Sequence[domain.DomainSample],
        uncertainty: domain.DomainDistribution,
        drivers: Sequence[CommandSource],
        steps: int,
        record: Sequence[Signal],
        *,
        until: Until | None = None,
    ) -> SimulationResult:
        """Simulates each driver under each condition.

        A run that may end by ``until`` has its last state from then on.

        Returns:
            Signals of ``(drivers, conditions, steps, width)``, and a mask of
            ``(drivers, conditions)``.
        """
        robot, count = self.robot, len(drivers)
        variants = [condition.variant(robot) for condition in conditions]
        start = domain.initial_positions(robot, variants, conditions, uncertainty.start)
        flat = self._run(
            [*variants] * count,
            [driver for driver in drivers for _ in conditions],
            steps,
            record,
            start=np.tile(start, (count, 1)),
            disturb=domain.measurement_noise(robot, variants, conditions, uncertainty),
            until=until,
        )
        return flat.grouped(count, len(conditions))

    @uncounted_warnings()
    def _run(
        self,
        variants: Sequence[ModelVariant],
        drivers: Sequence[CommandSource],
        steps: int,
        record: Sequence[Signal],
        *,
        until: Until | None = None,
        **changes: Any,  # noqa: ANN401  # ``start``, ``speeds`` and ``disturb`` of a rollout
    ) -> SimulationResult:
        names, n = self.robot.anatomy.names, len(variants)
        rollout = Rollout(
            *(self.robot, variants, drivers, record),
            threads=self.threads,
            stats=self.stats,
            **changes,
        )
        # Steps first during the run, so that each step is written to contiguous memory.
        kept = {signal: np.empty((steps, n, names.width(signal))) for signal in record}
        time = np.arange(steps, dtype=np.float64) * self.robot.control_timestep
        for k in rollout.steps(steps):
            for signal, rows in kept.items():
                rows[k] = rollout.live[signal]()
            if until and k % UNTIL_EVERY == UNTIL_EVERY - 1:
                begun = {signal: rows[: k + 1].swapaxes(0, 1) for signal, rows in kept.items()}
                if not rollout.end(until(begun)):
                    for rows in kept.values():
                        rows[k + 1 :] = rows[k]
                    break
        diverged = rollout.diverged()
        self.stats.count(n, 0, diverged)
        signals = {
            signal: np.ascontiguousarray(rows.swapaxes(0, 1)) for signal, rows in kept.items()
        }
        return SimulationResult(Trajectory(names, time, signals), diverged)


MAX_GROUND_DISTANCE = 10.0
"""Largest distance between a foot and the model's level ground, m."""


def ground_contact_points(robot: Robot, trajectory: Trajectory) -> FloatArray:
    """Returns the ground contact points of the bodies with touch sensors in a trial.

    A contact point is the lowest point of a body, at each step with a touch reading of 1. Wrong
    touch readings result in points in the air. A body beyond an unknown hinge has no contact point.

    Returns:
        ``(n, 3)``, world frame, m, read-only; ``(0, 3)`` for a model without level ground.
    """
    model, feet, points = robot.model, _feet(robot), list[FloatArray]()
    planes = (model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE) & (model.geom_bodyid == 0)
    grounds = np.flatnonzero(planes)
    if len(grounds) and feet:
        ground = int(grounds[np.argmax(directions(model.geom_quat[grounds])[:, -1])])
        states = estimated_states(with_known_base(robot, trajectory), STATE)
        touched, unknown = trajectory["sensors"] == 1, np.isnan(states["joint_positions"])
        data, nearest = mujoco.MjData(model), np.empty(6)
        write = state_writer(robot, bind_data(data))
        for step in np.flatnonzero(known_steps(states) & touched[:, list(feet)].any(axis=1)):
            write({signal: values[[step]] for signal, values in states.items()})
            mujoco.mj_kinematics(model, data)
            for column, (geoms, hinges) in feet.items():
                if not touched[step, column] or unknown[step, hinges].any():
                    continue
                distance = MAX_GROUND_DISTANCE
                for geom in geoms:
                    apart = mujoco.mj_geomDistance(
                        model, data, ground, geom, MAX_GROUND_DISTANCE, nearest
                    )
                    if apart < distance:
                        distance, lowest = apart, nearest[3:].copy()
                if distance < MAX_GROUND_DISTANCE:
                    points.append(lowest)
    contacts = np.array(points).reshape(-1, 3)
    contacts.flags.writeable = False  # the simulator caches the array
    return contacts


def _feet(robot: Robot) -> dict[int, tuple[list[int], list[int]]]:
    """Returns of each touch sensor with a colliding body, by its column, what determines its place.

    They are the colliding geoms of the body, and the columns of the hinges between it and the root.
    """
    model, feet = robot.model, {}
    solid = (model.geom_contype | model.geom_conaffinity) != 0
    body_of_hinge = [int(model.joint(name).bodyid[0]) for name in robot.anatomy.hinges]
    for column, sensor in enumerate(robot.anatomy.sensors):
        if sensor.kind == "touch":
            body = int(model.site_bodyid[int(model.sensor(sensor.name).objid[0])])
            geoms = np.flatnonzero(solid & (model.geom_bodyid == body)).tolist()
            chain = ancestors(model, body)
            if geoms:
                feet[column] = geoms, [k for k, own in enumerate(body_of_hinge) if own in chain]
    return feet


Key = TypeVar("Key", bound=Hashable)


def cached_rows(
    known: dict[Key, FloatArray], keys: Sequence[Key], compute: Callable[[list[Key]], FloatArray]
) -> list[FloatArray]:
    """Returns the row of each key; ``compute`` returns those of new, distinct keys, once each."""
    missing = list(dict.fromkeys(key for key in keys if key not in known))
    if missing:
        known.update(zip(missing, compute(missing), strict=True))
    return [known[key] for key in keys]
