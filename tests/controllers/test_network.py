"""Tests of networks: the paper's sizes and formula, and rows that are independent of each other."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from selfmodel.controllers.controller import (
    TARGET_RANGE,
    Controller,
    check_silent_neurons,
    draw_genomes,
    make_batch,
)
from selfmodel.controllers.network import Network
from selfmodel.errors import InputError
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot

QUADRUPED = Network(tuple("abcdefgh"), tuple("ABCDEFGH"))


def test_the_networks_have_the_papers_number_of_weights(robot: Robot):
    assert network_for(robot).weights == {"quadruped": 68, "hexapod": 120}[robot.name]


def step_alone(genome: np.ndarray, readings: np.ndarray) -> np.ndarray:
    """The paper's network in plain arithmetic: ``(steps, sensors)`` to ``(steps, motors)``."""
    from_input = genome[:27].reshape(3, 9)
    from_hidden = genome[27:36].reshape(3, 3)
    to_motor = genome[36:].reshape(8, 4)
    hidden, targets = np.zeros(3), []
    for reading in readings:
        hidden = np.tanh(from_input @ np.append(reading, 1.0) + from_hidden @ hidden)
        targets.append(np.pi / 4 * np.tanh(to_motor @ np.append(hidden, 1.0)))
    return np.array(targets)


def test_a_step_is_the_papers_network():
    rng = np.random.default_rng(0)
    genome, readings = draw_genomes(rng, (68,)), rng.uniform(-1, 1, (20, 8))
    brain = QUADRUPED.batch(genome[np.newaxis], [frozenset()])
    targets = np.empty((20, 1, 8))
    for reading, target in zip(readings, targets, strict=True):
        brain.readings[:] = reading
        brain.step(target)

    np.testing.assert_allclose(targets[:, 0], step_alone(genome, readings), rtol=1e-12)


@given(rows=st.integers(1, 130), place=st.integers(0, 129), seed=st.integers(0, 1000))
def test_a_row_is_the_same_to_the_bit_in_any_batch_and_place(rows: int, place: int, seed: int):
    rng = np.random.default_rng(seed)
    place %= rows
    genomes = draw_genomes(rng, (rows, 68))
    readings = rng.uniform(-1, 1, (5, rows, 8))
    together = QUADRUPED.batch(genomes, [frozenset()] * rows)
    alone = QUADRUPED.batch(genomes[place : place + 1], [frozenset()])
    many, one = np.empty((rows, 8)), np.empty((1, 8))
    for reading in readings:
        together.readings[:] = reading
        together.step(many)
        alone.readings[:] = reading[place]
        alone.step(one)

        assert many[place].tobytes() == one[0].tobytes()


def test_a_silent_neuron_has_no_output_and_other_rows_are_unchanged():
    genomes = draw_genomes(np.random.default_rng(1), (1, 68)).repeat(2, axis=0)
    brain, targets = QUADRUPED.batch(genomes, [set(), {0, 1, 2}]), np.empty((2, 8))
    brain.readings[:] = 1.0
    brain.step(targets)

    only_bias = TARGET_RANGE * np.tanh(genomes[0, 36:].reshape(8, 4)[:, 3])
    np.testing.assert_array_equal(targets[1], only_bias)
    assert not np.allclose(targets[0], targets[1])


def test_weights_are_drawn_from_minus_one_to_one_in_hundredths():
    weights = draw_genomes(np.random.default_rng(0), (10_000,))

    assert (weights.min(), weights.max()) == (-1, 1)
    np.testing.assert_array_equal(weights, np.round(weights, 2))


@pytest.mark.parametrize(
    ("genome", "said"),
    [
        (np.zeros(67), "has 68 weights, got a genome of shape"),
        (np.full(68, 1.01), r"must lie in \[-1, 1\]"),
        (np.full(68, np.nan), r"must lie in \[-1, 1\]"),
    ],
)
def test_a_genome_that_does_not_fit_is_refused(genome: np.ndarray, said: str):
    with pytest.raises(ValueError, match=said):
        Controller(QUADRUPED, genome)


def test_controllers_are_equal_when_their_genome_and_design_are():
    genome = draw_genomes(np.random.default_rng(0), (68,))

    assert Controller(QUADRUPED, genome) == Controller(QUADRUPED, genome.copy())
    assert len({Controller(QUADRUPED, genome), Controller(QUADRUPED, genome.copy())}) == 1
    assert Controller(QUADRUPED, genome) != Controller(QUADRUPED, -genome)


def test_a_network_has_any_number_of_hidden_neurons_and_each_can_be_silent(robot: Robot):
    large = network_for(robot, 7)
    sensors, motors = len(robot.anatomy.sensors), len(robot.anatomy.motors)
    controller = Controller(large, np.full(large.weights, 0.5))
    working, silent = (make_batch([controller], [one], sensors) for one in (set(), {6}))
    commands = np.empty((2, 1, motors))
    for batch, command in zip((working, silent), commands, strict=True):
        batch.step(command)

    assert large.weights == 7 * (sensors + 1) + 7 * 7 + motors * 8
    assert np.all(commands[0] != commands[1])


def test_a_silent_neuron_that_the_network_lacks_is_refused(robot: Robot):
    network = network_for(robot)
    controller = Controller(network, np.zeros(network.weights))
    check_silent_neurons(network, {0, 1, 2})
    with pytest.raises(InputError, match=r"neuron:6 does not apply to a network .* are 0 to 2"):
        check_silent_neurons(network, {6})
    with pytest.raises(InputError, match=r"neuron:3 does not apply .* leave neuron:3 out"):
        make_batch([controller] * 2, [{0}, {3}], len(network.sensors))


@pytest.mark.parametrize("hidden", [0, -1, 101])
def test_too_many_or_no_hidden_neurons_are_refused(quadruped: Robot, hidden: int):
    with pytest.raises(InputError, match=f"a network has 1 to 100 hidden neurons, got {hidden}"):
        network_for(quadruped, hidden)
