"""MAP-Elites with the interface ``ask``, ``tell``, ``stop``, on the archive of pyribs."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import draw_genomes
from selfmodel.errors import InputError

if TYPE_CHECKING:
    from ribs.archives import GridArchive
    from ribs.emitters import IsoLineEmitter

ISO_SIGMA = 0.02
"""Standard deviation of the independent mutation of each weight: 0.01 of its range. Source:
Vassiliades and Mouret, *Discovering the elite hypervolume by leveraging interspecies correlation*
(GECCO 2018)."""

LINE_SIGMA = 0.2
"""Standard deviation of the step along the line to another elite, relative to their distance.
Source: the same article."""

LEVELS: Mapping[int, int] = MappingProxyType({1: 1000, 2: 100, 3: 40, 4: 20, 5: 10, 6: 5})
"""Cells along each axis, by number of feet: 5 for the hexapod, as in Cully et al. (2015), and finer
for fewer feet, so that at least 10,000 gaits find a cell."""

_MANY_FEET = 3
"""Cells along each axis for more feet than ``LEVELS`` has."""

_MAX_FEET = 10


def levels_for(feet: int) -> int:
    """Returns the number of cells along each axis of the grid of a robot.

    Args:
        feet: Number of feet.

    Raises:
        InputError: The grid would be too large.
    """
    if feet > _MAX_FEET:
        raise InputError(
            f"a repertoire has an axis per foot and at most {_MAX_FEET}, got {feet} touch sensors: "
            f"keep one touch sensor per foot in the MJCF"
        )
    return LEVELS.get(feet, _MANY_FEET)


class MapElites:
    """MAP-Elites: keeps the best genome of each cell of a grid of descriptors in [0, 1].

    All genomes are in hundredths, as random genomes are. The batches are random until a genome has
    entered the archive. Children are drawn by Iso+LineDD from pairs of elites.

    Source: J.-B. Mouret and J. Clune, *Illuminating search spaces by mapping elites* (2015).

    Args:
        length: Number of values of a genome.
        axes: Number of descriptors.
        levels: Cells along each axis.
        batch: Number of genomes that ``ask`` returns.
        budget: Number of evaluations after which the search stops.
        rng: Source of all random numbers.
        seeds: Genomes of the first batch, beside random ones.

    Attributes:
        evaluations: Number of genomes evaluated so far.

    Raises:
        InputError: pyribs is not installed.
    """

    def __init__(
        self,
        length: int,
        axes: int,
        *,
        levels: int,
        batch: int,
        budget: int,
        rng: np.random.Generator,
        seeds: Sequence[FloatArray] = (),
    ) -> None:
        self._length, self._batch, self._budget, self._rng = length, batch, budget, rng
        self._archive, self._emitter = _archive(length, axes, levels, batch, rng)
        known = np.array(list(seeds)[:batch]).reshape(-1, length)
        self._asked = np.concatenate([known, draw_genomes(rng, (batch - len(known), length))])
        self.evaluations = 0

    def ask(self) -> FloatArray:
        """Returns the genomes to evaluate, ``(batch, length)``."""
        return self._asked

    def tell(self, scores: FloatArray, descriptors: FloatArray) -> None:
        """Adds the genomes that ``ask`` returned to the archive, and generates others.

        Args:
            scores: ``(batch,)``; negative infinity for a genome that may not enter.
            descriptors: ``(batch, axes)``, each 0 to 1; any value where the score is infinite.

        Raises:
            ValueError: A shape is wrong, a score is NaN, or a descriptor that matters is outside of
                0 to 1.
        """
        n, axes = len(self._asked), self._archive.measure_dim
        if scores.shape != (n,) or descriptors.shape != (n, axes) or np.isnan(scores).any():
            raise ValueError(
                f"expected a score other than NaN and {axes} descriptors for each of the {n} "
                f"genomes asked for, got shapes {scores.shape} and {descriptors.shape}"
            )
        viable = scores > -np.inf
        if not np.all((descriptors[viable] >= 0) & (descriptors[viable] <= 1)):
            raise ValueError("expected descriptors from 0 to 1 of every genome with a finite score")
        if viable.any():
            self._archive.add(self._asked[viable], scores[viable], descriptors[viable])
        self.evaluations += n
        if self._archive.empty:
            self._asked = draw_genomes(self._rng, (self._batch, self._length))
        else:
            self._asked = np.rint(self._emitter.ask() * 100) / 100

    def stop(self) -> dict[str, int]:
        """Returns the stop reason, such as ``{"evaluations": 60000}``; empty while it runs."""
        if self.evaluations >= self._budget:
            return {"evaluations": self.evaluations}
        return {}

    @property
    def filled(self) -> int:
        """Number of filled cells."""
        return int(self._archive.stats.num_elites)

    def elites(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Returns genomes, ``(gaits, length)``, scores, ``(gaits,)``, and descriptors."""
        found = self._archive.data(["solution", "objective", "measures"], return_type="tuple")
        genomes, scores, descriptors = (np.asarray(one, dtype=np.float64) for one in found)
        return genomes, scores, descriptors


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
