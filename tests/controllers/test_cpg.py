"""Tests of CPGs: decoding, bounds and formula, and rows that are independent of each other."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from selfmodel.controllers.controller import TARGET_RANGE, Controller, draw_genomes, make_batch
from selfmodel.controllers.cpg import (
    MAX_FEEDBACK,
    MAX_FREQUENCY,
    MIN_FREQUENCY,
    Cpg,
    amplitude_rise,
)
from selfmodel.errors import InputError
from selfmodel.faults.notation import parse
from selfmodel.robot.designs import cpg_for
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.signals import SIGNALS
from tests.helpers.drivers import random_controllers, random_cpgs

RANGES = ((0.5, 0.25), (0.0, 1.0), (-2.0, 1.0))
CPG = Cpg(("touch", "angle"), ("hip", "knee", "ankle"), 0.01, RANGES)


def genomes(count: int, seed: int = 0) -> np.ndarray:
    return draw_genomes(np.random.default_rng(seed), (count, CPG.weights))


def commanded(genome: np.ndarray, readings: np.ndarray) -> np.ndarray:
    """Returns the commands, ``(steps, motors)``, for readings, ``(steps, sensors)``."""
    batch, commands = CPG.batch(genome[np.newaxis], [frozenset()]), np.empty((len(readings), 1, 3))
    for reading, command in zip(readings, commands, strict=True):
        batch.readings[0] = reading
        batch.step(command)
    return commands[:, 0]


def test_a_genome_has_the_documented_length(robot: Robot):
    assert cpg_for(robot).weights == {"quadruped": 33, "hexapod": 67}[robot.name]


def test_a_step_is_the_formula_of_the_docs():
    genome = genomes(1)[0]
    one = CPG.decode(genome)
    readings = np.random.default_rng(1).uniform(-1, 1, (300, 2))
    clock, expected = 0.0, []
    for step, reading in enumerate(readings):
        t = 0.01 * step
        swing = one.amplitudes * np.cos(2 * np.pi * (clock + one.phases)) + one.offsets
        envelope = 1 - (1 + 10 * t) * math.exp(-10 * t)
        expected.append([0.5, 0.0, -2.0] + np.array([0.25, 1.0, 1.0]) * envelope * swing)
        clock += 0.01 * one.frequency * (1 + one.feedback @ reading)

    np.testing.assert_allclose(commanded(genome, readings), expected, atol=1e-12)


@given(seed=st.integers(0, 10_000), reading=st.floats(-1, 1))
def test_every_genome_keeps_commands_in_range_and_the_phase_advancing(seed: int, reading: float):
    genome = genomes(1, seed)[0]
    one = CPG.decode(genome)
    commands = commanded(genome, np.full((50, 2), reading))
    centre, half = np.array(RANGES).T

    assert np.all(np.abs(commands - centre) <= half * (1 + 1e-12))
    assert np.all(np.abs(one.offsets) + one.amplitudes <= 1 + 1e-12)
    assert MIN_FREQUENCY * (1 - 1e-12) <= one.frequency <= MAX_FREQUENCY * (1 + 1e-12)
    assert np.abs(one.feedback).sum() <= MAX_FEEDBACK + 1e-12


def test_commands_start_at_the_centre_and_reach_their_amplitude_smoothly():
    genome = np.concatenate([np.ones(1 + 3), np.zeros(CPG.weights - 4)])
    commands = commanded(genome, np.zeros((300, 2)))

    assert np.array_equal(commands[0], [0.5, 0.0, -2.0])
    assert np.abs(commands[1] - commands[0]).max() < 0.01
    assert np.ptp(commands[100:], axis=0) == pytest.approx([0.5, 2.0, 2.0], rel=0.02)


def test_the_amplitude_rise_solves_its_differential_equation():
    a, step = 20.0, 1e-4
    r, speed = 0.0, 0.0
    for k in range(5000):
        assert amplitude_rise(k * step) == pytest.approx(r, abs=2e-3)
        r, speed = r + step * speed, speed + step * a * (a / 4 * (1 - r) - speed)


def test_commands_are_periodic_at_the_stride_frequency():
    genome = genomes(1, 3)[0]
    one = CPG.decode(genome)
    steps = 100 / (one.frequency * 0.01)  # of a hundred strides
    commands = commanded(genome, np.zeros((200 + round(steps), 2)))
    drift = np.abs(round(steps) - steps) * 0.01 * 2 * np.pi * one.frequency

    apart = np.abs(commands[150:200] - commands[150 + round(steps) : 200 + round(steps)])
    assert apart.max() <= drift + 2e-5 * 100


def test_a_reading_changes_the_commands_only_with_feedback():
    genome = genomes(1, 5)[0].copy()
    genome[-2:] = [1.0, 0.0]
    quiet = commanded(genome, np.zeros((200, 2)))
    touched = commanded(genome, np.tile([1.0, 0.0], (200, 1)))
    without_gain = commanded(genome, np.tile([0.0, 1.0], (200, 1)))

    assert np.abs(touched - quiet).max() > 0.05
    assert np.array_equal(without_gain, quiet)


@settings(max_examples=30)
@given(rows=st.integers(1, 40), data=st.data())
def test_a_row_is_the_same_to_the_bit_in_any_batch_and_place(rows: int, data: st.DataObject):
    place = data.draw(st.integers(0, rows - 1))
    drawn = genomes(rows, rows)
    readings = np.random.default_rng(place).normal(size=(20, rows, 2))
    together = CPG.batch(drawn, [frozenset()] * rows)
    alone = CPG.batch(drawn[place : place + 1], [frozenset()])
    for reading in readings:
        many, one = np.empty((rows, 3)), np.empty((1, 3))
        together.readings[:], alone.readings[:] = reading, reading[place]
        together.step(many)
        alone.step(one)
        assert many[place].tobytes() == one.tobytes()


def test_a_robot_moves_the_same_to_the_bit_in_any_batch_on_any_threads(robot: Robot):
    hypotheses = [parse("intact", robot.anatomy)] * 6
    hypotheses[1] = parse(f"break:{robot.anatomy.joints[0].name}", robot.anatomy)
    hypotheses[2] = parse(f"sensor:{robot.anatomy.sensors[0].name}", robot.anatomy)
    runs = list(zip(hypotheses, random_cpgs(robot, 6), strict=True))
    together = Simulator(robot, 2).run(runs, 60, SIGNALS).behaviour
    backwards = Simulator(robot, 1).run(runs[::-1], 60, SIGNALS).behaviour
    for row, run in enumerate(runs[:3]):
        alone = Simulator(robot, 1).run([run], 60, SIGNALS).behaviour
        for signal in SIGNALS:
            assert alone[signal][0].tobytes() == together[signal][row].tobytes()
            assert alone[signal][0].tobytes() == backwards[signal][5 - row].tobytes()


def test_a_failed_sensor_changes_the_motion_only_with_feedback(quadruped: Robot):
    cpg = cpg_for(quadruped)
    one, without_feedback = (
        Controller(cpg, np.concatenate([np.full(25, 0.5), np.full(8, feedback)]))
        for feedback in (1.0, 0.0)
    )
    dead = parse("sensor:front_left_touch", quadruped.anatomy)
    intact = parse("intact", quadruped.anatomy)
    runs = [(intact, one), (dead, one), (intact, without_feedback), (dead, without_feedback)]
    moved = Simulator(quadruped, 1).run(runs, 150, ["joint_positions"]).behaviour["joint_positions"]

    assert np.abs(moved[0] - moved[1]).max() > 0.01
    assert np.array_equal(moved[2], moved[3])


def test_a_silent_neuron_is_refused(quadruped: Robot):
    run = (parse("neuron:0", quadruped.anatomy), random_cpgs(quadruped, 1)[0])
    with pytest.raises(InputError, match="has no hidden neurons: leave neuron:0 out"):
        Simulator(quadruped, 1).run([run], 2, ["sensors"])


def test_a_batch_with_another_design_is_refused(
    quadruped: Robot,
):
    (network,), (one,) = random_controllers(quadruped, 1), random_cpgs(quadruped, 1)
    with pytest.raises(ValueError, match=r"got 1 x a network of .*; 1 x a CPG of .*; 0 play"):
        make_batch([network, one], [frozenset()] * 2, sensors=8)
    other = Controller(CPG, genomes(1)[0])
    with pytest.raises(ValueError, match=r"got 1 x a CPG of 8 .*; 1 x a CPG of 2 sensors"):
        make_batch([one, other], [frozenset()] * 2, sensors=8)


def test_controllers_are_equal_when_their_genome_and_design_are():
    genome = genomes(1)[0]

    assert Controller(CPG, genome) == Controller(CPG, genome.copy())
    assert len({Controller(CPG, genome), Controller(CPG, genome.copy())}) == 1
    assert Controller(CPG, genome) != Controller(CPG, -genome)
    other = Cpg(CPG.sensors, CPG.motors, 0.02, CPG.ranges)
    assert Controller(CPG, genome) != Controller(other, genome)
    assert Controller(CPG, genome) != "a controller"


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: Controller(CPG, np.zeros(11)), "has 12 weights, got a genome of shape"),
        (lambda: Controller(CPG, np.full(12, 1.1)), r"must lie in \[-1, 1\]"),
        (lambda: Controller(CPG, np.full(12, np.nan)), r"must lie in \[-1, 1\]"),
        (lambda: Cpg((), ("hip",), 0.0), "at most 3600 s, got 0.0"),
        (lambda: Cpg((), ("hip",), math.nan), "at most 3600 s, got nan"),
        (lambda: Cpg((), ("hip",), 0.1, ((0.0, 1.0),) * 2), "1 motors need a command range each"),
    ],
)
def test_a_genome_or_design_that_does_not_fit_is_refused(make: Callable[[], object], match: str):
    with pytest.raises(ValueError, match=match):
        make()


def test_command_ranges_are_the_paper_s_by_default():
    assert Cpg((), ("hip",), 0.1).ranges == ((0.0, TARGET_RANGE),)
