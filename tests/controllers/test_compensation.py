"""Promises of compensating layers: zeros change no bit, and each number does what it says."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from selfmodel.controllers.compensation import FEEDBACK, OFFSET, SHIFT, TILT, TURN, Compensated
from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.controllers.cpg import Cpg
from selfmodel.controllers.network import Network
from tests.helpers.policies import INTERFACE, MOTORS, RANGES, SENSORS, commanded, constant, policy

BASES = {
    "policy": policy(),
    "history": policy("linear_velocity", "phase", "sensors", history=2, decimation=2),
    "cpg": Cpg(SENSORS, MOTORS, 0.02, ranges=RANGES),
    "plain cpg": Cpg(SENSORS, MOTORS, 0.02),
    "network": Network(SENSORS, MOTORS, ranges=RANGES),
}
EVERY_BASE = pytest.mark.parametrize("base", BASES.values(), ids=BASES)


def layer(base: Design, seed: int = 0, *, feedback: bool = True) -> Compensated:
    """The layer around a controller of that design."""
    genome = draw_genomes(np.random.default_rng(seed), (base.weights,))
    return Compensated.around(Controller(base, genome), feedback=feedback)


@EVERY_BASE
@pytest.mark.parametrize("feedback", [False, True])
def test_a_layer_of_zeros_changes_no_bit(base: Design, *, feedback: bool):
    for seed in range(10):
        own = layer(base, seed, feedback=feedback)
        bare = commanded(base, own.base.genome[np.newaxis], 40)
        assert commanded(own, np.zeros((1, own.weights)), 40).tobytes() == bare.tobytes()


@EVERY_BASE
@given(genome=st.lists(st.floats(-1, 1), min_size=24, max_size=24), seed=st.integers(0, 99))
def test_commands_stay_in_their_ranges_with_every_layer(base: Design, genome: list, seed: int):
    own = layer(base, seed)
    centre, half = np.array(own.ranges).T
    commands = commanded(own, np.array(genome)[np.newaxis, : own.weights])

    assert np.all((commands >= centre - half) & (commands <= centre + half))


LARGE = Network(tuple("abcdefgh"), tuple("ABCDEFGH"))
DESIGNS = [*BASES.values(), LARGE, *map(layer, BASES.values())]


@pytest.mark.parametrize("design", DESIGNS, ids=lambda one: one.description)
@settings(max_examples=10)
@given(rows=st.integers(1, 130), place=st.integers(0, 129))
def test_a_row_of_any_design_is_the_same_to_the_bit_in_any_batch_and_place(
    design: Design, rows: int, place: int
):
    row = slice(place % rows, place % rows + 1)
    genomes = draw_genomes(np.random.default_rng(rows), (rows, design.weights))
    alone = commanded(design, genomes[row], rows=row, count=rows)

    assert commanded(design, genomes)[:, row].tobytes() == alone.tobytes()


STILL = layer(policy("gravity", graph=constant(1.0, 0.5)))
"""Around commands that are always 0.5, 0.2 and -0.8; the neutral ones are 0.4, 0.2 and -0.9."""


def changes(numbers: dict[int, float], tilt: tuple = (1, 0, 0, 0), turn: tuple = (0, 0, 0)) -> list:
    """The changes of the commands with some numbers of ``STILL``, for a tilt and a turn."""
    genome, commands = np.zeros((1, STILL.weights)), np.empty((1, 3))
    genome[0, list(numbers)] = list(numbers.values())
    batch = STILL.batch(genome, [frozenset()])
    batch.observed["base_orientation"][:] = tilt
    batch.observed["base_angular_velocity"][:] = turn
    batch.step(commands)
    return pytest.approx((commands[0] - (0.5, 0.2, -0.8)).tolist())


def test_each_number_of_a_layer_does_what_it_says():
    nose_down, left_down = (0.5**0.5, 0, 0.5**0.5, 0), (0.5**0.5, -(0.5**0.5), 0, 0)
    offset, gain, response = 0, 3, 6
    every = {response + k: 0.4 for k in range(15)}

    assert changes({offset: 0.2, offset + 2: -1.0}) == [0.75 * OFFSET * 0.2, 0, -0.5 * OFFSET]
    assert changes({gain: 1.0, gain + 1: 1.0, gain + 2: 1.0}) == [0.1, 0, 0.1]
    assert changes({gain: -1.0}) == [-0.05, 0, 0]
    assert changes(every) == [0, 0, 0]
    assert changes(every, tilt=nose_down) == [0.75 * TILT * 0.4, TILT * 0.4, 0.5 * TILT * 0.4]
    assert changes({6: 0.4, 12: 0.4}, tilt=nose_down) == [0.75 * TILT * 0.4, 0, 0]
    assert changes({6: 0.4, 12: 0.4}, tilt=left_down) == [0, TILT * 0.4, 0]
    found = changes({8: 0.4, 14: 0.4, 20: 0.4}, turn=(1.0, 2.0, 3.0))
    assert found == [0.75 * TURN * 0.4 * 1, TURN * 0.4 * 2, 0.5 * TURN * 0.4 * 3]


def test_a_layer_shifts_the_velocity_that_its_policy_observes():
    own, numbers = layer(policy("velocity")), np.array([1.0, -0.4, 0.2])
    genomes = np.zeros((2, own.weights))
    genomes[1, 6:9] = numbers
    found = commanded(own, genomes)
    velocities = (INTERFACE.velocity, tuple(INTERFACE.velocity + SHIFT * numbers))
    for column, velocity in enumerate(velocities):
        expected = commanded(policy("velocity", velocity=velocity))
        assert found[:, [column]].tobytes() == expected.tobytes()


def test_a_layer_has_as_many_numbers_as_it_needs_and_observes_what_it_feels():
    plain, feeling = (layer(BASES["policy"], feedback=each) for each in (False, True))
    assert (plain.weights, feeling.weights) == (2 * 3 + 3, 7 * 3 + 3)
    assert [layer(BASES[key], feedback=False).weights for key in ("cpg", "history")] == [6, 6]
    assert plain.observes == ("base_orientation", "joint_positions")
    assert feeling.observes == (*plain.observes, "base_angular_velocity")
    assert plain.neutral == (0.4, 0.2, -0.9)
    network = layer(BASES["network"])
    assert (network.observes, network.hidden, network.neutral) == (FEEDBACK, 3, (0.5, 0, -1))


def test_a_layer_around_a_layer_is_refused_and_around_is_that_around_the_controller_within():
    own = layer(BASES["policy"], feedback=False)
    layered = Controller(own, np.ones(own.weights))

    assert Compensated.around(layered) == own != layer(BASES["policy"])
    assert Compensated.around(layered, feedback=True) == layer(BASES["policy"])
    with pytest.raises(ValueError, match="a layer around a layer: give the controller within"):
        Compensated(SENSORS, MOTORS, ranges=RANGES, base=layered)
    with pytest.raises(ValueError, match="sensors, motors and ranges of the controller within"):
        Compensated(SENSORS, MOTORS, base=own.base)


def test_a_layer_names_its_largest_changes():
    own = layer(BASES["policy"])
    genome = np.zeros(own.weights)
    assert own.summary(genome) == BASES["policy"].summary(np.empty(0))
    genome[[1, 4, 5]] = (-0.4, 1.0, -0.1)
    told = f"tail: gain 2.00, offset -0.20; knee: gain {2**-0.1:.2f}, offset +0.00"
    assert own.summary(genome).endswith(f": {told}")
    genome[[7, 12]] = -0.5
    assert own.summary(genome).endswith(
        f": {told}; velocity +0.00, -0.25, +0.00; responses to tilt and turning"
    )
