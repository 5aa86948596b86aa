"""Promises of the simulator: the same bits in any batch, and a divergence that stays alone."""

import copy

import mujoco
import numpy as np
import pytest

from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import ALL_KINDS
from selfmodel.isolation import available_memory
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import SensorNoise
from selfmodel.simulation.requests import ClosedLoop, Ensemble, Request
from selfmodel.simulation.rollout import batch_bytes, hypothesis_bytes, largest_batch
from selfmodel.simulation.simulator import Run, Simulator, cached_rows
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import NotRecordedError, Trajectory, collect
from tests.helpers.drivers import random_controllers
from tests.helpers.hostile import exploding

STEPS = 40
RECORD = ("sensors", "joint_positions", "base_position")


def some_runs(robot: Robot, count: int) -> list[Run]:
    """Runs with every kind of fault, each with a controller of its own."""
    joints = [joint.name for joint in robot.anatomy.joints]
    first, last = (robot.anatomy.sensors[k].name for k in (0, -1))
    texts = [
        *("intact", f"break:{joints[0]}", f"jam:{joints[1]}=0.2", f"sensor:{first}", "neuron:1"),
        f"break:{joints[1]}+jam:{joints[2]}+sensor:{last}",
        f"roughness=0.03+motor:{joints[0]}=0.5",
        f"sensor:{last}=noise0.3+friction=0.4+slope=0.1",
        f"roughness=0.01+break:{joints[0]}+wind=-12+crosswind=8",
    ]
    return [
        (parse(texts[i % len(texts)], robot.anatomy), controller)
        for i, controller in enumerate(random_controllers(robot, count))
    ]


def bits(trajectory: Trajectory) -> list[bytes]:
    """Every signal of every run, as bytes."""
    runs = range(len(trajectory["sensors"]))
    return [b"".join(trajectory[s][i].tobytes() for s in trajectory.signals) for i in runs]


def test_a_run_has_the_same_bits_in_any_batch_order_and_number_of_threads(robot: Robot):
    runs = some_runs(robot, 9)

    def run(chosen: list[Run], threads: int) -> list[bytes]:
        return bits(Simulator(robot, threads).run(chosen, STEPS, SIGNALS).trajectory)

    expected = run(runs, 1)
    assert len(set(expected)) == len(runs)  # else equality would say nothing
    assert run(runs, 3) == expected
    assert run(runs[::-1], 2) == expected[::-1]
    parts = [run(runs[i : i + 4], 2) for i in range(0, len(runs), 4)]
    assert [own for part in parts for own in part] == expected


def test_a_run_does_not_depend_on_what_the_simulator_ran_before_and_is_counted(quadruped: Robot):
    runs, simulator = some_runs(quadruped, 6), Simulator(quadruped, 2)
    first = simulator.run(runs, STEPS, SIGNALS).trajectory
    simulator.run(runs[::-1], 7, ["sensors"])
    again = simulator.run(runs, STEPS, SIGNALS).trajectory

    assert bits(first) == bits(again)
    stats = simulator.stats
    assert (stats.runs, stats.steps, stats.diverged) == (18, 6 * (2 * STEPS + 7), 0)
    assert stats.physics_seconds > 0


def test_the_physical_robot_in_simulation_has_the_same_bits_but_for_what_is_random(robot: Robot):
    runs, steps = some_runs(robot, 9), 60
    simulated = Simulator(robot, 2).run(runs, steps, SIGNALS).trajectory
    for i, (hypothesis, controller) in enumerate(runs):
        samples = SimulatedRobot(robot, hypothesis).run(controller, steps)
        observed = collect(robot.anatomy.names, samples)
        # The bumps of a terrain, and the noise of a sensor, are its own.
        random = {"roughness", "sensor-noise"} & {fault.kind.name for fault in hypothesis.faults}

        assert np.array_equal(observed.time, simulated.time)
        for signal in SIGNALS:
            same = np.array_equal(observed[signal], simulated[signal][i])
            assert same == (not random), (signal, hypothesis)


def test_readings_are_what_the_paper_says_and_only_what_is_asked_for_is_recorded(quadruped: Robot):
    record = ("sensors", "joint_positions", "commands")
    trajectory = Simulator(quadruped, 1).run(some_runs(quadruped, 12), 150, record).trajectory
    touch, angle = trajectory["sensors"][..., :4], trajectory["sensors"][..., 4:]
    shoulders = [quadruped.anatomy.hinges.index(s.hinge) for s in quadruped.anatomy.sensors[4:]]
    intact = trajectory["joint_positions"][0][:, shoulders] / np.deg2rad(30)

    assert set(np.unique(touch)) == {0.0, 1.0}
    np.testing.assert_allclose(angle[0], intact, rtol=1e-6)
    assert np.abs(trajectory["commands"]).max() <= np.pi / 4
    with pytest.raises(NotRecordedError, match=r"'base_position': .* known ones are sensors, join"):
        trajectory["base_position"]


def test_a_diverging_simulation_is_flagged_counted_and_alone(quadruped: Robot):
    runs = some_runs(quadruped, 6)
    expected = Simulator(quadruped, 2).run(runs, 60, SIGNALS).trajectory
    simulator = Simulator(quadruped, 2)
    bad = exploding(simulator, "jam:front_left_knee=0.1")
    outcome = simulator.run([*runs[:2], (bad, runs[0][1]), *runs[2:]], 60, SIGNALS)

    assert outcome.diverged.tolist() == [False, False, True, False, False, False, False]
    assert simulator.stats.diverged == 1
    for signal in SIGNALS:
        others = np.delete(outcome.trajectory[signal], 2, axis=0)
        assert np.array_equal(others, expected[signal]), signal


def test_members_of_an_ensemble_without_a_gap_do_what_each_kind_of_fault_does(quadruped: Robot):
    robot = quadruped
    hypotheses = [INTACT, *(Hypothesis(k.candidates(robot.anatomy)[-1:]) for k in ALL_KINDS)]
    (controller,) = random_controllers(robot, 1)
    simulator = Simulator(robot, 1)
    alone = simulator.run([(one, controller) for one in hypotheses], STEPS, RECORD).trajectory
    found = simulator.run_ensemble(hypotheses, controller, STEPS, Ensemble(RECORD, 2, 0.0))

    for signal in RECORD:
        for member in range(2):
            np.testing.assert_array_equal(found.trajectory[signal][:, member], alone[signal])


def test_each_member_differs_and_rough_ground_is_rough_for_each(quadruped: Robot):
    """What is compiled into the model is there whatever else a member differs by."""
    (controller,) = random_controllers(quadruped, 1)
    rough = parse("roughness=0.04", quadruped.anatomy)
    ensemble = Ensemble(("base_position",), 3, 0.05)
    found = Simulator(quadruped, 1).run_ensemble([INTACT, rough], controller, 400, ensemble)
    level, bumpy = found.trajectory["base_position"][:, :, -1]

    assert (np.abs(level - bumpy).max(axis=1) > 1e-3).all()
    assert len(np.unique(level, axis=0)) == 3


def test_a_hypothesis_has_diverged_if_any_of_its_members_has(quadruped: Robot):
    wild = copy.copy(quadruped.model)
    wild.opt.gravity[2] = -1e12
    simulator = Simulator(quadruped, 1)
    simulator._members = lambda shape, *_: (
        (quadruped.model, wild if shape == INTACT else quadruped.model)
    )
    (controller,) = random_controllers(quadruped, 1)
    rough = parse("roughness=0.04", quadruped.anatomy)
    ensemble = Ensemble(("base_position",), 2, 0.05)
    found = simulator.run_ensemble([INTACT, rough], controller, STEPS, ensemble)

    assert found.diverged.tolist() == [True, False]


def test_copies_of_a_robot_with_a_noisy_sensor_each_have_their_own_noise(quadruped: Robot):
    noisy = build(quadruped, parse("sensor:back_left_angle=noise0.3", quadruped.anatomy))
    readings = np.zeros((3, len(quadruped.anatomy.sensors)))
    SensorNoise([noisy], copies=3).add(readings)

    column = quadruped.anatomy.names.sensors.index("back_left_angle")
    assert len(set(readings[:, column])) == 3
    assert not np.delete(readings, column, axis=1).any()


@pytest.mark.parametrize(
    ("request_", "models"), [(ClosedLoop(RECORD), 1), (Ensemble(RECORD, members=6, level=0.05), 6)]
)
def test_a_batch_fits_into_the_available_memory(quadruped: Robot, request_: Request, models: int):
    needed, size = (own(quadruped, request_, STEPS) for own in (hypothesis_bytes, largest_batch))
    names = quadruped.anatomy.names
    signals = models * STEPS * sum(names.width(signal) for signal in RECORD) * 8

    assert needed > models * quadruped.model.nbuffer + signals
    assert hypothesis_bytes(quadruped, request_, 10**6) > 10**6 * signals / STEPS
    assert 1 < size <= batch_bytes() / needed
    assert batch_bytes() < available_memory()
    assert largest_batch(quadruped, request_, 10**9) == 1  # simulated alone


def test_a_finer_robot_differs_in_the_length_of_its_physics_steps_alone(robot: Robot):
    finer = Simulator(robot).finer(4).robot
    assert (finer.substeps, finer.control_timestep) == (4 * robot.substeps, robot.control_timestep)
    assert (finer.control_delay, finer.anatomy) == (robot.control_delay, robot.anatomy)
    same = copy.copy(finer.model)
    same.opt.timestep = robot.model.opt.timestep
    bits = [np.empty(mujoco.mj_sizeModel(each), np.uint8) for each in (same, robot.model)]
    for model, buffer in zip((same, robot.model), bits, strict=True):
        mujoco.mj_saveModel(model, None, buffer)
    np.testing.assert_array_equal(*bits)


def test_a_cache_computes_every_key_once():
    computed: list[str] = []

    def compute(keys: list[str]) -> np.ndarray:
        computed.extend(keys)
        return np.array([[len(key), -len(key)] for key in keys])

    known: dict[str, np.ndarray] = {}
    rows = cached_rows(known, ["a", "bb", "a"], compute)
    assert np.array_equal(rows, [[1, -1], [2, -2], [1, -1]])
    assert np.array_equal(cached_rows(known, ["bb", "ccc"], compute), [[2, -2], [3, -3]])
    assert computed == ["a", "bb", "ccc"]
