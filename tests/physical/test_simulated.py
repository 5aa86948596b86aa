"""Promises of trials across a gap: noise, delay, what their logs hide, and debris of lost limbs."""

import dataclasses
import json
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from selfmodel.controllers.playback import played_back
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.logs import LogError, read_gap, read_log, read_truth
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.writer import write_trial
from selfmodel.physical.simulated import (
    NoisyMeasurement,
    SimulatedRobot,
    draw_gap,
    place_debris,
)
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import current_value, signal_fields
from selfmodel.settings import Settings
from selfmodel.simulation.reality_gap import DEBRIS_PREFIX, RealityGap
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import ROBOTS
from selfmodel.trials.signals import MEASUREMENT_FULL_SCALES, SIGNALS
from selfmodel.trials.trajectory import Trajectory, collect
from selfmodel.trials.trial import TrialPlan
from tests.helpers.command import SMALL, printed
from tests.helpers.drivers import random_controllers, random_motion
from tests.helpers.robots.arms import arm, quadruped_on_a_stand

STEPS = 60


def drawn(robot: Robot, level: float, seed: int = 0) -> RealityGap:
    return draw_gap(robot, level, np.random.default_rng(seed))


LEVEL = 0.05
JOINTS = [("quadruped", "front_left_shoulder"), ("hexapod", "front_left_knee")]


def ran(physical: SimulatedRobot, robot: Robot, steps: int = STEPS) -> Trajectory:
    (controller,) = random_controllers(robot, 1)
    return collect(robot.anatomy.names, physical.run(controller, steps))


def same(one: Trajectory, other: Trajectory) -> bool:
    return all(one[signal].tobytes() == other[signal].tobytes() for signal in SIGNALS)


@pytest.mark.parametrize("fault", ["break:{}", "motor:{}=0.4"])
@pytest.mark.parametrize(
    "robot", [*(entry.robot() for entry in ROBOTS.values()), arm(), quadruped_on_a_stand()]
)
def test_a_trial_at_gap_0_is_the_simulators_to_the_bit(robot: Robot, fault: str):
    truth = parse(fault.format(robot.anatomy.joints[1].name), robot.anatomy)
    (controller,) = random_controllers(robot, 1)
    simulated = Simulator(robot, 1).run([(truth, controller)], STEPS, SIGNALS).trajectory
    for gap in (None, drawn(robot, 0.0)):
        found = ran(SimulatedRobot(robot, truth, gap), robot)

        assert all(found[s].tobytes() == simulated[s][0].tobytes() for s in SIGNALS)


def test_the_same_seed_gives_the_same_trials_and_no_two_of_one_robot(quadruped: Robot):
    robot = quadruped
    truth = parse(f"break:{robot.anatomy.joints[0].name}", robot.anatomy)
    gap = drawn(robot, 0.1)
    first, again = (SimulatedRobot(robot, truth, gap) for _ in range(2))
    trials = [ran(first, robot) for _ in range(2)]

    assert same(trials[0], ran(again, robot))
    assert same(trials[1], ran(again, robot))
    assert not same(trials[0], trials[1])
    assert not same(trials[0], ran(SimulatedRobot(robot, truth, gap, stream=1), robot))


@pytest.mark.parametrize("delay", [0, 2])
def test_a_command_reaches_the_motors_so_many_steps_later(quadruped: Robot, delay: int):
    """A late robot does what a prompt one does whose commands come later, and zeros at first."""
    gap = dataclasses.replace(drawn(quadruped, 0.0), level=1e-12)
    motion = random_motion(quadruped, STEPS)
    later = np.concatenate([np.zeros((delay, motion.shape[1])), motion])[:STEPS]

    def trial(commands: np.ndarray, late: int) -> Trajectory:
        playback = played_back(quadruped.anatomy.motors, commands)
        physical = SimulatedRobot(quadruped, gap=dataclasses.replace(gap, delay=late))
        return collect(quadruped.anatomy.names, physical.run(playback, STEPS))

    late, prompt = trial(motion, delay), trial(later, 0)
    undelayed = trial(motion, 0)

    np.testing.assert_array_equal(late["commands"], motion)
    np.testing.assert_allclose(late["joint_positions"], prompt["joint_positions"], atol=1e-9)
    apart = np.abs(late["joint_positions"] - undelayed["joint_positions"]).max()
    assert (apart > 0.01) == (delay > 0)


def noise_of(robot: Robot, level: float) -> NoisyMeasurement:
    return NoisyMeasurement(level, robot, build(robot, INTACT), np.random.default_rng(0))


def test_readings_have_the_noise_of_the_level(quadruped: Robot):
    level, steps = 0.1, 4000
    noise = noise_of(quadruped, level)
    rows = np.tile([1.0, 0, 1, 0, 0.3, -0.3, 0, 0], (steps, 1))
    clean = rows.copy()
    for row in rows:
        noise.corrupt_readings(row)
    error = rows - clean

    assert set(np.unique(rows[:, :4])) == {0.0, 1.0}
    np.testing.assert_allclose(np.abs(error[:, :4]).mean(axis=0), level / 2, atol=0.02)
    np.testing.assert_allclose(error[:, 4:].std(axis=0), level, rtol=0.06)
    np.testing.assert_allclose(error[:, 4:].mean(axis=0), 0, atol=5 * level / np.sqrt(steps))


def test_the_encoder_of_a_hinge_without_limits_has_the_noise_of_a_full_turn(quadruped: Robot):
    """MuJoCo does not convert the range of such a hinge from degrees: 60 would be 60 rad."""
    spec = quadruped.specification()
    spec.joint("front_left_knee").limited = mujoco.mjtLimited.mjLIMITED_FALSE
    spec.joint("front_left_knee").range = [-60.0, 60.0]
    free = dataclasses.replace(quadruped, mjcf=spec.to_xml())
    noise = noise_of(free, 0.1)
    rows = [noise.measure("joint_positions", np.zeros(8)) for _ in range(4000)]
    scales = np.std(rows, axis=0)[free.anatomy.hinges.index("front_left_knee")]

    assert free.model.joint("front_left_knee").range.tolist() == [-60.0, 60.0]
    assert scales == pytest.approx(0.1 * np.pi, rel=0.06)


def test_logged_signals_have_noise_of_their_full_scale(quadruped: Robot):
    level, draws = 0.1, 2000
    noise = noise_of(quadruped, level)
    half = quadruped.anatomy.sensors[-1].half_range
    for signal in SIGNALS:
        clean = np.zeros(quadruped.anatomy.names.width(signal))
        if signal == "base_orientation":
            clean = Rotation.from_euler("xyz", [0.3, -0.2, 1.0]).as_quat(scalar_first=True)
        rows = np.array([noise.measure(signal, clean) for _ in range(draws)])
        if signal in ("sensors", "commands"):
            np.testing.assert_array_equal(rows, np.tile(clean, (draws, 1)))
            continue
        if signal == "base_orientation":
            np.testing.assert_allclose(np.linalg.norm(rows, axis=1), 1, rtol=1e-12)
            turns = Rotation.from_quat(clean, scalar_first=True).inv() * Rotation.from_quat(
                rows, scalar_first=True
            )
            error = turns.as_rotvec()
        else:
            error = rows - clean
        scale = half if signal == "joint_positions" else MEASUREMENT_FULL_SCALES[signal]
        np.testing.assert_allclose(error.std(axis=0), level * scale, rtol=0.06)


def test_a_noisy_sensor_has_another_noise_in_every_trial(quadruped: Robot):
    """Three trials are to show what it does three times, not one draw three times."""
    truth = parse("sensor:back_left_angle=noise0.3", quadruped.anatomy)
    driver = played_back(quadruped.anatomy.motors, np.zeros((250, len(quadruped.anatomy.motors))))
    column = quadruped.anatomy.names.sensors.index("back_left_angle")

    def heard(level: float) -> list[np.ndarray]:
        physical = SimulatedRobot(quadruped, truth, drawn(quadruped, level))
        runs = [collect(quadruped.anatomy.names, physical.run(driver, 250)) for _ in range(2)]
        return [run["sensors"][50:, column] for run in runs]

    assert abs(np.corrcoef(heard(0.05))[0, 1]) < 0.3
    assert np.array_equal(*heard(0.0))


@pytest.mark.parametrize(
    ("text", "dead"),
    [
        ("sensor:back_left_angle+sensor:back_left_touch", {"back_left_angle", "back_left_touch"}),
        ("break:front_left_shoulder", {"front_left_touch", "front_left_angle"}),
        ("jam:front_left_shoulder=0.2", set()),
    ],
)
def test_a_dead_sensor_reads_exactly_0_and_any_other_has_noise(
    quadruped: Robot, text: str, dead: set[str]
):
    gap = drawn(quadruped, 0.2)
    truth = parse(text, quadruped.anatomy)
    trial = ran(SimulatedRobot(quadruped, truth, gap), quadruped, 200)
    for sensor, column in zip(quadruped.anatomy.sensors, trial["sensors"].T, strict=True):
        if sensor.name in dead:
            assert not column.any()
        elif sensor.kind == "angle":
            assert np.abs(np.diff(column)).min() > 0


def test_the_log_hides_the_gap_where_only_scoring_looks(quadruped: Robot, tmp_path: Path):
    gap = drawn(quadruped, 0.1)
    (controller,) = random_controllers(quadruped, 1)
    plan = TrialPlan("trial", "single", controller, STEPS, 0)
    samples = list(SimulatedRobot(quadruped, gap=gap).run(controller, STEPS))
    texts = {"known": gap.text, "none": None, "bad": "[1"}
    for name, text in texts.items():
        header = TrialHeader(Settings(), hidden="intact", gap=text)
        write_trial(tmp_path / f"{name}.mcap", quadruped, plan, samples, header)
        assert read_truth(tmp_path / f"{name}.mcap") == "intact"
        log = read_log(tmp_path / f"{name}.mcap")
        assert same(log.trial.trajectory, collect(quadruped.anatomy.names, samples))
        assert "delay" not in repr(log)
    assert read_gap(tmp_path / "known.mcap") == json.loads(gap.text)
    assert read_gap(tmp_path / "none.mcap") is None
    with pytest.raises(LogError, match="its gap"):
        read_gap(tmp_path / "bad.mcap")


def broken(robot: Robot, text: str, level: float = LEVEL) -> SimulatedRobot:
    return SimulatedRobot(robot, parse(text, robot.anatomy), drawn(robot, level, seed=1))


def left_alone(
    physical: SimulatedRobot, seconds: float
) -> tuple[mujoco.MjModel, mujoco.MjData, list[np.ndarray]]:
    """Lets a physical robot stand with its motors at 0, and returns where its debris went."""
    model = physical._variant.model
    data = mujoco.MjData(model)
    seen: list[np.ndarray] = []
    pieces = [b for b in range(model.nbody) if model.body(b).name.startswith(DEBRIS_PREFIX)]
    place_debris(model, data, physical._limbs)
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        seen.append(data.xipos[pieces].copy())
    return model, data, seen


@pytest.mark.parametrize(("name", "joint"), JOINTS)
def test_a_lost_limb_falls_where_it_was_and_comes_to_rest_on_the_ground(name: str, joint: str):
    robot = ROBOTS[name].robot()
    lost = robot.anatomy.joint(joint).bodies
    model, data, seen = left_alone(broken(robot, f"break:{joint}"), 3.0)
    nominal = mujoco.MjData(robot.model)
    mujoco.mj_forward(robot.model, nominal)
    order = [
        model.body(b).name.removeprefix(DEBRIS_PREFIX)
        for b in range(model.nbody)
        if model.body(b).name.startswith(DEBRIS_PREFIX)
    ]

    assert set(order) == lost
    began = np.array([nominal.body(body).xipos for body in order])
    # After the first physics step of the fall.
    np.testing.assert_allclose(seen[0], began, atol=2e-3)
    assert np.linalg.norm(seen[-1][:, :2] - began[:, :2], axis=1).max() < 0.5
    assert seen[-1][:, 2].max() < 0.25
    assert seen[-1][:, 2].min() > 0
    # In the first fifth of a second, nothing is faster than by free fall and a little.
    path = np.array(seen[: round(0.2 / model.opt.timestep)])
    speeds = np.linalg.norm(np.diff(path, axis=0), axis=2) / model.opt.timestep
    assert speeds.max() < 9.81 * 0.2 + 0.5, "nothing is thrown"
    speed = np.linalg.norm(seen[-1] - seen[-11], axis=1).max() / (10 * model.opt.timestep)
    assert speed < 0.1
    touching = {
        frozenset(model.body(model.geom_bodyid[g]).name for g in pair) for pair in data.contact.geom
    }
    assert any("world" in pair and (pair & {DEBRIS_PREFIX + b for b in lost}) for pair in touching)


@pytest.mark.parametrize("name", sorted(ROBOTS))
def test_debris_stands_behind_all_that_is_the_robots(name: str):
    robot = ROBOTS[name].robot()
    joints = [joint.name for joint in robot.anatomy.joints if len(joint.bodies) > 1][:2]
    text = "+".join(f"break:{joint}" for joint in joints)
    model = broken(robot, text)._variant.model

    own, whole = mujoco.MjData(robot.model), mujoco.MjData(model)
    for field in ("qpos", "qvel", "ctrl", "qfrc_actuator"):
        values = getattr(own, field)
        values[:] = np.linspace(0.1, 0.9, len(values))
        getattr(whole, field)[: len(values)] = values
    for signal, value in signal_fields(robot).items():
        found = current_value(signal_fields(robot, model)[signal], whole)
        np.testing.assert_array_equal(found, current_value(value, own), signal)
    assert (model.nu, model.nsensor) == (robot.model.nu, robot.model.nsensor)
    for b in range(robot.model.nbody):
        assert model.body(b).name == robot.model.body(b).name
    added = [model.body(b).name for b in range(robot.model.nbody, model.nbody)]
    assert len(added) == 4
    assert all(body.startswith(DEBRIS_PREFIX) for body in added)


def test_debris_is_as_heavy_as_the_limb_was_and_collides_with_the_ground_and_the_robot(
    quadruped: Robot,
):
    gap = drawn(quadruped, LEVEL, seed=1)
    model = broken(quadruped, "break:front_left_shoulder")._variant.model
    for body in ("front_left_upper", "front_left_lower"):
        np.testing.assert_allclose(
            model.body(DEBRIS_PREFIX + body).mass, quadruped.model.body(body).mass * gap.mass[body]
        )
        assert model.body(body).mass == 0
    debris = model.geom(DEBRIS_PREFIX + "front_left_lower")
    for other in ("ground", "torso", "back_left_lower"):
        geom = model.geom(other)
        assert debris.contype & geom.conaffinity or geom.contype & debris.conaffinity
    data = mujoco.MjData(model)
    data.joint(DEBRIS_PREFIX + "front_left_upper").qpos[:3] = [0, 0, 0.5]
    mujoco.mj_step(model, data, 80)  # by then it would have fallen 0.78 m
    assert data.body(DEBRIS_PREFIX + "front_left_upper").xpos[2] > data.body("torso").xpos[2]
    ghost = model.geom("front_left_lower")
    assert not ghost.contype
    assert not ghost.conaffinity


def test_there_is_debris_only_where_a_limb_fell_off_across_a_gap(quadruped: Robot):
    for text, level in [
        ("break:front_left_knee", 0.0),
        ("jam:front_left_knee", LEVEL),
        ("sensor:front_left_touch", LEVEL),
        ("intact", LEVEL),
    ]:
        model = broken(quadruped, text, level)._variant.model
        assert model.nbody == quadruped.model.nbody


def test_in_a_trial_debris_starts_where_the_limb_is_however_the_robot_stands(
    quadruped: Robot, monkeypatch: pytest.MonkeyPatch
):
    starts = []

    def watched(model: mujoco.MjModel, data: mujoco.MjData, limbs: tuple[str, ...]) -> None:
        place_debris(model, data, limbs)
        starts.append(data)

    monkeypatch.setattr("selfmodel.physical.simulated.place_debris", watched)
    physical = broken(quadruped, "break:front_left_shoulder", 0.3)
    (controller,) = random_controllers(quadruped, 1)
    next(iter(physical.run(controller, 3)))
    mujoco.mj_forward(physical._variant.model, starts[-1])
    for body in ("front_left_upper", "front_left_lower"):
        lost, left = starts[-1].body(DEBRIS_PREFIX + body), starts[-1].body(body)
        np.testing.assert_allclose(lost.xpos, left.xpos, atol=1e-9)
        np.testing.assert_allclose(lost.xmat, left.xmat, atol=1e-9)
    assert starts[-1].joint("front_left_knee").qpos[0] != 0


@pytest.mark.search
def test_a_recovery_across_a_gap_is_of_one_robot_whose_trials_all_differ(tmp_path: Path):
    told = printed(
        "recover",
        "quadruped",
        "--damage",
        "intact",
        *SMALL,
        "--steps",
        "40",
        "--trials",
        "1",
        "--no-calibrate",
        "--comparator",
        "forward-displacement",
        "--kinds",
        "paper",
        "--gap",
        "0.1",
        "--out",
        "run",
        "--json",
        cwd=tmp_path,
    )
    paths = [tmp_path / trial["log"] for trial in told["trials"]]
    hidden = [read_gap(path) for path in paths]

    assert told["gap"] == 0.1
    assert len(paths) == 3
    assert hidden[0] == hidden[1] == hidden[2]
    assert hidden[0]["level"] == 0.1
    starts = {read_log(path).trial.trajectory["joint_positions"][0].tobytes() for path in paths}
    assert len(starts) == 3
