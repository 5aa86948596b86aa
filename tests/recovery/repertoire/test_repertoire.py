"""The record of a repertoire."""

import dataclasses

import numpy as np
import pytest

from selfmodel.recovery.repertoire.model_digest import model_digest
from selfmodel.recovery.repertoire.repertoire import Origin, Repertoire
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot

ORIGIN = Origin("quadruped", "0" * 64, 10, 2, 20, 0, "0.1")


def test_the_gaits_are_sorted_by_score(quadruped: Robot):
    genomes = np.zeros((2, 68))
    genomes[1] = 0.5
    found = Repertoire(network_for(quadruped), genomes, np.array([1.0, 3]), np.eye(2, 4), ORIGIN)

    assert found.scores.tolist() == [3, 1]
    assert found.controller(0).genome[0] == 0.5
    assert found.descriptors[0].tolist() == [0, 1, 0, 0]


@pytest.mark.parametrize(("gaits", "weights"), [(0, 68), (2, 67)])
def test_arrays_that_do_not_fit_are_refused(quadruped: Robot, gaits: int, weights: int):
    arrays = np.zeros((gaits, weights)), np.zeros(gaits), np.zeros((gaits, 4))
    with pytest.raises(ValueError, match=r"expected genomes \(gaits, 68\)"):
        Repertoire(network_for(quadruped), *arrays, ORIGIN)


def test_the_digest_changes_with_the_model(quadruped: Robot):
    other = dataclasses.replace(quadruped, mjcf=quadruped.mjcf.replace("0.4", "0.41", 1))

    assert model_digest(quadruped) != model_digest(other)
    assert model_digest(quadruped) == model_digest(dataclasses.replace(quadruped))
