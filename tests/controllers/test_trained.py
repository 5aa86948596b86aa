"""Promises of policies that are evolved: a genome is a change of the weights, row by row."""

import numpy as np
import pytest

from selfmodel.controllers.graph import layers
from selfmodel.controllers.policy import Policy
from selfmodel.controllers.trained import Trained, initial_layers
from tests.helpers.policies import INTERFACE, MOTORS, RANGES, SENSORS, feel

SIZE = 12


def trained(hidden: int) -> Trained:
    first = initial_layers(SIZE - 2, hidden, 2, np.random.default_rng(0))
    graph = layers(first, "Tanh", "Tanh")
    return Trained(SENSORS, MOTORS, ranges=RANGES, graph=graph, interface=INTERFACE, span=2.0)


def commands(design: Policy, genomes: np.ndarray, rows: slice = slice(None)) -> np.ndarray:
    batch, total = design.batch(genomes, [frozenset()] * len(genomes)), 5
    found = np.empty((4, len(genomes), len(MOTORS)))
    for k, targets in enumerate(found):
        feel(batch, k, rows, total)
        batch.step(targets)
    return found


@pytest.mark.parametrize("hidden", [0, 7, 450])  # by einsum, and by BLAS
def test_each_row_has_the_commands_of_its_own_policy_to_the_bit(hidden: int):
    design = trained(hidden)
    genomes = np.random.default_rng(1).uniform(-1, 1, (5, design.weights))
    together = commands(design, genomes)

    assert design.weights == 2 * (hidden or SIZE - 2) + 2 + hidden * (SIZE - 1)
    assert not np.allclose(together[:, 0], together[:, 1])
    for row, genome in enumerate(genomes):
        alone = commands(design, genomes[[row]], slice(row, row + 1))
        np.testing.assert_array_equal(alone[:, 0], together[:, row])
        plain = commands(design.policy(genome), np.empty((1, 0)), slice(row, row + 1))
        np.testing.assert_array_equal(plain[:, 0], together[:, row])


@pytest.mark.parametrize("hidden", [0, 7])
def test_the_first_network_commands_nothing_and_a_genome_of_zeros_changes_nothing(hidden: int):
    design = trained(hidden)
    neutral = np.broadcast_to(design.neutral, (4, 1, len(MOTORS)))
    still = commands(design, np.zeros((1, design.weights)), slice(1))
    np.testing.assert_allclose(still, np.clip(neutral, *_ends(design)), atol=1e-15)
    assert design.policy(np.zeros(design.weights)).graph == design.graph


def _ends(design: Trained) -> tuple[np.ndarray, np.ndarray]:
    centre, half = np.array(design.ranges).T
    return centre - half, centre + half
