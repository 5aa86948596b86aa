"""Tests of encoders with an offset: beside the servo's measurement, and in its place."""

import mujoco
import numpy as np
import pytest

from selfmodel.controllers.playback import Playback
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.joints import ENCODER_OFFSET, ENCODER_SLIP
from selfmodel.faults.notation import parse
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.simulation.requests import cut_segments
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import Trajectory, collect
from tests.faults.test_registry import BARE
from tests.helpers.drivers import random_motion

STEPS = 60
OFFSET = 0.1
JOINT = "front_left_shoulder"
STATES = tuple(
    signal for signal in SIGNALS if signal not in ("sensors", "commands", "joint_efforts")
)


def simulated(robot: Robot, texts: list[str]) -> Trajectory:
    """The trajectories of hypotheses under given commands."""
    driver = Playback(robot.anatomy.motors, random_motion(robot, STEPS))
    runs = [(parse(text, robot.anatomy), driver) for text in texts]
    return Simulator(robot, 1).run(runs, STEPS, SIGNALS).trajectory


def shift(robot: Robot) -> np.ndarray:
    return OFFSET * (np.array(robot.anatomy.hinges) == JOINT)


def test_an_offset_shifts_the_encoder_and_its_sensor_and_nothing_else(quadruped: Robot):
    run = simulated(quadruped, ["intact", f"encoder-offset:{JOINT}={OFFSET}"])
    sensor = [each.hinge for each in quadruped.anatomy.sensors].index(JOINT)
    reading = OFFSET / quadruped.anatomy.sensors[sensor].half_range

    np.testing.assert_array_equal(
        run["joint_positions"][1], run["joint_positions"][0] + shift(quadruped)
    )
    readings = run["sensors"][1] - run["sensors"][0]
    np.testing.assert_allclose(readings[:, sensor], reading, atol=1e-12)
    np.testing.assert_array_equal(np.delete(readings, sensor, axis=1), 0)
    for signal in set(SIGNALS) - {"joint_positions", "sensors"}:
        np.testing.assert_array_equal(run[signal][1], run[signal][0])


@pytest.mark.parametrize("prefix", ["", "slip"])
def test_a_prediction_begins_at_the_true_angle(quadruped: Robot, prefix: str):
    text = f"encoder-offset:{JOINT}={prefix}{OFFSET}"
    run = simulated(quadruped, [text])
    logged = run.run(0)
    starts = np.array([0, 20, 40])
    segments = cut_segments(logged, {s: logged[s] for s in STATES}, starts, 10, STATES)
    hypotheses = [INTACT, parse(text, quadruped.anatomy)]
    predicted = Simulator(quadruped, 1).predict(hypotheses, segments).trajectory

    for signal in STATES:
        expected = np.stack([logged[signal][start : start + 11] for start in starts])
        np.testing.assert_allclose(predicted[signal][1], expected, atol=1e-5, err_msg=signal)
    wrong = predicted["base_position"][0, :, -1] - predicted["base_position"][1, :, -1]
    assert np.abs(wrong).max() > 1e-4


@pytest.mark.parametrize("prefix", ["", "slip"])
@pytest.mark.parametrize("other", ["", f"+jam:{JOINT}=0.2", "+sensor:front_left_angle"])
def test_a_physical_robot_logs_what_a_simulation_logs(quadruped: Robot, other: str, prefix: str):
    text = f"encoder-offset:{JOINT}={prefix}{OFFSET}{other}"
    run = simulated(quadruped, [text])
    driver = Playback(quadruped.anatomy.motors, random_motion(quadruped, STEPS))
    physical = SimulatedRobot(quadruped, parse(text, quadruped.anatomy)).run(driver, STEPS)
    logged = collect(quadruped.anatomy.names, physical)

    for signal in SIGNALS:
        np.testing.assert_array_equal(logged[signal], run[signal][0])


def motion(robot: Robot, model: mujoco.MjModel, targets: np.ndarray) -> np.ndarray:
    """The generalized positions under motor targets, by MuJoCo alone, ``(steps + 1, nq)``."""
    data = mujoco.MjData(model)
    rows = [data.qpos.copy()]
    for target in targets:
        data.ctrl[:] = target
        mujoco.mj_step(model, data, round(robot.control_timestep / model.opt.timestep))
        rows.append(data.qpos.copy())
    return np.array(rows)


def lowered(robot: Robot, targets: np.ndarray) -> np.ndarray:
    """Motor targets of which that of the joint is lower by the offset."""
    (motor,) = robot.anatomy.joint(JOINT).motors
    return targets - OFFSET * (np.array(robot.anatomy.motors) == motor)


def test_a_robot_with_a_slip_moves_as_under_commands_that_are_lower_by_it(quadruped: Robot):
    slip = build(quadruped, parse(f"encoder-offset:{JOINT}=slip{OFFSET}", quadruped.anatomy))
    targets = random_motion(quadruped, STEPS)

    moved = motion(quadruped, slip.model, targets)

    expected = motion(quadruped, quadruped.model, lowered(quadruped, targets))
    np.testing.assert_allclose(moved, expected, atol=1e-9, rtol=0)
    assert np.abs(expected - motion(quadruped, quadruped.model, targets)).max() > 0.05


@pytest.mark.parametrize("other", [f"motor:{JOINT}=0.4", f"motor:{JOINT}=0", f"jam:{JOINT}=0.2"])
def test_a_weak_or_jammed_motor_and_a_slip_have_one_model_in_both_orders(
    quadruped: Robot, other: str
):
    slip, fault = (
        parse(text, quadruped.anatomy).faults[0]
        for text in (f"encoder-offset:{JOINT}=slip{OFFSET}", other)
    )

    built = [
        build(quadruped, Hypothesis(faults)).model for faults in ((slip, fault), (fault, slip))
    ]

    first, second = (model.actuator_biasprm for model in built)
    np.testing.assert_allclose(first, second, atol=1e-12)
    (motor,) = quadruped.anatomy.joint(JOINT).motors
    share = 0.4 if "0.4" in other else 0.0
    constant = first[quadruped.anatomy.motors.index(motor), 0]
    nominal = quadruped.model.actuator(motor).biasprm[1]
    assert constant == pytest.approx(share * nominal * OFFSET)


def test_a_joint_without_position_feedback_has_an_offset_only():
    robot = Robot("torque", BARE.replace("<position", "<motor").replace(' kp="50"', ""), 0.02)

    assert ENCODER_OFFSET.parts(robot.anatomy) == ("hip",)
    assert ENCODER_SLIP.parts(robot.anatomy) == ()
