"""Promises of CMA-ES: ask, tell, stop; raced starts; only the given random numbers."""

import numpy as np

from selfmodel.recovery.cma_es import MIN_POPULATION, PRUNED_AFTER, SHARE, STARTS, CmaEs
from selfmodel.settings import Settings

LENGTH = 6
GOAL = np.array([0.5, -0.5, 0.25, 0.0, 0.9, -0.9])


def fitness(genomes: np.ndarray) -> np.ndarray:
    return -np.square(genomes - GOAL).sum(axis=1)


def run(generations: int, seeds: tuple[np.ndarray, ...] = (), seed: int = 0) -> CmaEs:
    rng = np.random.default_rng(seed)
    search = CmaEs(LENGTH, Settings().scaled(40), rng, seeds)
    for _ in range(generations):
        search.tell(fitness(search.ask()))
    return search


def test_it_finds_the_maximum():
    best = run(80).candidates(5)
    assert fitness(best).max() > -1e-3
    assert np.all(np.abs(best) <= 1)


def test_after_the_race_the_better_half_of_the_starts_is_left():
    sizes = [len(run(count).ask()) for count in (1, PRUNED_AFTER, 1 + PRUNED_AFTER, 30)]
    one = round(SHARE * 40)
    assert sizes == [STARTS * one, STARTS * one, STARTS // 2 * one, STARTS // 2 * one]


def test_a_run_starts_from_a_good_seed_and_stays_near_it():
    seed = GOAL + 0.02
    search = run(1, (seed,))
    population = search.ask()[: round(SHARE * 40)]
    assert np.linalg.norm(population.mean(axis=0) - seed) < 0.4
    assert fitness(run(25, (seed,)).candidates(1)).max() > fitness(run(25).candidates(1)).max()


def test_the_same_generator_gives_the_same_genomes_and_no_other_generator_is_used():
    np.random.seed(0)  # noqa: NPY002  # the library's default generator is numpy's global one
    first = run(4).ask()
    state = np.random.get_state()[1].copy()  # noqa: NPY002  # as above
    np.random.seed(7)  # noqa: NPY002  # as above
    np.testing.assert_array_equal(run(4).ask(), first)
    np.random.seed(0)  # noqa: NPY002  # as above
    np.testing.assert_array_equal(np.random.get_state()[1], state)  # noqa: NPY002  # as above
    assert not np.array_equal(run(4, seed=1).ask(), first)


def test_diverged_simulations_are_the_worst():
    rng = np.random.default_rng(0)
    search = CmaEs(LENGTH, Settings().scaled(40), rng)
    for _ in range(60):
        genomes = search.ask()
        values = fitness(genomes)
        values[genomes[:, 0] < 0] = -np.inf
        search.tell(values)
    assert fitness(search.candidates(5)).max() > -0.01
    search.tell(np.full(len(search.ask()), -np.inf))
    assert np.isfinite(search.ask()).all()


def test_a_run_whose_simulations_all_diverge_does_not_win_the_race():
    search = CmaEs(LENGTH, Settings().scaled(40), np.random.default_rng(0))
    search.tell(fitness(search.ask()) - 9)
    size, diverging = len(search.ask()) // STARTS, search._runs[0]
    for _ in range(PRUNED_AFTER):
        values = fitness(search.ask()) - 9  # all are negative
        values[:size] = -np.inf
        search.tell(values)

    assert len(search.ask()) == STARTS // 2 * size
    assert diverging not in search._runs


def test_the_smallest_settings_still_search():
    search = CmaEs(LENGTH, Settings().scaled(2), np.random.default_rng(0))
    assert len(search.ask()) == STARTS
    search.tell(fitness(search.ask()))
    assert len(search.ask()) == STARTS * MIN_POPULATION
