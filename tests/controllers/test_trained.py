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


def split(hidden: int, *, transposed: bool) -> Graph:
    """A network of which half of the outputs is thrown away, as of a normal distribution."""
    rng = np.random.default_rng(3)
    sizes = [(hidden, SIZE - 2), (4, hidden)] if hidden else [(4, SIZE - 2)]
    graph = layers([(rng.normal(size=one), rng.normal(size=one[0])) for one in sizes], "Elu")
    nodes = (*graph.nodes, Node("Split", (graph.output,), ("mean", "rest"), (("axis", 1.0),)))
    nodes += (Node("Tanh", ("mean",), ("out",)),)
    last = f"weight{len(sizes) - 1}"
    if not transposed:
        turned = graph.tensors[last].T.copy()
        graph = replace(graph, tensors={**graph.tensors, last: turned}, nodes=_plain(nodes, last))
        return replace(graph, output="out", outputs=2)
    return replace(graph, nodes=nodes, output="out", outputs=2)


def _plain(nodes: tuple[Node, ...], weight: str) -> tuple[Node, ...]:
    return tuple(replace(one, attributes=()) if weight in one.inputs else one for one in nodes)


def finetuned(hidden: int, *, transposed: bool = True) -> Finetuned:
    graph = split(hidden, transposed=transposed)
    plain = Policy(SENSORS, MOTORS, ranges=RANGES, graph=graph, interface=INTERFACE)
    features = np.random.default_rng(4).normal(size=(3, hidden or SIZE - 2))
    return Finetuned.of(plain, features)


DESIGNS = {
    "trained": trained(7),
    "trained, by BLAS": trained(450),
    "linear": trained(0),
    "finetuned": finetuned(7),
    "finetuned, turned": finetuned(7, transposed=False),
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
def test_a_genome_of_zeros_changes_no_bit(design: Evolved):
    plain = commands(design.policy(np.zeros(design.weights)), np.empty((1, 0)), slice(1))
    own = commands(design, np.zeros((1, design.weights)), slice(1))
    np.testing.assert_array_equal(own, plain)


@pytest.mark.parametrize("hidden", [0, 7])
def test_every_weight_of_a_trained_network_is_evolved(hidden: int):
    assert trained(hidden).weights == 2 * (hidden or SIZE - 2) + 2 + hidden * (SIZE - 1)


def test_only_what_the_output_depends_on_is_fine_tuned_at_the_rank_of_the_features():
    design = finetuned(7)
    genome = np.random.default_rng(1).uniform(-1, 1, (1, design.weights))
    change = design.tensors(genome)["weight1"][0] - design.graph.tensors["weight1"]

    assert design.driven == (0, 1)
    assert design.weights == 2 * 3
    assert not change[2:].any()
    expected = 0.5 * genome.reshape(2, 3) @ np.array(design.features)
    np.testing.assert_allclose(change[:2], expected, atol=1e-12)


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
