"""MAP-Elites on the archive of pyribs: makes a repertoire, and evaluates it under a hypothesis."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from time import perf_counter
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.errors import InputError, WorkError
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.falls import falls_of
from selfmodel.recovery.repertoire import Origin, Repertoire, model_digest
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import forward_displacement
from selfmodel.trials.signals import Signal
from selfmodel.version import __version__

if TYPE_CHECKING:
    from ribs.archives import GridArchive
    from ribs.emitters import IsoLineEmitter

BATCH = 200
"""Gaits in a batch: more take memory and no less time."""

EVALUATIONS = 60_000
"""Default number of evaluations: ten minutes of the quadruped on two cores."""

ISO_SIGMA = 0.02
"""Standard deviation of the independent mutation of each weight: 0.01 of its range. Source:
Vassiliades and Mouret, *Discovering the elite hypervolume by leveraging interspecies correlation*
(GECCO 2018)."""

LINE_SIGMA = 0.2
"""Standard deviation of the step along the line to another elite, relative to their distance.
Source: the same article."""

LEVELS: Mapping[int, int] = MappingProxyType(
    {1: 1000, 2: 100, 3: 40, 4: 20, 5: 10, 6: 5, 7: 3, 8: 3, 9: 3, 10: 3}
)
"""Cells along each axis, by number of feet: 5 for the hexapod, as in Cully et al. (2015), and finer
for fewer feet, so that at least 10,000 gaits find a cell."""

RECORD: tuple[Signal, ...] = ("base_position", "base_orientation", "sensors")

Evaluate = Callable[[Sequence[Controller]], tuple[FloatArray, FloatArray]]
"""Function that evaluates gaits: scores, ``(n,)``, with negative infinity for a gait that may not
enter a repertoire, and duty factors, ``(n, feet)``."""


@dataclass(frozen=True)
class Filling:
    """Progress of the search for a repertoire.

    Attributes:
        evaluations: Gaits evaluated so far.
        total: Gaits that the whole search evaluates.
        gaits: Filled cells.
        best: Best score so far; negative infinity without a gait.
        seconds: Wall time since the start, s.
    """

    evaluations: int
    total: int
    gaits: int
    best: float
    seconds: float


def make_repertoire(
    robot: Robot,
    design: Design,
    evaluate: Evaluate,
    *,
    steps: int,
    seed: int,
    evaluations: int = EVALUATIONS,
    levels: int | None = None,
    seeds: Sequence[Controller] = (),
    batch: int = BATCH,
    on_filling: Callable[[Filling], None] = lambda _filling: None,
) -> Repertoire:
    """Returns a repertoire of gaits: the best genome of each cell of a grid of duty factors.

    All genomes are in hundredths, as random genomes are. The batches are random until a genome has
    entered the archive. Children are drawn by Iso+LineDD from pairs of elites.

    Source: J.-B. Mouret and J. Clune, *Illuminating search spaces by mapping elites* (2015).

    Args:
        robot: The healthy robot.
        design: Design of the controllers.
        evaluate: Evaluation of gaits; see ``simulated_evaluation``.
        steps: Control steps of a rollout of ``evaluate``, for the origin of the repertoire.
        seed: Seed of all random numbers.
        evaluations: Number of gaits to evaluate.
        levels: Cells along each axis of the grid; None for ``LEVELS`` of the robot's feet.
        seeds: Controllers of the first batch; controllers of another design are ignored.
        batch: Gaits in a batch.
        on_filling: Called after each batch.

    Raises:
        InputError: The robot has no touch sensors or too many, or pyribs is not installed.
        WorkError: No gait entered the repertoire.
    """
    start, feet = perf_counter(), len(feet_of(robot.anatomy))
    cells, rng = levels or LEVELS[feet], np.random.default_rng(seed)
    archive, emitter = _archive(design.weights, feet, cells, batch, rng)
    known = [one.genome for one in seeds if one.design == design][:batch]
    genomes = np.array(known).reshape(-1, design.weights)
    genomes = np.concatenate([genomes, draw_genomes(rng, (batch - len(genomes), design.weights))])
    done, best = 0, -np.inf
    while done < evaluations:
        scores, duty = evaluate([Controller(design, genome) for genome in genomes])
        viable = scores > -np.inf
        if viable.any():
            archive.add(genomes[viable], scores[viable], duty[viable])
        done, best = done + len(genomes), max(best, float(scores.max()))
        if archive.empty:
            genomes = draw_genomes(rng, (batch, design.weights))
        else:
            genomes = np.rint(emitter.ask() * 100) / 100
        gaits = int(archive.stats.num_elites)
        on_filling(Filling(done, evaluations, gaits, best, perf_counter() - start))
    if archive.empty:
        raise WorkError(
            f"none of {done} gaits of {robot.name} moved forward without a fall: evaluate more of "
            f"them, or give controllers to begin with"
        )
    origin = Origin(robot.name, model_digest(robot), steps, done, cells, seed, __version__)
    found = archive.data(["solution", "objective", "measures"], return_type="tuple")
    solutions, scores, duty = (np.asarray(one, dtype=np.float64) for one in found)
    return Repertoire(design, solutions, scores, duty, origin)


def _archive(
    length: int, axes: int, levels: int, batch: int, rng: np.random.Generator
) -> "tuple[GridArchive, IsoLineEmitter]":
    try:
        # Imported here: pyribs imports numba and takes a second.
        from ribs.archives import GridArchive  # noqa: PLC0415  # see the line above
        from ribs.emitters import IsoLineEmitter  # noqa: PLC0415  # see the line above
    except ImportError as error:
        raise InputError(
            "a repertoire is made with pyribs, which is not installed: run "
            "`pip install 'selfmodel[repertoire]'`"
        ) from error
    archive_seed, emitter_seed = (int(seed) for seed in rng.integers(2**31, size=2))
    archive = GridArchive(
        solution_dim=length, dims=[levels] * axes, ranges=[(0.0, 1.0)] * axes, seed=archive_seed
    )
    emitter = IsoLineEmitter(
        archive,
        iso_sigma=ISO_SIGMA,
        line_sigma=LINE_SIGMA,
        x0=np.zeros(length),
        lower_bounds=np.full(length, -1.0),
        upper_bounds=np.full(length, 1.0),
        batch_size=batch,
        seed=emitter_seed,
    )
    return archive, emitter


def feet_of(anatomy: Anatomy) -> tuple[str, ...]:
    """Returns the names of the touch sensors, one per foot.

    Raises:
        InputError: The robot has no touch sensors, or more than the grid can have axes.
    """
    feet = tuple(sensor.name for sensor in anatomy.sensors if sensor.kind == "touch")
    if not feet:
        raise InputError(
            "a repertoire needs the touch sensors of feet, and this robot has none: add sites "
            "with <touch> sensors to the feet in its MJCF, or choose another search"
        )
    if len(feet) > max(LEVELS):
        raise InputError(
            f"a repertoire has an axis per foot and at most {max(LEVELS)}, got {len(feet)} touch "
            f"sensors: keep one touch sensor per foot in the MJCF"
        )
    return feet


def duty_factors(anatomy: Anatomy, readings: FloatArray) -> FloatArray:
    """Returns the duty factor of each foot: the fraction of the steps with ground contact.

    Source: A. Cully, J. Clune, D. Tarapore and J.-B. Mouret, *Robots that can adapt like animals*
    (Nature 521:503, 2015), Methods: the behavioural descriptor of the hexapod.

    Args:
        anatomy: Parts of the robot.
        readings: Readings of all sensors, ``(..., steps, sensors)``; touch is 0 or 1.

    Returns:
        ``(..., feet)``, each 0 to 1.
    """
    touch = [k for k, sensor in enumerate(anatomy.sensors) if sensor.kind == "touch"]
    return np.asarray(readings[..., touch].mean(axis=-2))


def simulated_evaluation(simulator: Simulator, hypothesis: Hypothesis, steps: int) -> Evaluate:
    """Returns the evaluation of gaits by their forward displacement in simulation, m.

    The score is negative infinity for a gait that falls, diverges, or does not move forward.

    Args:
        simulator: Self-model.
        hypothesis: Faults of the simulated robot.
        steps: Control steps of a rollout.

    Raises:
        InputError: The robot has no touch sensors.
    """
    feet_of(simulator.robot.anatomy)
    return partial(_evaluate, simulator, hypothesis, steps)


def _evaluate(
    simulator: Simulator, hypothesis: Hypothesis, steps: int, controllers: Sequence[Controller]
) -> tuple[FloatArray, FloatArray]:
    robot, found = simulator.robot, []
    for start in range(0, len(controllers), BATCH):
        batch = controllers[start : start + BATCH]
        result = simulator.run([(hypothesis, one) for one in batch], steps, RECORD)
        scores = np.array(forward_displacement(result.behaviour))
        falls = falls_of(robot, hypothesis, result.behaviour) < steps
        scores[result.diverged | falls | ~(scores > 0)] = -np.inf
        found.append((scores, duty_factors(robot.anatomy, result.behaviour["sensors"])))
    return np.concatenate([one for one, _ in found]), np.concatenate([two for _, two in found])


@dataclass(frozen=True, eq=False)
class Reevaluation:
    """Gaits of a repertoire, evaluated anew and sorted by the new score, best first.

    Attributes:
        gaits: Indices in the repertoire, ``(n,)``.
        scores: New scores, ``(n,)``; negative infinity for a gait that falls, for example.
        controllers: Controllers of the gaits with a finite score, best first.
    """

    gaits: IndexArray
    scores: FloatArray
    controllers: tuple[Controller, ...]


def reevaluate(
    repertoire: Repertoire, evaluate: Evaluate, *, sample: int | None = None
) -> Reevaluation:
    """Returns the gaits of a repertoire by their score in another evaluation.

    No physical trial is needed for the gaits of a damaged robot: they are evaluated in simulation
    under the diagnosed hypothesis.

    Args:
        repertoire: The repertoire.
        evaluate: The evaluation, such as ``simulated_evaluation(simulator, diagnosed, steps)``.
        sample: Number of gaits to evaluate, spread over the cells of a coarser grid of duty
            factors, the best of each first; None for all.
    """
    gaits = _spread(repertoire.descriptors, len(repertoire) if sample is None else sample)
    scores, _ = evaluate(repertoire.controllers(gaits))
    order = np.argsort(-scores, kind="stable")
    gaits, scores = gaits[order], scores[order]
    viable = gaits[scores > -np.inf]
    return Reevaluation(gaits, scores, tuple(repertoire.controllers(viable)))


def _spread(descriptors: FloatArray, count: int) -> IndexArray:
    """Returns gaits from as many cells as possible of the finest grid with at most that many.

    Args:
        descriptors: Duty factors, best gait first, ``(gaits, feet)``.
        count: Number of gaits.
    """
    gaits = len(descriptors)
    if count >= gaits:
        return np.arange(gaits)
    first = np.zeros(1, dtype=np.intp)
    for levels in range(2, gaits + 1):
        cells = np.minimum((descriptors * levels).astype(np.intp), levels - 1)
        # The first of a cell is its best, since the gaits are sorted.
        found = np.sort(np.unique(cells, axis=0, return_index=True)[1])
        if len(found) > count or levels > 100:
            break
        first = found
    rest = np.setdiff1d(np.arange(gaits), first)[: count - len(first)]
    return np.concatenate([first, rest]).astype(np.intp)
