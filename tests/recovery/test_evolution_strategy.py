"""Promises of the evolution strategy: it climbs, by ranks of opposite pairs, and goes on."""

import numpy as np
import pytest

from selfmodel.recovery.evolution_strategy import EvolutionStrategy
from selfmodel.settings import Settings

TARGET = np.array([0.5, -0.3, 0.0, 0.8])


def started(seed: int = 0, **changes: float) -> EvolutionStrategy:
    rng = np.random.default_rng(seed)
    given = {"pairs": 8, "deviation": 0.05, "rate": 0.02, "start": np.zeros(4), **changes}
    return EvolutionStrategy(4, Settings(), rng, **given)


def advance(search: EvolutionStrategy, generations: int, scale: float = 1.0) -> EvolutionStrategy:
    for _ in range(generations):
        search.tell(-scale * np.square(search.ask() - TARGET).sum(axis=1))
    return search


def test_it_climbs_to_the_maximum():
    search = advance(started(), 150)
    np.testing.assert_allclose(search.candidates(1)[0], TARGET, atol=0.05)
    assert (search.generation, search.evaluations) == (150, 150 * 16)
    assert search.candidates(5).shape == (5, 4)


def test_a_generation_has_opposite_genomes_about_the_mean():
    search = advance(started(), 3)
    first, second = np.split(search.ask(), 2)
    np.testing.assert_allclose((first + second) / 2, np.tile(search.mean, (8, 1)), atol=1e-15)
    assert search.ask() is search.ask()


def test_only_the_order_of_the_fitness_counts():
    one, other = (advance(started(), 5, scale) for scale in (1.0, 1e6))
    np.testing.assert_array_equal(one.mean, other.mean)


def test_a_diverged_genome_is_the_worst_and_genomes_stay_in_their_bounds():
    search = started(deviation=2.0, rate=1.0)
    for _ in range(4):
        asked = search.ask()
        assert np.abs(asked).max() <= 1
        search.tell(np.where(np.arange(16) % 5 == 0, -np.inf, asked.sum(axis=1)))
    assert np.isfinite(search.mean).all()
    with pytest.raises(ValueError, match="fitness"):
        search.tell(np.full(16, np.nan))


def test_without_a_start_it_begins_at_the_best_of_seeds_and_random_genomes():
    seeds = [np.ones(4), TARGET]
    search = EvolutionStrategy(4, Settings(), np.random.default_rng(0), seeds)
    assert {tuple(seed) for seed in seeds} < {tuple(genome) for genome in search.ask()}
    assert search.ask().shape == (Settings().population, 4)
    advance(search, 1)
    np.testing.assert_array_equal(search.candidates(1)[0], TARGET)
    assert np.linalg.norm(advance(search, 1).mean - TARGET) > 0


def test_it_goes_on_from_its_state_to_the_bit():
    whole, half = advance(started(), 6), advance(started(), 3)
    rng = np.random.default_rng(99)
    rng.bit_generator.state = half._rng.bit_generator.state
    given = {"pairs": 8, "deviation": 0.05, "rate": 0.02, "start": np.ones(4)}
    other = EvolutionStrategy(4, Settings(), rng, **given)
    other.resume(half.state())
    np.testing.assert_array_equal(advance(other, 3).mean, whole.mean)
    np.testing.assert_array_equal(other.ask(), whole.ask())
