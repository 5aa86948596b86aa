"""Promises of the evolutionary algorithm: the paper's numbers, and it finds what it seeks."""

import dataclasses
from functools import partial

import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.evolution import Evolution, Generation, GenomeSearch, evolve
from selfmodel.recovery.cma_es import CmaEs
from selfmodel.settings import Settings

LENGTH, RNG = 12, np.random.default_rng(0)


def draw(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    return rng.random(shape)


def search(seed: int = 0, seeds: tuple = (), **changes: float) -> Evolution:
    settings = dataclasses.replace(Settings(), **changes)
    return Evolution(LENGTH, settings, np.random.default_rng(seed), seeds, draw=draw)


def evolved(seed: int = 0) -> tuple[Evolution, list[Generation]]:
    """A whole search for the largest sum, with its progress."""
    evolution, generations = search(seed), []
    total = partial(np.sum, axis=1)
    evolve(evolution, total, generations.append, evolution.generations_left)
    return evolution, generations


def test_the_defaults_are_the_papers_numbers():
    assert Settings().as_json() == {
        "steps": 1000,
        "trials": 3,
        "population": 100,
        "generations": 30,
        "survivors": 50,
        "tournament": 3,
        "mutation": 0.01,
        "crossovers": 12,
        "genes": 4,
        "kept": 10,
    }


def test_a_search_evaluates_everybody_once_and_then_only_children():
    evolution = search()
    asked = []
    while evolution.generations_left():
        asked.append(len(evolution.ask()))
        evolution.tell(evolution.ask().sum(axis=1))

    assert asked == [100] + [50] * 29
    assert evolution.evaluations == 1550


def test_fitness_rises_and_never_falls():
    evolution, generations = evolved()
    best = [generation.best for generation in generations]

    assert best == sorted(best)
    assert best[-1] > best[0] + 1
    assert evolution.best.sum() == best[-1]
    assert [generation.number for generation in generations] == list(range(1, 31))


def test_the_same_seed_finds_the_same_and_another_seed_another():
    first, again, other = (evolved(seed)[0].best.tobytes() for seed in (3, 3, 4))
    assert first == again != other


def test_seeds_start_the_worst_do_not_survive_and_of_equals_the_earlier_do():
    seed = np.full(LENGTH, 0.999)
    evolution = search(seeds=(seed,))
    asked = evolution.ask().copy()
    evolution.tell(np.zeros(100))

    assert asked[0].tobytes() == seed.tobytes()
    assert evolution.survivors[0].tobytes() == asked[:50].tobytes()
    evolution = search()
    losers = {genome.tobytes() for genome in evolution.ask()[:50]}
    evolution.tell(np.where(np.arange(100) < 50, -np.inf, np.arange(100.0)))
    assert evolution.best_fitness == 99
    assert not losers & {genome.tobytes() for genome in evolution.survivors[0]}


def test_a_value_of_a_child_is_drawn_anew_with_one_percent():
    counts = []
    for seed in range(40):
        evolution = search(seed, crossovers=0)
        parents = {genome.tobytes() for genome in evolution.ask()}
        evolution.tell(np.arange(100.0))
        counts.append(sum(child.tobytes() not in parents for child in evolution.ask()))
    expected = 50 * (1 - 0.99**LENGTH)

    assert abs(np.mean(counts) - expected) < 1


def test_twelve_pairs_of_children_cross_over_at_one_point():
    points, crossed = set(), 0
    for seed in range(20):
        evolution = search(seed, crossovers=12, mutation=0.0)
        parents = evolution.ask()  # all values differ, so each tells whose it is
        evolution.tell(np.arange(100.0))
        origin = {value: i for i, parent in enumerate(parents) for value in parent}
        children = np.vectorize(origin.get)(evolution.ask()).reshape(25, 2, LENGTH)
        for first, second in children:
            point = int(np.argmax(first != first[0]))
            assert set(first) <= {first[0], second[0]}
            if point:
                crossed += 1
                points.add(point)
                np.testing.assert_array_equal(first[point:], np.full(LENGTH - point, second[0]))
            tail = first[0] if point else second[0]
            expected = [second[0]] * (point or LENGTH) + [tail] * (LENGTH - (point or LENGTH))
            np.testing.assert_array_equal(second, expected)

    assert points == set(range(1, LENGTH))
    assert 10.5 * 20 < crossed <= 12 * 20  # a pair of twins crosses unseen


def test_a_parent_is_the_best_of_three_survivors():
    ranks = []
    for seed in range(200):
        evolution = search(seed, mutation=0.0, crossovers=0)
        rank = {genome.tobytes(): i for i, genome in enumerate(evolution.ask())}
        evolution.tell(-np.arange(100.0))
        ranks += [rank[child.tobytes()] for child in evolution.ask()]
    expected = sum(((50 - i) / 50) ** 3 for i in range(1, 50))

    assert max(ranks) < 50
    assert abs(np.mean(ranks) - expected) < 0.4  # two would give 16.2, four 9.6, three 12.0


@pytest.mark.parametrize("fitness", [np.zeros(99), np.full(100, np.nan)])
@pytest.mark.parametrize("own", [search(), CmaEs(LENGTH, Settings().scaled(50), RNG)])
def test_a_fitness_that_does_not_fit_is_refused(own: GenomeSearch, fitness: np.ndarray):
    with pytest.raises(ValueError, match="a fitness other than NaN for each of the 100 genomes"):
        own.tell(fitness)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"steps": 1}, "steps must be at least 2"),
        ({"generations": 0}, "generations must be at least 1, got 0"),
        ({"population": 50}, r"exceed the 50 survivors, got 50: .*\.scaled\(50\) to your settings"),
        ({"population": 10_001}, "population must be at most 10000, got 10001"),
        ({"genes": 101}, "genes must be at most 100, got 101"),
        ({"steps": 10**6 + 1}, "steps must be at most 1000000"),
        ({"mutation": 1.1}, "mutation is a probability"),
        ({"crossovers": 26}, "crossovers must be between 0 and the 25 pairs"),
    ],
)
def test_settings_that_do_not_fit_each_other_are_refused(change: dict, said: str):
    with pytest.raises(InputError, match=said):
        dataclasses.replace(Settings(), **change)


@pytest.mark.parametrize("population", [2, 3, 10, 100, 101, 1000])
def test_another_population_keeps_the_papers_proportions(population: int):
    scaled = Settings().scaled(population)

    assert scaled.population == population
    assert scaled.survivors == population // 2
    assert abs(scaled.crossovers - 0.12 * population) <= 1


def test_a_noisy_fitness_is_evaluated_again_so_that_luck_does_not_last():
    numbers = Settings().scaled(20)
    noisy = Evolution(LENGTH, numbers, np.random.default_rng(0), draw=draw, noisy=True)
    genomes = noisy.ask()
    noisy.tell(genomes[:, 0])
    lucky = genomes[np.argmax(genomes[:, 0])]

    assert len(noisy.ask()) == numbers.population
    np.testing.assert_array_equal(noisy.ask()[: numbers.survivors], noisy.survivors[0])
    np.testing.assert_array_equal(noisy.candidates(1), [lucky])
    noisy.tell(np.where((noisy.ask() == lucky).all(axis=1), -9.0, 0.0))
    assert not (noisy.survivors[0] == lucky).all(axis=1).any()
    assert noisy.evaluations == 2 * numbers.population
