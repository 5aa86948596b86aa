"""The robots in PyBullet: bodies, damage, servos, noise, trials, recoveries and recordings."""

import json
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import mujoco
import numpy as np
import pytest

pytest.importorskip("pybullet", reason="PyBullet is in the dependency group other-engine")

import pybullet

import selfmodel
from benchmarks.foreign.cases import Fault, Faults
from benchmarks.foreign.motion import Motion
from benchmarks.other_engine import recordings
from benchmarks.other_engine.bullet import Bullet
from benchmarks.other_engine.environment import BulletEnvironment, Servos, physical_robot
from benchmarks.other_engine.reality import Damage, Reality, damage_of, draw_reality, ideal_reality
from benchmarks.other_engine.recovery import recovered, table, transfer_lines
from selfmodel.controllers.playback import Playback
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.tasks import ROBOTS
from selfmodel.trials.trajectory import Trajectory, collect
from tests.helpers.drivers import random_controllers

CASES = [(name, case) for name in ROBOTS for case in range(1, 10, 3)]


def walked(
    robot: Robot, reality: Reality, damage: Damage, steps: int = 60, stream: int = 0
) -> Trajectory:
    with BulletEnvironment(robot, reality, damage, stream) as environment:
        (gait,) = random_controllers(robot, 1)
        samples = physical_robot(environment, robot).run(gait, steps)
        return collect(robot.anatomy.names, samples)


@pytest.fixture
def bullet() -> Iterator[Callable[..., Bullet]]:
    """Makes robots in PyBullet, and ends their clients."""
    made = []

    def make(robot: Robot, damage: Damage | None = None) -> Bullet:
        made.append(Bullet(robot, ideal_reality(robot), damage or Damage()))
        return made[-1]

    yield make
    for one in made:
        one.close()


def test_bodies_are_where_mujoco_has_them_in_random_poses(
    robot: Robot, bullet: Callable[..., Bullet]
):
    model, data = robot.model, mujoco.MjData(robot.model)
    rng, body = np.random.default_rng(0), bullet(robot)
    for _ in range(5):
        data.qpos[:7] = rng.normal(size=7)
        data.qpos[7:] = rng.uniform(-0.5, 0.5, model.nq - 7)
        mujoco.mj_normalizeQuat(model, data.qpos)
        mujoco.mj_kinematics(model, data)

        angles = np.array([data.joint(name).qpos[0] for name in robot.anatomy.hinges])
        body.place(data.qpos[:3], data.qpos[3:7], angles)

        np.testing.assert_allclose(body.base()[0], data.body(robot.root).xpos, atol=1e-6)
        np.testing.assert_allclose(
            body.base()[1].as_matrix().ravel(), data.body(robot.root).xmat, atol=1e-6
        )
        positions = body.positions()
        names = [model.body(number).name for number in range(2, model.nbody)]
        for name in names:
            np.testing.assert_allclose(positions[name], data.body(name).xpos, atol=1e-6)


def test_a_broken_joint_removes_its_links_and_their_mass(
    robot: Robot, bullet: Callable[..., Bullet]
):
    joint = robot.anatomy.joints[0]
    left = bullet(robot, damage_of(f"break:{joint.name}", robot.anatomy))

    lost = sum(robot.model.body(name).mass[0] for name in joint.bodies)
    assert left.mass() == pytest.approx(robot.model.body_mass.sum() - lost, rel=1e-6)
    assert not joint.bodies & left.positions().keys()
    assert set(left.positions()) >= {
        other.name for other in map(robot.model.body, range(2, robot.model.nbody))
    } - set(joint.bodies)


def test_a_jammed_joint_is_a_fixed_joint_at_its_angle(robot: Robot, bullet: Callable[..., Bullet]):
    joint, angle = robot.anatomy.joints[0], 0.3
    fixed = bullet(robot, Damage(fixed=dict.fromkeys(joint.hinges, angle)))
    data = mujoco.MjData(robot.model)
    for hinge in joint.hinges:
        data.joint(hinge).qpos[0] = angle
    mujoco.mj_kinematics(robot.model, data)
    torques = np.zeros(len(robot.anatomy.hinges))
    torques[robot.anatomy.hinges.index(joint.hinges[0])] = 5.0

    before = fixed.positions()
    fixed.step(torques)

    for name in joint.bodies:
        np.testing.assert_allclose(before[name], data.body(name).xpos, atol=1e-6)
    assert fixed.hinges()[0][robot.anatomy.hinges.index(joint.hinges[0])] == angle
    assert np.abs(fixed.base()[3]).max() < 0.05  # gravity alone moves it


@pytest.mark.parametrize(("name", "case"), CASES)
def test_every_case_of_table_one_is_a_damage_under_which_a_walk_stays_finite(name: str, case: int):
    robot = ROBOTS[name].robot()
    damage = damage_of(ROBOTS[name].cases[case], robot.anatomy)

    trajectory = walked(robot, draw_reality(robot, 3), damage, steps=30)

    for signal, values in trajectory.signals.items():
        assert np.isfinite(values).all() or signal == "joint_efforts"
    for sensor in damage.dead:
        assert not trajectory["sensors"][:, trajectory.names.sensors.index(sensor)].any()


def test_the_encoder_of_an_absent_joint_holds_its_last_value(quadruped: Robot):
    damage = damage_of("break:front_left_shoulder", quadruped.anatomy)

    trajectory = walked(quadruped, draw_reality(quadruped, 0), damage)

    held = [quadruped.anatomy.hinges.index(name) for name in sorted(damage.lost)]
    reading = trajectory.names.sensors.index("front_left_angle")
    assert len(held) == 2
    assert not np.ptp(trajectory["joint_positions"][:, held], axis=0).any()
    assert not np.ptp(trajectory["sensors"][:, reading])
    others = np.delete(trajectory["joint_positions"], held, axis=1)
    assert np.ptp(others, axis=0).min() > 0.01


def test_observations_and_steps_keep_to_the_specs_of_the_environment(robot: Robot):
    with BulletEnvironment(robot, draw_reality(robot, 0)) as environment:
        actions, specs = environment.action_spec(), environment.observation_spec()
        steps = [environment.step(actions.generate_value()) for _ in range(3)]

    assert steps[0].first()  # a step before a reset is a reset
    assert steps[1].mid()
    assert steps[2].mid()
    for step in steps:
        assert step.observation.keys() == specs.keys()
        for name, spec in specs.items():
            spec.validate(step.observation[name])


def test_a_robot_stands_for_a_second_at_the_height_that_it_has_in_mujoco(robot: Robot):
    data = mujoco.MjData(robot.model)
    with BulletEnvironment(robot, ideal_reality(robot)) as environment:
        environment.reset()
        for _ in range(100):
            found = environment.step(np.zeros(robot.model.nu)).observation
            mujoco.mj_step(robot.model, data, robot.substeps)

    assert found["base_position"][2] == pytest.approx(data.qpos[2], abs=0.005)
    assert abs(found["base_orientation"][0]) > 0.999
    touches = [sensor.kind == "touch" for sensor in robot.anatomy.sensors]
    assert found["sensors"][touches].all()
    assert found["time"] == pytest.approx(1.0)


def test_a_servo_in_the_air_follows_a_target_as_it_does_in_mujoco(
    robot: Robot, bullet: Callable[..., Bullet]
):
    body, hinges = bullet(robot), robot.anatomy.hinges
    model = robot.specification().compile()
    model.opt.gravity[:] = 0
    data = mujoco.MjData(model)
    servos = Servos(robot, ideal_reality(robot), np.zeros(len(hinges)))
    data.qpos[2] = 2.0
    pybullet.setGravity(0, 0, 0, physicsClientId=body.client)
    body.place(data.qpos[:3], data.qpos[3:7], np.zeros(len(hinges)))
    driven = [model.joint(joint).name for joint in model.actuator_trnid[:, 0]]
    motor, found, expected = driven.index(hinges[0]), [], []
    for substep in range(500):
        targets = np.zeros(model.nu)
        targets[motor] = 0.4 * np.sin(4 * np.pi * 0.001 * substep)
        if substep % 5 == 0:
            data.ctrl[:] = targets
            found.append(body.hinges()[0][0])
            expected.append(data.joint(hinges[0]).qpos[0])
            mujoco.mj_step(model, data)
        body.step(servos.step(targets, *body.hinges()))

    assert np.ptp(expected) > 0.5
    np.testing.assert_allclose(found, expected, atol=0.02)


def tripod_walk(robot: Robot, first: tuple[str, ...], steps: int) -> Playback:
    """An open-loop walk of the hexapod: three legs swing forward while the others push."""
    motors, time = robot.anatomy.motors, 0.01 * np.arange(steps)
    commands = np.zeros((steps, len(motors)))
    for column, motor in enumerate(motors):
        phase = 3 * np.pi * time + np.pi * (not motor.startswith(first))
        if motor.endswith("swing"):
            commands[:, column] = 0.4 * np.sin(phase)
        elif motor.endswith("lift"):
            commands[:, column] = 0.3 * np.maximum(0, np.cos(phase))
    return Playback(motors, commands)


@pytest.mark.search
def test_an_open_loop_walk_goes_as_far_as_in_mujoco_and_its_mirror_image_mirrors():
    robot = ROBOTS["hexapod"].robot()
    legs = ("front_left", "middle_right", "back_left"), ("front_right", "middle_left", "back_right")
    ways = []
    for first in legs:
        with BulletEnvironment(robot, ideal_reality(robot)) as environment:
            samples = physical_robot(environment, robot).run(tripod_walk(robot, first, 200), 200)
            ways.append(collect(robot.anatomy.names, samples)["base_position"])
    reference = SimulatedRobot(robot).run(tripod_walk(robot, legs[0], 200), 200)

    expected = collect(robot.anatomy.names, reference)["base_position"]
    assert expected[-1, 0] > 0.8
    assert ways[0][-1, 0] == pytest.approx(expected[-1, 0], rel=0.05)
    np.testing.assert_allclose(ways[0][-1], ways[1][-1] * [1, -1, 1], atol=0.005)


def test_equal_seeds_walk_alike_to_the_bit_and_other_seeds_do_not(robot: Robot):
    first, second, other = (
        walked(robot, draw_reality(robot, seed), Damage(), steps=30)["base_position"]
        for seed in (0, 0, 1)
    )

    np.testing.assert_array_equal(first, second)
    assert not np.array_equal(first, other)


BANK = Path(__file__).parents[2] / "benchmarks" / "bank"


@pytest.mark.search
@pytest.mark.usefixtures("coarse_calibration")
def test_a_recovery_is_a_row_of_the_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    small = partial(selfmodel.recover, kinds="break", repair="paper")
    monkeypatch.setattr(selfmodel, "recover", small)
    settings = Settings(steps=60, trials=1, generations=1).scaled(4)

    row = recovered("quadruped", 1, 0, tmp_path / "run", settings=settings, threads=1)

    row = json.loads(json.dumps(row))
    assert row["truth"] == "break:front_left_knee"
    assert [trial["stage"] for trial in row["trials"]] == ["before", "after", "recovery"]
    assert row["reality"]["masses"] == list(draw_reality(ROBOTS["quadruped"].robot(), 0).masses)
    simulated = [trial["simulated"] for trial in row["trials"]]
    assert simulated[1] is None
    assert np.isfinite([simulated[0], simulated[2]]).all()
    assert row["recovered"] == row["trials"][2]["displacement"]


@pytest.mark.search
def test_gaits_of_both_engines_are_a_table(quadruped: Robot):
    lines = list(transfer_lines(quadruped, [BANK / "quadruped-2.npz"], [0], steps=250))

    name, mujoco_walk, ideal, drawn = lines[2].strip("| ").split(" | ")
    assert name == "quadruped-2"
    walked = [float(each.split(" (")[0]) for each in (ideal, drawn)]
    assert 0.5 * float(mujoco_walk) < min(walked)


def row(*, before: float, recovered: float, correct: bool) -> dict[str, object]:
    trial = {"stage": "recovery", "displacement": recovered, "simulated": 4.0, "upright": True}
    found = {"robot": "quadruped", "case": 2, "seconds": 1.0, "after": 0.0, "trials": [trial]}
    return {**found, "before": before, "recovered": recovered, "correct": correct}


def test_the_table_counts_an_error_as_a_wrong_diagnosis_and_no_recovery():
    failed = {"robot": "quadruped", "case": 2, "seconds": 1.0, "error": "the robot stopped"}
    rows = [
        row(before=4.0, recovered=2.0, correct=True),
        row(before=-1.0, recovered=3.0, correct=False),
        failed,
    ]

    line = table(rows).splitlines()[2]

    assert "| 3 | 1/3, 33 % (6 to 79) |" in line
    assert "| 0.25 (0 to 0.5) |" in line  # no ratio to a robot that went backwards
    assert "| 2/3, 67 %" in line


A1 = recordings.a1()
CALF = "FR_lower_joint"
HINGE = A1.hinges.index(CALF)


def standing(*faults: Fault) -> Motion:
    stance = np.tile([0.0, 0.9, -1.8], 4)
    reality = recordings.Reality(masses={}, torques=np.ones(12), friction=0.8, delay=5)
    return recordings.simulated(A1, reality, faults, lambda *_: stance, 0.1)


def test_the_healthy_robot_stands_near_its_stance():
    motion = standing()
    assert motion.is_upright()
    np.testing.assert_allclose(motion.angles[-1], np.tile([0.0, 0.9, -1.8], 4), atol=0.1)


@pytest.mark.parametrize(
    ("fault", "angle"),
    [(Fault("jam", CALF, -1.5), -1.5), (Fault("lost", CALF), np.nan)],
    ids=["locked", "lost"],
)
def test_a_locked_joint_has_its_angle_and_a_lost_one_none(fault: Fault, angle: float):
    np.testing.assert_array_equal(standing(fault).angles[:, HINGE], angle)


def test_a_weak_motor_yields_to_the_load():
    weak: Faults = (Fault("motor", CALF, 0.4),)
    assert standing(*weak).angles[-1, HINGE] < standing().angles[-1, HINGE] - 0.02
