"""Promises of the paper's EA for a noisy fitness: luck does not last."""

import numpy as np
import pytest

from selfmodel.controllers.controller import draw_genomes
from selfmodel.recovery.repair.noisy_ea import NoisyEa
from selfmodel.settings import Settings

SMALL = Settings().scaled(20)


def made(seeds: tuple[np.ndarray, ...] = ()) -> NoisyEa:
    return NoisyEa(6, draw_genomes, SMALL, np.random.default_rng(0), seeds)


def test_survivors_are_evaluated_again_beside_their_children():
    search = made()
    genomes = search.ask()
    search.tell(genomes[:, 0])
    survivors = genomes[np.argsort(-genomes[:, 0], kind="stable")][: SMALL.survivors]

    assert len(search.ask()) == SMALL.population
    np.testing.assert_array_equal(search.ask()[: SMALL.survivors], survivors)
    lucky = survivors[0]
    search.tell(np.where((search.ask() == lucky).all(axis=1), -9.0, 0.0))
    assert not (search.candidates(SMALL.survivors) == lucky).all(axis=1).any()


def test_it_improves_and_starts_from_the_seeds():
    search = made((np.full(6, 0.9),))
    assert (search.ask()[0] == 0.9).all()
    for _ in range(40):
        search.tell(-np.abs(search.ask() - 0.5).sum(axis=1))
    assert (
        np.abs(search.candidates(1) - 0.5).sum()
        < np.abs(draw_genomes(np.random.default_rng(1), (20, 6)) - 0.5).sum(axis=1).min()
    )
    assert search.evaluations == 40 * SMALL.population


@pytest.mark.parametrize("fitness", [np.zeros(3), np.full(20, np.nan)])
def test_a_fitness_of_another_shape_or_a_nan_is_refused(fitness: np.ndarray):
    with pytest.raises(ValueError, match="expected a fitness other than NaN"):
        made().tell(fitness)
