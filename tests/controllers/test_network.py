"""Promises of the controller: the paper's sizes, and arithmetic that knows no other rows."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from selfmodel.controllers.command_range import TARGET_RANGE
from selfmodel.controllers.network import Controller, Network, Population, draw_weights
from selfmodel.robot.robot import Robot

QUADRUPED = Network(tuple("abcdefgh"), tuple("ABCDEFGH"))


def test_the_networks_have_the_papers_number_of_weights(robot: Robot):
    assert robot.network.weights == {"quadruped": 68, "hexapod": 120}[robot.name]


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
    genome, readings = draw_weights(rng, (68,)), rng.uniform(-1, 1, (20, 8))
    brain = Population([Controller(QUADRUPED, genome)], np.ones((1, 3)))
    targets = np.empty((20, 1, 8))
    for reading, target in zip(readings, targets, strict=True):
        brain.readings[:] = reading
        brain.step(target)

    np.testing.assert_allclose(targets[:, 0], step_alone(genome, readings), rtol=1e-12)


@given(rows=st.integers(1, 130), place=st.integers(0, 129), seed=st.integers(0, 1000))
def test_a_robots_arithmetic_does_not_depend_on_the_rows_around_it(
    rows: int, place: int, seed: int
):
    rng = np.random.default_rng(seed)
    place %= rows
    controllers = [Controller(QUADRUPED, genome) for genome in draw_weights(rng, (rows, 68))]
    readings = rng.uniform(-1, 1, (5, rows, 8))
    together = Population(controllers, np.ones((rows, 3)))
    alone = Population([controllers[place]], np.ones((1, 3)))
    many, one = np.empty((rows, 8)), np.empty((1, 8))
    for reading in readings:
        together.readings[:] = reading
        together.step(many)
        alone.readings[:] = reading[place]
        alone.step(one)

        assert many[place].tobytes() == one[0].tobytes()


def test_a_silent_neuron_says_nothing_and_leaves_other_robots_alone():
    controllers = [Controller(QUADRUPED, draw_weights(np.random.default_rng(1), (68,)))] * 2
    neurons = np.array([[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    brain, targets = Population(controllers, neurons), np.empty((2, 8))
    brain.readings[:] = 1.0
    brain.step(targets)

    only_bias = TARGET_RANGE * np.tanh(controllers[0].genome[36:].reshape(8, 4)[:, 3])
    np.testing.assert_array_equal(targets[1], only_bias)
    assert not np.allclose(targets[0], targets[1])


def test_weights_are_drawn_from_minus_one_to_one_in_hundredths():
    weights = draw_weights(np.random.default_rng(0), (10_000,))

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


def test_controllers_with_the_same_weights_are_one():
    genome = draw_weights(np.random.default_rng(0), (68,))

    assert Controller(QUADRUPED, genome) == Controller(QUADRUPED, genome.copy())
    assert len({Controller(QUADRUPED, genome), Controller(QUADRUPED, genome.copy())}) == 1
    assert Controller(QUADRUPED, genome) != Controller(QUADRUPED, -genome)
