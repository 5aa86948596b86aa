"""Promises of the simulator: the same bits in any batch, and a divergence that stays alone."""

import numpy as np
import pytest

from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.robot.sensing import SensorReader
from selfmodel.simulation.simulator import Run, Simulator
from selfmodel.trials.behaviour import collect
from selfmodel.trials.signals import SIGNALS
from tests.helpers.drivers import random_controllers
from tests.helpers.hostile import exploding

STEPS = 150


def some_runs(robot: Robot, count: int) -> list[Run]:
    """Runs with every kind of fault, each with a controller of its own."""
    joints = [joint.name for joint in robot.anatomy.joints]
    texts = [
        "intact",
        f"break:{joints[0]}",
        f"jam:{joints[1]}=0.2",
        f"sensor:{robot.anatomy.sensors[0].name}",
        "neuron:1",
        f"break:{joints[1]}+jam:{joints[2]}+sensor:{robot.anatomy.sensors[-1].name}",
        f"roughness=0.03+motor:{joints[0]}=0.5",
        f"sensor:{robot.anatomy.sensors[-1].name}=noise0.3+friction=0.4+slope=0.1",
        f"roughness=0.01+break:{joints[0]}+wind=-12+crosswind=8",
    ]
    hypotheses = [parse(text, robot.anatomy) for text in texts]
    return [
        (hypotheses[i % len(hypotheses)], controller)
        for i, controller in enumerate(random_controllers(robot, count))
    ]


def bits(robot: Robot, runs: list[Run], threads: int) -> list[bytes]:
    """Every signal of every run, as bytes."""
    behaviour = Simulator(robot, threads).run(runs, STEPS, SIGNALS).behaviour
    return [b"".join(behaviour[s][i].tobytes() for s in SIGNALS) for i in range(len(runs))]


def test_a_run_has_the_same_bits_in_any_batch_order_and_number_of_threads(robot: Robot):
    runs = some_runs(robot, 24)
    expected = bits(robot, runs, 1)

    assert len(set(expected)) == len(runs)  # else equality would say nothing
    assert bits(robot, runs, 2) == expected
    assert bits(robot, runs, 3) == expected
    assert bits(robot, runs[::-1], 2) == expected[::-1]
    for size in (1, 5):
        pieces = [bits(robot, runs[i : i + size], 2) for i in range(0, len(runs), size)]
        assert [run for piece in pieces for run in piece] == expected


def test_a_run_does_not_depend_on_what_the_simulator_ran_before(robot: Robot):
    runs = some_runs(robot, 6)
    simulator = Simulator(robot, 2)
    first = simulator.run(runs, STEPS, SIGNALS).behaviour
    simulator.run(runs[::-1], STEPS, SIGNALS)
    again = simulator.run(runs, STEPS, SIGNALS).behaviour

    assert all(np.array_equal(first[signal], again[signal]) for signal in SIGNALS)


def test_the_physical_robot_in_simulation_has_the_same_bits_but_for_what_is_random(robot: Robot):
    runs = some_runs(robot, 9)
    simulated = Simulator(robot, 2).run(runs, STEPS, SIGNALS).behaviour
    for i, (hypothesis, controller) in enumerate(runs):
        samples = SimulatedRobot(robot, hypothesis).run(controller, STEPS)
        observed = collect(robot.anatomy.names, samples)
        # The bumps of a terrain, and the noise of a sensor, are its own.
        random = {"roughness", "sensor-noise"} & {fault.kind.name for fault in hypothesis.faults}

        assert np.array_equal(observed.time, simulated.time)
        for signal in SIGNALS:
            same = np.array_equal(observed[signal], simulated[signal][i])
            assert same == (not random), (signal, hypothesis)


def test_only_what_is_asked_for_is_recorded(quadruped: Robot):
    behaviour = Simulator(quadruped, 1).run(some_runs(quadruped, 2), 5, ["sensors"]).behaviour

    assert behaviour["sensors"].shape == (2, 5, 8)
    with pytest.raises(KeyError, match="base_position was not recorded; recorded: sensors"):
        behaviour["base_position"]


def test_readings_are_what_the_paper_says(quadruped: Robot):
    behaviour = Simulator(quadruped, 1).run(some_runs(quadruped, 12), STEPS, SIGNALS).behaviour
    touch, angle = behaviour["sensors"][..., :4], behaviour["sensors"][..., 4:]
    shoulders = [quadruped.anatomy.hinges.index(s.hinge) for s in quadruped.anatomy.sensors[4:]]
    intact = behaviour["joint_positions"][0][:, shoulders] / np.deg2rad(30)

    assert set(np.unique(touch)) == {0.0, 1.0}
    np.testing.assert_allclose(angle[0], intact, rtol=1e-6)
    assert np.abs(behaviour["commands"]).max() <= np.pi / 4


def test_touch_is_felt_from_the_smallest_force_on(quadruped: Robot):
    senses = SensorReader(quadruped.model, quadruped.anatomy, [build(quadruped, INTACT)])
    forces = np.array([[0.0, 1e-9, 1.0, 1e4, 0.0, 0.0, 0.0, 0.0]])
    readings = np.empty((1, 8))
    senses.read(forces, quadruped.model.qpos0[np.newaxis], readings)

    assert readings[0, :4].tolist() == [0, 1, 1, 1]


def test_a_diverging_simulation_is_flagged_counted_and_alone(robot: Robot):
    runs = some_runs(robot, 6)
    expected = Simulator(robot, 2).run(runs, STEPS, SIGNALS).behaviour
    simulator = Simulator(robot, 2)
    bad = exploding(simulator, f"jam:{robot.anatomy.joints[0].name}=0.1")
    mixed = [*runs[:2], (bad, runs[0][1]), *runs[2:]]
    outcome = simulator.run(mixed, STEPS, SIGNALS)

    assert outcome.diverged.tolist() == [False, False, True, False, False, False, False]
    assert simulator.stats.diverged == 1
    for signal in SIGNALS:
        others = np.delete(outcome.behaviour[signal], 2, axis=0)
        assert np.array_equal(others, expected[signal]), signal


def test_the_tally_counts_runs_and_steps(quadruped: Robot):
    simulator = Simulator(quadruped, 1)
    simulator.run(some_runs(quadruped, 3), 10, ["sensors"])
    simulator.run(some_runs(quadruped, 2), 7, ["sensors"])

    assert (simulator.stats.runs, simulator.stats.steps, simulator.stats.diverged) == (5, 44, 0)
    assert simulator.stats.physics_seconds > 0
