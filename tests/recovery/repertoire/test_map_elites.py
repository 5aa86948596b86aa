"""MAP-Elites: what enters the archive, and what is asked for next."""

import sys

import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.recovery.repertoire.map_elites import MapElites, levels_for


def search(seed: int = 0, *, budget: int = 60, batch: int = 20, **more: object) -> MapElites:
    rng = np.random.default_rng(seed)
    return MapElites(3, 2, levels=4, batch=batch, budget=budget, rng=rng, **more)


def toy(genomes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The nearer to 0, the better; the descriptors are the first two values."""
    return -np.square(genomes).sum(axis=1), (genomes[:, :2] + 1) / 2


def run(filling: MapElites) -> MapElites:
    while not filling.stop():
        filling.tell(*toy(filling.ask()))
    return filling


def test_each_cell_keeps_its_best_genome():
    filling, known = search(), []
    while not filling.stop():
        known.append(filling.ask())
        filling.tell(*toy(known[-1]))
    every = np.concatenate(known)
    scores, descriptors = toy(every)
    best: dict[tuple[int, ...], float] = {}
    for score, one in zip(scores, descriptors, strict=True):
        cell = tuple(np.minimum((one * 4 + 1e-6).astype(int), 3))
        best[cell] = max(best.get(cell, -np.inf), score)
    genomes, kept, _ = filling.elites()

    assert filling.filled == len(genomes) == len(best)
    assert sorted(kept) == pytest.approx(sorted(best.values()))


def test_genomes_stay_in_hundredths_within_their_bounds():
    filling = run(search(budget=200))
    asked = filling.ask()

    assert np.array_equal(asked, np.rint(asked * 100) / 100)
    assert np.abs(asked).max() <= 1


def test_a_genome_without_a_score_does_not_enter():
    filling = search()
    scores, descriptors = toy(filling.ask())
    scores[3:] = -np.inf
    descriptors[3:] = np.nan
    filling.tell(scores, descriptors)

    assert 1 <= filling.filled <= 3


def test_the_search_goes_on_at_random_while_nothing_has_entered():
    filling = search()
    first = filling.ask()
    filling.tell(np.full(20, -np.inf), np.zeros((20, 2)))

    assert filling.filled == 0
    assert filling.ask().shape == first.shape
    assert not np.array_equal(filling.ask(), first)


def test_the_first_batch_has_the_seeds():
    seeds = [np.full(3, 0.25), np.full(3, -0.5)]

    assert np.array_equal(search(seeds=seeds).ask()[:2], seeds)


def test_the_search_stops_with_its_budget_as_the_reason():
    filling = search(budget=50)

    assert filling.stop() == {}
    assert run(filling).stop() == {"evaluations": 60}


def test_the_same_seed_finds_the_same_gaits():
    one, same, other = (run(search(seed)).elites()[0] for seed in (1, 1, 2))

    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)


@pytest.mark.parametrize(
    ("scores", "descriptors", "message"),
    [
        (np.zeros(3), np.zeros((20, 2)), "for each of the 20 genomes asked for, got shapes"),
        (np.full(20, np.nan), np.zeros((20, 2)), "a score other than NaN"),
        (np.zeros(20), np.full((20, 2), 1.5), "expected descriptors from 0 to 1"),
    ],
)
def test_wrong_evaluations_are_refused(scores: np.ndarray, descriptors: np.ndarray, message: str):
    with pytest.raises(ValueError, match=message):
        search().tell(scores, descriptors)


def test_without_pyribs_the_error_names_the_remedy(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "ribs.archives", None)

    with pytest.raises(InputError, match=r"pip install 'selfmodel\[repertoire\]'"):
        search()


def test_the_grid_is_finer_for_fewer_feet_and_never_too_large():
    assert [levels_for(feet) for feet in (4, 6, 8)] == [20, 5, 3]
    with pytest.raises(InputError, match="an axis per foot and at most 10, got 11 touch sensors"):
        levels_for(11)
