"""Promises of the search from a repertoire: its first generation is gaits, and it goes on."""

import dataclasses

import numpy as np
import pytest

from selfmodel.controllers.controller import draw_genomes
from selfmodel.recovery.repair.cma_es import STARTS
from selfmodel.recovery.repair.repertoire_search import FromRepertoire
from selfmodel.recovery.repertoire.repertoire import Repertoire
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from tests.recovery.repertoire.test_repertoire import ORIGIN

SETTINGS = Settings().scaled(40)


def repertoire(robot: Robot, gaits: int) -> Repertoire:
    design = network_for(robot)
    genomes = np.round(draw_genomes(np.random.default_rng(5), (gaits, design.weights)), 2)
    return Repertoire(design, genomes, np.arange(gaits, dtype=float), np.zeros((gaits, 4)), ORIGIN)


def test_the_first_generation_is_known_controllers_and_distinct_gaits(quadruped: Robot):
    found, known = repertoire(quadruped, 1000), np.full(68, 0.3)
    make = FromRepertoire(found)
    asked = make(68, draw_genomes, SETTINGS, np.random.default_rng(0), [known]).ask()

    assert len(asked) == 1 + round(SETTINGS.evaluations / 8 * 5)  # 200 of 1,000 steps each
    assert (asked[0] == known).all()
    gaits = {own.tobytes() for own in found.genomes}
    drawn = [own.tobytes() for own in asked[1:]]
    assert set(drawn) <= gaits
    assert len(set(drawn)) == len(drawn)


@pytest.mark.parametrize(("gaits", "asked"), [(3, STARTS), (60, 60), (200, 200)])
def test_a_small_repertoire_is_simulated_once_and_its_runs_start_from_different_gaits(
    quadruped: Robot, gaits: int, asked: int
):
    make = FromRepertoire(repertoire(quadruped, gaits))
    search = make(68, draw_genomes, SETTINGS, np.random.default_rng(0))
    first = search.ask()
    assert len(first) == asked
    assert len({own.tobytes() for own in first}) == gaits
    if gaits > STARTS:
        search.tell(first.sum(axis=1))
        starts = [group.mean(axis=0) for group in np.split(search.ask(), STARTS)]
        near = {int(np.abs(first - start).mean(axis=1).argmin()) for start in starts}
        assert len(near) == STARTS


def test_the_sample_is_random_and_its_cost_is_bounded(quadruped: Robot):
    make = FromRepertoire(repertoire(quadruped, 1000))
    short = dataclasses.replace(SETTINGS, steps=100)
    samples = [make(68, draw_genomes, short, np.random.default_rng(seed)).ask() for seed in (0, 1)]
    assert len(samples[0]) == round(SETTINGS.evaluations / 8)
    assert not np.array_equal(*samples)


def test_its_runs_stay_near_the_best_gaits(quadruped: Robot):
    found = repertoire(quadruped, 300)
    search = FromRepertoire(found)(68, draw_genomes, SETTINGS, np.random.default_rng(0))
    fitness = search.ask().sum(axis=1)
    search.tell(fitness)
    groups = np.split(search.ask(), STARTS)

    for group in groups:
        distance = np.abs(found.genomes - group.mean(axis=0)).mean(axis=1).min()
        assert distance < 0.1
