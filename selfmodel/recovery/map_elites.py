"""Search for a repertoire: MAP-Elites on the archive of pyribs.

Source: J.-B. Mouret and J. Clune, *Illuminating search spaces by mapping elites* (2015).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.errors import InputError, WorkError, typed, whole_number
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.falls import falls_of
from selfmodel.recovery.repertoire import Origin, Repertoire, model_digest
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.signals import Signal
from selfmodel.trials.trajectory import forward_displacement
from selfmodel.version import __version__

if TYPE_CHECKING:
    from ribs.archives import GridArchive
    from ribs.emitters import IsoLineEmitter

BATCH = 200
"""Gaits in a batch: more take memory and no less time."""

EVALUATIONS = 60_000
"""Default number of evaluations: ten minutes of the quadruped on two cores."""

ISO_SIGMA, LINE_SIGMA = 0.02, 0.2
"""Standard deviations of a mutation: of each weight, 0.01 of its range, and of the step along the
line to another elite, relative to their distance. Source: Vassiliades and Mouret, *Discovering the
elite hypervolume by leveraging interspecies correlation* (GECCO 2018)."""

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
    """Progress of a search: gaits evaluated, of all of them, filled cells, best score, seconds."""

    evaluations: int
    total: int
    gaits: int
    best: float
    seconds: float


@typed
def make_repertoire(
    robot: Robot,
    design: Design,
    evaluate: Evaluate,
    *,
    steps: int,
    seed: int,
    evaluations: int = EVALUATIONS,
    levels: int | None = None,
    batch: int = BATCH,
    on_filling: Callable[[Filling], None] = lambda _filling: None,
) -> Repertoire:
    """Returns a repertoire of gaits: the best genome of each cell of a grid of duty factors.

    All genomes are in hundredths, as random genomes are. The batches are random until a genome has
    entered the archive. Children are drawn by Iso+LineDD from pairs of elites. The gaits are those
    of the healthy robot, evaluated as by ``simulated_evaluation`` in rollouts of some steps. The
    levels are cells along each axis of the grid; None for ``LEVELS`` of the robot's feet.

    Raises:
        InputError: The robot has no touch sensors or too many, pyribs is not installed, or an
            argument is invalid.
        WorkError: No gait entered the repertoire.
    """
    seed = whole_number("seed", seed, 0, least=0)
    steps = whole_number("steps", steps, 1000, least=1)
    evaluations = whole_number("evaluations", evaluations, EVALUATIONS, least=1)
    batch = whole_number("batch", batch, BATCH, least=1)
    levels = None if levels is None else whole_number("levels", levels, 5, least=1)
    start, feet = perf_counter(), len(feet_of(robot.anatomy))
    cells, rng = levels or LEVELS[feet], np.random.default_rng(seed)
    archive, emitter = _archive(design.weights, feet, cells, batch, rng)
    genomes = draw_genomes(rng, (batch, design.weights))
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
            f"none of {done} gaits of {robot.name} moved forward without a fall: evaluate more"
        )
    elites = archive.data(["solution", "objective", "measures"], return_type="tuple")
    origin = Origin(robot.name, model_digest(robot), steps, done, cells, seed, __version__)
    genomes, scores, duty = (np.asarray(one, dtype=np.float64) for one in elites)
    return Repertoire(design, genomes, scores, duty, origin)


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


def feet_of(anatomy: Anatomy) -> list[int]:
    """Returns the columns of the touch sensors, one per foot.

    Raises:
        InputError: The robot has no touch sensors, or more than the grid can have axes.
    """
    feet = [k for k, sensor in enumerate(anatomy.sensors) if sensor.kind == "touch"]
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


@typed
def simulated_evaluation(simulator: Simulator, hypothesis: Hypothesis, steps: int) -> Evaluate:
    """Returns the evaluation of gaits by their forward displacement in simulation, m.

    The score is negative infinity for a gait that falls, diverges, or does not move forward. The
    duty factor of a foot is the fraction of the steps with ground contact. Source: A. Cully,
    J. Clune, D. Tarapore and J.-B. Mouret, *Robots that can adapt like animals* (Nature 521:503,
    2015), Methods: the behavioural descriptor of the hexapod.

    Raises:
        InputError: The robot has no touch sensors.
    """
    robot, feet = simulator.robot, feet_of(simulator.robot.anatomy)

    def evaluate(controllers: Sequence[Controller]) -> tuple[FloatArray, FloatArray]:
        scores, duty = [], []
        for start in range(0, len(controllers), BATCH):
            runs = [(hypothesis, one) for one in controllers[start : start + BATCH]]
            outcome = simulator.run(runs, steps, RECORD)
            moved = np.array(forward_displacement(outcome.trajectory))
            fell = falls_of(robot, hypothesis, outcome.trajectory) < steps
            moved[outcome.diverged | fell | ~(moved > 0)] = -np.inf
            scores.append(moved)
            duty.append(outcome.trajectory["sensors"][..., feet].mean(axis=-2))
        return np.concatenate(scores), np.concatenate(duty)

    return evaluate


@typed
def reevaluate(repertoire: Repertoire, evaluate: Evaluate) -> tuple[Controller, ...]:
    """Returns the gaits with a finite score in another evaluation, best first.

    No physical trial is needed for the gaits of a damaged robot: they are evaluated in simulation
    under the diagnosed hypothesis, by ``simulated_evaluation(simulator, diagnosed, steps)``.
    """
    gaits = [repertoire.controller(k) for k in range(len(repertoire))]
    scores, _ = evaluate(gaits)
    best_first = np.argsort(-scores, kind="stable")
    return tuple(gaits[i] for i in best_first if scores[i] > -np.inf)
