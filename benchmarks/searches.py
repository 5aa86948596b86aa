"""``python -m benchmarks.searches``: searches for gaits, compared at equal simulated steps.

A search evolves the first gait of a robot as the robust repair does, under the uncertainty that it
assumes, with the random numbers of ``recover``. At some shares of the control steps of a robust
repair its candidates are judged as a user would meet them: the best of four by eight conditions,
and of it the mean score under sixteen others. A row for each robot, search and seed is appended to
ROWS, and those that are there are skipped. Searches of Nevergrad need ``pip install --group
searches``, a repertoire needs pyribs.
"""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

import selfmodel
from benchmarks.rows import add_rows, add_search, lines_of, markdown, parsed, settings_of, spread
from selfmodel import Controller, Settings
from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Design, draw_genomes
from selfmodel.evolution import Generation, first_generation
from selfmodel.faults.hypothesis import INTACT
from selfmodel.plugins import REPERTOIRE, SEARCHES
from selfmodel.recovery import make_repertoire, simulated_evaluation
from selfmodel.recovery.candidates import RobustFitness, robust
from selfmodel.recovery.recover import random_stream
from selfmodel.recovery.repair import MakeSearch, from_repertoire, rollouts_of, run_search
from selfmodel.recovery.scores import UPRIGHT
from selfmodel.recovery.uncertainty import assumed_uncertainty
from selfmodel.robot.designs import network_for
from selfmodel.simulation.simulator import Simulator
from selfmodel.studies.study import Row

ROBOTS = ("quadruped", "hexapod", "suite-walker-walk", "benchmarks/foreign/go2.xml")

SHARES = (0.125, 0.25, 0.5, 0.75, 1.0)
"""Shares of the steps of a robust repair at which candidates are judged."""

CANDIDATES, CHOOSING, JUDGING = 4, 8, 16
"""Candidates, conditions by which the best is chosen, and conditions of its score."""


class Nevergrad:
    """A search of the library Nevergrad, a ``GenomeSearch``, told the best random genomes."""

    def __init__(
        self,
        length: int,
        settings: Settings,
        rng: np.random.Generator,
        seeds: Sequence[FloatArray] = (),
        *,
        name: str,
    ) -> None:
        import nevergrad  # noqa: PLC0415  # in a group of its own

        space = nevergrad.p.Array(shape=(length,)).set_bounds(-1, 1)
        space.random_state = np.random.RandomState(rng.integers(2**31))
        self._size, budget = settings.population, rollouts_of(settings, known=False)
        make = nevergrad.optimizers.registry[name]
        self._search = make(space, budget=budget, num_workers=self._size)
        self._asked = first_generation(2 * self._size, length, draw_genomes, rng, seeds)
        self._given: list[Any] = []
        self.evaluations = 0

    def ask(self) -> FloatArray:
        """Returns random genomes at first, then those that the library asks for."""
        return self._asked

    def tell(self, fitness: FloatArray) -> None:
        """Sets the fitness of the genomes that ``ask`` returned."""
        losses = -np.nan_to_num(fitness, neginf=-1e3)
        if self._given:
            for given, loss in zip(self._given, losses, strict=True):
                self._search.tell(given, float(loss))
        else:
            for genome in self._asked[np.argsort(losses)[:CANDIDATES]]:
                self._search.suggest(genome)
        self._given = [self._search.ask() for _ in range(self._size)]
        self._asked = np.array([each.value for each in self._given])
        self.evaluations += len(fitness)

    def candidates(self, count: int) -> FloatArray:
        """Returns what the library recommends."""
        return np.array([self._search.provide_recommendation().value])[:count]


LIBRARY = ("TwoPointsDE", "PSO", "TBPSA")
"""Searches of Nevergrad: differential evolution, particle swarm, and one for noisy fitness."""

MAKERS: Mapping[str, MakeSearch] = {
    **SEARCHES,
    **{f"nevergrad {name}": partial(Nevergrad, name=name) for name in LIBRARY},
}
"""Searches. Besides, ``repertoire`` spends half of the steps on one, and then begins from it."""


@dataclass(frozen=True, eq=False)
class CountingFitness(RobustFitness):
    """Scores of controllers that counts the control steps asked for, in ``steps[0]``."""

    steps: list[int] = field(default_factory=lambda: [0])

    def __call__(
        self, controllers: Sequence[Controller], count: int, steps: int, rng: np.random.Generator
    ) -> FloatArray:
        """Returns scores, ``(controllers, count)``."""
        self.steps[0] += len(controllers) * count * steps
        return super().__call__(controllers, count, steps, rng)


def searched(settings: Settings, key: Row, _work: Path) -> Row:
    """Runs a search; returns the judged scores at the shares of its steps."""
    robot = selfmodel.load_robot(key["robot"])
    simulator, design = Simulator(robot, threads=1), network_for(robot)
    rng, judge = random_stream(key["seed"], "repair"), np.random.default_rng([key["seed"], 1])
    drawn, steps = assumed_uncertainty(robot), settings.steps
    fitness = CountingFitness(simulator, UPRIGHT, (INTACT,), drawn)
    judged = RobustFitness(Simulator(robot, threads=1), UPRIGHT, (INTACT,), drawn)
    rollouts = left = rollouts_of(settings, known=False)
    make = MAKERS.get(key["search"])
    if key["search"] == REPERTOIRE:
        left //= 2
        make = begun_from_repertoire(simulator, settings, rollouts - left, key["seed"])
    if make is None:
        raise SystemExit(f"unknown search {key['search']!r}")
    fitness.steps[0] = (rollouts - left) * steps
    search = make(design.weights, settings, rng, ())
    scores: dict[float, float] = {}

    def on_generation(_generation: Generation) -> None:
        reached = [one for one in SHARES if fitness.steps[0] >= one * rollouts * steps]
        if reached and reached[-1] not in scores:
            genomes = search.candidates(CANDIDATES)
            scores[reached[-1]] = value_of(genomes, judged, design, steps, judge)

    run_search(
        *(search, fitness, design),
        rollouts=left,
        steps=steps,
        rng=rng,
        on_generation=on_generation,
    )
    return {"scores": [scores.get(share) for share in SHARES]}


def begun_from_repertoire(
    simulator: Simulator, settings: Settings, evaluations: int, seed: int
) -> MakeSearch:
    """Returns CMA-ES from a repertoire that is made by some evaluations."""
    robot = simulator.robot
    evaluate = simulated_evaluation(simulator, INTACT, settings.steps)
    made = make_repertoire(
        *(robot, network_for(robot), evaluate),
        steps=settings.steps,
        seed=seed,
        evaluations=evaluations,
    )
    return from_repertoire(made)


def value_of(
    genomes: FloatArray,
    judged: RobustFitness,
    design: Design,
    steps: int,
    rng: np.random.Generator,
) -> float:
    """Returns the mean score of the best of some genomes, by conditions that did not choose it."""
    candidates = [Controller(design, genome) for genome in genomes]
    best = candidates[int(np.argmax(robust(judged(candidates, CHOOSING, steps, rng))))]
    return round(float(judged([best], JUDGING, steps, rng).mean()), 3)


def keys(given: argparse.Namespace) -> Iterator[Row]:
    """Yields what names each row."""
    size = {"population": given.population, "generations": given.generations}
    for seed, robot, search in product(given.seeds, given.robots, given.searches):
        yield {"robot": robot, "search": search, "seed": seed, **size}


def table(rows: Sequence[Row]) -> str:
    """Returns the median score over the seeds at each share of the steps, as Markdown."""

    def columns(own: Sequence[Row]) -> Mapping[str, str]:
        shares = zip(SHARES, zip(*(row["scores"] for row in own), strict=True), strict=True)
        known = {share: [one for one in values if one is not None] for share, values in shares}
        return {
            "n": str(len(own)),
            **{
                f"{share:.3g} of the steps": spread(values, ".1f")
                for share, values in known.items()
            },
        }

    headings = {name: name for name in ("robot", "generations", "search")}
    return markdown(lines_of(rows, headings, columns), 3)


def main() -> None:
    """Runs searches, or prints the table of their rows."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.searches", description=__doc__)
    commands = parser.add_subparsers(required=True, dest="command")
    run = commands.add_parser("run")
    run.add_argument("--robots", nargs="+", default=list(ROBOTS))
    run.add_argument("--searches", nargs="+", default=[*MAKERS, REPERTOIRE])
    run.add_argument("--seeds", type=int, nargs="+", default=[0])
    add_search(run)
    given = parsed(parser, commands, table)
    settings = settings_of(given, Settings.steps)
    add_rows(given.rows, keys(given), given.limit, partial(searched, settings))


if __name__ == "__main__":
    main()
