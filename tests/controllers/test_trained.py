"""Promises of policies that are evolved: a genome is a change of the weights, row by row."""

from dataclasses import replace

import numpy as np
import pytest

from selfmodel.controllers.graph import Graph, Node, layers
from selfmodel.controllers.policy import Policy
from selfmodel.controllers.trained import Evolved, Finetuned, Trained, initial_layers
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


def ending(hidden: int, *after: str) -> Graph:
    """A network of which half of the outputs is thrown away, with operators at its end."""
    rng = np.random.default_rng(3)
    sizes = [(hidden, SIZE - 2), (4, hidden)] if hidden else [(4, SIZE - 2)]
    graph = layers([(rng.normal(0, 9, one), rng.normal(size=one[0])) for one in sizes], "Relu")
    nodes = [*graph.nodes, Node("Split", (graph.output,), ("out0", "rest"), (("axis", 1.0),))]
    nodes += [Node(name, (f"out{k}",), (f"out{k + 1}",)) for k, name in enumerate(after)]
    value = Node("Gemm", (graph.input, "critic"), ("value",), (("transB", 1.0),))
    tensors = {**graph.tensors, "critic": np.ones((1, SIZE - 2))}
    changes = {"nodes": (*nodes, value), "tensors": tensors}
    return replace(graph, **changes, output=f"out{len(after)}", outputs=2)


def finetuned(hidden: int, *after: str) -> Finetuned:
    graph = ending(hidden, *after)
    plain = Policy(SENSORS, MOTORS, ranges=RANGES, graph=graph, interface=INTERFACE)
    features = np.random.default_rng(4).normal(size=(3, hidden or SIZE - 2))
    return Finetuned.of(plain, features)


DESIGNS = {
    "trained": trained(7),
    "trained, by BLAS": trained(450),
    "linear": trained(0),
    "finetuned": finetuned(7, "Tanh"),
    "finetuned, clipped": finetuned(7, "Relu", "Tanh"),
    "finetuned, linear": finetuned(0),
}
EVERY_DESIGN = pytest.mark.parametrize("design", DESIGNS.values(), ids=DESIGNS)


@EVERY_DESIGN
def test_each_row_has_the_commands_of_its_own_policy_to_the_bit(design: Evolved):
    genomes = np.random.default_rng(1).uniform(-1, 1, (5, design.weights))
    together = commands(design, genomes)

    assert not np.allclose(together[:, 0], together[:, 1])
    for row, genome in enumerate(genomes):
        alone = commands(design, genomes[[row]], slice(row, row + 1))
        np.testing.assert_array_equal(alone[:, 0], together[:, row])
        plain = commands(design.policy(genome), np.empty((1, 0)), slice(row, row + 1))
        np.testing.assert_array_equal(plain[:, 0], together[:, row])


@EVERY_DESIGN
def test_the_weights_of_a_row_stay_its_own_when_others_have_ended(design: Evolved):
    genomes = np.random.default_rng(1).uniform(-1, 1, (5, design.weights))
    batch = design.batch(genomes, [frozenset()] * 5)
    for k, expected in enumerate(commands(design, genomes)):
        if k == 2:
            batch.end(np.array([1, 4]))
        targets = np.empty_like(expected)
        feel(batch, k, slice(None), 5)
        batch.step(targets)
        np.testing.assert_array_equal(targets[[1, 4]], expected[[1, 4]])


@EVERY_DESIGN
def test_a_genome_of_zeros_changes_no_bit(design: Evolved):
    plain = commands(design.policy(np.zeros(design.weights)), np.empty((1, 0)), slice(1))
    own = commands(design, np.zeros((1, design.weights)), slice(1))
    np.testing.assert_array_equal(own, plain)


@pytest.mark.parametrize("hidden", [0, 7])
def test_every_weight_of_a_trained_network_is_evolved(hidden: int):
    assert trained(hidden).weights == 2 * (hidden or SIZE - 2) + 2 + hidden * (SIZE - 1)


def test_only_what_the_output_depends_on_is_fine_tuned_at_the_rank_of_the_features():
    design = finetuned(7, "Relu", "Tanh")
    genome = np.random.default_rng(1).uniform(-1, 1, (1, design.weights))
    change = design.tensors(genome)["weight1"][0] - design.graph.tensors["weight1"]

    assert design.driven == [0, 1]
    assert design.weights == 2 * 3
    assert not change[2:].any()
    expected = 0.5 * genome.reshape(2, 3) @ np.array(design.features)
    np.testing.assert_allclose(change[:2], expected, atol=1e-12)
    for wrong in (np.nan, np.inf, 1e7):
        with pytest.raises(ValueError, match="features of at most"):
            Finetuned.of(design, np.full((2, 7), wrong))


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
