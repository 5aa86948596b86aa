"""Making a repertoire, and its evaluation under a hypothesis."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.controllers.controller import Controller, Design
from selfmodel.errors import WorkError
from selfmodel.recovery.repertoire.evaluation import Evaluate, feet_of
from selfmodel.recovery.repertoire.map_elites import MapElites, levels_for
from selfmodel.recovery.repertoire.model_digest import model_digest
from selfmodel.recovery.repertoire.repertoire import Origin, Repertoire
from selfmodel.robot.robot import Robot
from selfmodel.version import __version__

BATCH = 200
"""Gaits in a batch."""

EVALUATIONS = 60_000
"""Default number of evaluations: ten minutes of the quadruped on two cores."""


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
    """Returns a repertoire of gaits, by MAP-Elites.

    Args:
        robot: The healthy robot.
        design: Design of the controllers.
        evaluate: Evaluation of gaits; see ``simulated_evaluation``.
        steps: Control steps of a rollout of ``evaluate``, for the origin of the repertoire.
        seed: Seed of all random numbers.
        evaluations: Number of gaits to evaluate.
        levels: Cells along each axis of the grid; None for ``levels_for`` of the robot's feet.
        seeds: Controllers of the first batch; controllers of another design are ignored.
        batch: Gaits in a batch.
        on_filling: Called after each batch.

    Raises:
        InputError: The robot has no touch sensors or too many, or pyribs is not installed.
        WorkError: No gait entered the repertoire.
    """
    start, feet = perf_counter(), feet_of(robot.anatomy)
    cells = levels_for(len(feet)) if levels is None else levels
    search = MapElites(
        design.weights,
        len(feet),
        levels=cells,
        batch=batch,
        budget=evaluations,
        rng=np.random.default_rng(seed),
        seeds=[one.genome for one in seeds if one.design == design],
    )
    best = -np.inf
    while not search.stop():
        scores, descriptors = evaluate([Controller(design, genome) for genome in search.ask()])
        search.tell(scores, descriptors)
        best = max(best, float(scores.max()))
        on_filling(
            Filling(search.evaluations, evaluations, search.filled, best, perf_counter() - start)
        )
    if not search.filled:
        raise WorkError(
            f"none of {search.evaluations} gaits of {robot.name} moved forward without a fall: "
            f"evaluate more of them, or give controllers to begin with"
        )
    origin = Origin(
        robot=robot.name,
        model=model_digest(robot),
        steps=steps,
        evaluations=search.evaluations,
        levels=cells,
        seed=seed,
        version=__version__,
    )
    return Repertoire(design, *search.elites(), origin)


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
