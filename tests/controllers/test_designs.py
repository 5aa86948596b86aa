"""Promises of networks and CPGs: the documented formula, and rows that are independent."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from selfmodel.controllers.controller import (
    TARGET_RANGE,
    Controller,
    Design,
    check_silent_neurons,
    draw_genomes,
    make_batch,
)
from selfmodel.controllers.cpg import MAX_FEEDBACK, MAX_FREQUENCY, MIN_FREQUENCY, Cpg
from selfmodel.controllers.network import Network
from selfmodel.controllers.playback import Playback
from selfmodel.errors import InputError
from selfmodel.faults.notation import parse
from selfmodel.robot.designs import cpg_for, network_for
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.signals import SIGNALS
from tests.helpers.drivers import random_controllers, random_cpgs

RANGES = ((0.5, 0.25), (0.0, 1.0), (-2.0, 1.0))
CPG = Cpg(("touch", "angle"), ("hip", "knee", "ankle"), 0.01, ranges=RANGES)
NETWORK = Network(tuple("abcdefgh"), tuple("ABCDEFGH"))
DESIGNS = pytest.mark.parametrize("design", [CPG, NETWORK], ids=lambda own: own.name)


def genomes(design: Design, count: int = 1, seed: int = 0) -> np.ndarray:
    return draw_genomes(np.random.default_rng(seed), (count, design.weights))


def commanded(design: Design, genomes: np.ndarray, readings: np.ndarray) -> np.ndarray:
    """The commands, ``(steps, n, motors)``, for readings, ``(steps, n, sensors)``."""
    batch = design.batch(genomes, [frozenset()] * len(genomes))
    commands = np.empty((len(readings), len(genomes), len(design.motors)))
    for reading, command in zip(readings, commands, strict=True):
        batch.readings[:] = reading
        batch.step(command)
    return commands


def alone(genome: np.ndarray, readings: np.ndarray) -> np.ndarray:
    """The commands of one CPG, ``(steps, motors)``, for readings, ``(steps, sensors)``."""
    return commanded(CPG, genome[np.newaxis], readings[:, np.newaxis])[:, 0]


def test_genomes_have_the_papers_and_the_documented_length(robot: Robot):
    lengths = {"quadruped": (68, 33), "hexapod": (120, 67)}
    assert (network_for(robot).weights, cpg_for(robot).weights) == lengths[robot.name]


def test_a_step_of_a_network_is_the_papers():
    genome, readings = genomes(NETWORK)[0], np.random.default_rng(0).uniform(-1, 1, (20, 8))
    from_input, from_hidden = genome[:27].reshape(3, 9), genome[27:36].reshape(3, 3)
    to_motor, hidden, expected = genome[36:].reshape(8, 4), np.zeros(3), []
    for reading in readings:
        hidden = np.tanh(from_input @ np.append(reading, 1.0) + from_hidden @ hidden)
        expected.append(np.pi / 4 * np.tanh(to_motor @ np.append(hidden, 1.0)))

    found = commanded(NETWORK, genome[np.newaxis], readings[:, np.newaxis])[:, 0]
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_a_step_of_a_cpg_is_the_formula_of_the_docs():
    genome = genomes(CPG)[0]
    one = CPG.decode(genome)
    readings = np.random.default_rng(1).uniform(-1, 1, (300, 2))
    clock, expected = 0.0, []
    for step, reading in enumerate(readings):
        t = 0.01 * step
        swing = one.amplitudes * np.cos(2 * np.pi * (clock + one.phases)) + one.offsets
        envelope = 1 - (1 + 10 * t) * math.exp(-10 * t)
        expected.append([0.5, 0.0, -2.0] + np.array([0.25, 1.0, 1.0]) * envelope * swing)
        clock += 0.01 * one.frequency * (1 + one.feedback @ reading)

    np.testing.assert_allclose(alone(genome, readings), expected, atol=1e-12)


@settings(max_examples=20)
@given(seed=st.integers(0, 10_000), reading=st.floats(-1, 1))
def test_every_cpg_keeps_commands_in_range_and_the_phase_advancing(seed: int, reading: float):
    genome = genomes(CPG, seed=seed)[0]
    one, (centre, half) = CPG.decode(genome), np.array(RANGES).T
    commands = alone(genome, np.full((50, 2), reading))

    assert np.all(np.abs(commands - centre) <= half * (1 + 1e-12))
    assert np.all(np.abs(one.offsets) + one.amplitudes <= 1 + 1e-12)
    assert MIN_FREQUENCY * (1 - 1e-12) <= one.frequency <= MAX_FREQUENCY * (1 + 1e-12)
    assert np.abs(one.feedback).sum() <= MAX_FEEDBACK + 1e-12


def test_commands_of_a_cpg_start_at_the_centre_and_reach_their_amplitude_smoothly():
    genome = np.concatenate([np.ones(1 + 3), np.zeros(CPG.weights - 4)])
    commands = alone(genome, np.zeros((300, 2)))

    assert np.array_equal(commands[0], [0.5, 0.0, -2.0])
    assert np.abs(commands[1] - commands[0]).max() < 0.01
    assert np.ptp(commands[100:], axis=0) == pytest.approx([0.5, 2.0, 2.0], rel=0.02)


def test_a_reading_changes_the_commands_of_a_cpg_only_with_feedback():
    genome = genomes(CPG, seed=5)[0].copy()
    genome[-2:] = [1.0, 0.0]
    quiet, touched, unheard = (
        alone(genome, np.tile(reading, (200, 1))) for reading in ([0, 0], [1.0, 0], [0, 1.0])
    )

    assert np.abs(touched - quiet).max() > 0.05
    assert np.array_equal(unheard, quiet)


def test_a_robot_with_a_cpg_moves_the_same_to_the_bit_in_any_batch_on_any_threads(robot: Robot):
    texts = ["intact", f"break:{robot.anatomy.joints[0].name}"]
    texts += [f"sensor:{robot.anatomy.sensors[0].name}", "intact"]
    hypotheses = [parse(text, robot.anatomy) for text in texts]
    runs = list(zip(hypotheses, random_cpgs(robot, 4), strict=True))
    together = Simulator(robot, 2).run(runs, 60, SIGNALS).trajectory
    backwards = Simulator(robot, 1).run(runs[::-1], 60, SIGNALS).trajectory
    single = Simulator(robot, 1).run(runs[2:3], 60, SIGNALS).trajectory
    for signal in SIGNALS:
        assert together[signal].tobytes() == backwards[signal][::-1].tobytes()
        assert together[signal][2].tobytes() == single[signal].tobytes()


def test_a_failed_sensor_changes_the_motion_only_with_feedback(quadruped: Robot):
    cpg = cpg_for(quadruped)
    one, unheard = (
        Controller(cpg, np.concatenate([np.full(25, 0.5), np.full(8, feedback)]))
        for feedback in (1.0, 0.0)
    )
    dead, intact = (
        parse(text, quadruped.anatomy) for text in ("sensor:front_left_touch", "intact")
    )
    runs = [(intact, one), (dead, one), (intact, unheard), (dead, unheard)]
    moved = (
        Simulator(quadruped, 1).run(runs, 150, ["joint_positions"]).trajectory["joint_positions"]
    )

    assert np.abs(moved[0] - moved[1]).max() > 0.01
    assert np.array_equal(moved[2], moved[3])


def test_a_silent_neuron_has_no_output_and_other_rows_are_unchanged():
    drawn = genomes(NETWORK, 1, 1).repeat(2, axis=0)
    batch, commands = NETWORK.batch(drawn, [set(), {0, 1, 2}]), np.empty((2, 8))
    batch.readings[:] = 1.0
    batch.step(commands)

    only_bias = TARGET_RANGE * np.tanh(drawn[0, 36:].reshape(8, 4)[:, 3])
    np.testing.assert_array_equal(commands[1], only_bias)
    expected = commanded(NETWORK, drawn[:1], np.ones((1, 1, 8)))
    np.testing.assert_array_equal(commands[:1], expected[0])


def test_a_network_has_any_number_of_hidden_neurons(robot: Robot):
    sensors, motors = len(robot.anatomy.sensors), len(robot.anatomy.motors)
    assert network_for(robot, 7).weights == 7 * (sensors + 1) + 7 * 7 + motors * 8
    for hidden in (0, -1, 101):
        with pytest.raises(InputError, match=f"has 1 to 100 hidden neurons, got {hidden}"):
            network_for(robot, hidden)


def test_a_silent_neuron_that_the_design_lacks_is_refused(quadruped: Robot):
    network = network_for(quadruped)
    check_silent_neurons(network, {0, 1, 2})
    with pytest.raises(InputError, match=r"neuron:6 does not apply to a network .* are 0 to 2"):
        check_silent_neurons(network, {6})
    with pytest.raises(InputError, match=r"neuron:3 does not apply .* leave neuron:3 out"):
        make_batch(random_controllers(quadruped, 2), [{0}, {3}], len(network.sensors))
    with pytest.raises(InputError, match="has no hidden neurons: leave neuron:0 out"):
        make_batch(random_cpgs(quadruped, 1), [{0}], len(network.sensors))


def test_weights_are_drawn_from_minus_one_to_one_in_hundredths():
    weights = draw_genomes(np.random.default_rng(0), (10_000,))

    assert (weights.min(), weights.max()) == (-1, 1)
    np.testing.assert_array_equal(weights, np.round(weights, 2))


def test_a_batch_with_another_design_is_refused(quadruped: Robot):
    (network,), (one,) = random_controllers(quadruped, 1), random_cpgs(quadruped, 1)
    with pytest.raises(ValueError, match=r"got 1 x a network of .*; 1 x a CPG of .*; 0 play"):
        make_batch([network, one], [frozenset()] * 2, sensors=8)
    other = Controller(CPG, genomes(CPG)[0])
    with pytest.raises(ValueError, match=r"got 1 x a CPG of 8 .*; 1 x a CPG of 2 sensors"):
        make_batch([one, other], [frozenset()] * 2, sensors=8)
    with pytest.raises(ValueError, match=r"got 1 x a network of .*; 1 playbacks"):
        make_batch([network, Playback((), np.zeros((1, 0)))], [frozenset()] * 2, sensors=8)


@DESIGNS
def test_controllers_are_equal_when_their_genome_and_design_are(design: Design):
    genome = genomes(design)[0]
    other = CPG if design is NETWORK else Cpg(CPG.sensors, CPG.motors, 0.02, ranges=CPG.ranges)

    assert len({Controller(design, genome), Controller(design, genome.copy())}) == 1
    assert Controller(design, genome) != Controller(design, -genome)
    assert Controller(design, genome) != Controller(other, genomes(other)[0])
    assert Controller(design, genome) != "a controller"


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: Controller(CPG, np.zeros(11)), "has 12 weights, got a genome of shape"),
        (lambda: Controller(NETWORK, np.full(68, 1.01)), r"must lie in \[-1, 1\]"),
        (lambda: Controller(CPG, np.full(12, np.nan)), r"must lie in \[-1, 1\]"),
        (lambda: Cpg((), ("hip",), 0.0), "at most 3600 s, got 0.0"),
        (lambda: Cpg((), ("hip",), math.nan), "at most 3600 s, got nan"),
        (
            lambda: Cpg((), ("hip",), 0.1, ranges=((0.0, 1.0),) * 2),
            "1 motors need a command range each",
        ),
    ],
)
def test_a_genome_or_design_that_does_not_fit_is_refused(make: Callable[[], object], match: str):
    with pytest.raises(ValueError, match=match):
        make()


def test_command_ranges_are_the_paper_s_by_default():
    assert Cpg((), ("hip",), 0.1).ranges == ((0.0, TARGET_RANGE),)
