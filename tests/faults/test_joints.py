"""Tests of damped joints, dry friction, encoders with an offset, and feet without grip."""

import copy

import mujoco
import numpy as np
import pytest

from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.joints import ENCODER_OFFSET, ENCODER_SLIP
from selfmodel.faults.notation import parse
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import Trajectory, collect
from tests.faults.test_build import assert_same_paths, built, follow
from tests.faults.test_registry import BARE
from tests.faults.test_world import STATES, STEPS, playback, segments_of
from tests.helpers.drivers import random_controllers, random_motion


def with_motor(attributes: str) -> Robot:
    """A robot of one leg with a torque motor, without damping."""
    motor = f'<motor name="hip" {attributes} joint="hip"'
    return Robot("torque", BARE.replace('<position name="hip" joint="hip" kp="50"', motor), 0.02)


UNDAMPED = with_motor("")


def test_a_damped_joint_moves_more_slowly_and_the_others_have_their_damping(robot: Robot):
    joint = robot.anatomy.joints[0]
    damped = built(robot, f"damping:{joint.name}=30")
    dofs = [robot.model.joint(hinge).dofadr[0] for hinge in joint.hinges]

    assert damped.dof_damping[dofs] == pytest.approx(30 * robot.model.dof_damping[dofs])
    others = np.setdiff1d(np.arange(robot.model.nv), dofs)
    np.testing.assert_array_equal(damped.dof_damping[others], robot.model.dof_damping[others])
    ways = [
        np.abs(np.diff(follow(robot, model, 100)[joint.hinges[0]])).sum()
        for model in (damped, robot.model)
    ]
    assert ways[0] < 0.7 * ways[1]


def test_a_joint_without_damping_in_the_model_is_damped_relative_to_its_inertia():
    damped = built(UNDAMPED, "damping:hip=4")

    assert damped.dof_damping[-1] == pytest.approx(3 * UNDAMPED.model.dof_M0[-1])
    assert str(parse("damping:hip=1", UNDAMPED.anatomy)) == "intact"


@pytest.mark.parametrize(
    ("leg", "jams"),
    [
        ("leg:front_left=locked", "jam:front_left_shoulder+jam:front_left_knee"),
        (
            "leg:front_left=locked0.2/-0.3",
            "jam:front_left_shoulder=0.2+jam:front_left_knee=-0.3",
        ),
    ],
)
def test_a_locked_leg_is_the_jams_of_all_its_joints_as_one_fault(
    quadruped: Robot, leg: str, jams: str
):
    locked, jammed = (parse(text, quadruped.anatomy) for text in (leg, jams))
    assert [len(locked), len(jammed)] == [1, 2]
    controller = random_controllers(quadruped, 1)[0]
    runs = [(locked, controller), (jammed, controller)]
    moved = Simulator(quadruped, 1).run(runs, 40, SIGNALS).trajectory
    for signal in SIGNALS:
        np.testing.assert_array_equal(*moved[signal], err_msg=signal)


def test_a_damped_joint_is_damped_more_at_its_velocity_limit_too():
    limited = BARE.replace('name="hip" axis', 'name="hip" damping="0 0.3" axis')
    assert limited != BARE
    damped = built(Robot("limited", limited, 0.02), "damping:hip=4")

    assert damped.dof_dampingpoly[-1].tolist() == pytest.approx([1.2, 0])
    assert damped.dof_damping[-1] > 0


def test_joint_friction_is_that_part_of_the_largest_torque_of_one_joint(quadruped: Robot):
    stiff = built(quadruped, "joint-friction:front_left_knee=0.25")

    friction = np.zeros(quadruped.model.nv)
    friction[quadruped.model.joint("front_left_knee").dofadr[0]] = 0.25 * 12
    assert stiff.dof_frictionloss == pytest.approx(friction)


def test_a_joint_moves_only_above_its_friction(quadruped: Robot):
    # At 0.03 rad the servo has 1.8 N m, at 0.3 rad its limit of 12 N m; the friction is 3 N m.
    stiff, angles = built(quadruped, "joint-friction:front_left_knee=0.25"), {}
    for target in (0.03, 0.3):
        for name, model in (("stiff", stiff), ("healthy", copy.copy(quadruped.model))):
            model.opt.gravity[:] = 0.0
            data = mujoco.MjData(model)
            data.actuator("front_left_knee").ctrl = target
            mujoco.mj_step(model, data, 40)
            angles[name, target] = float(data.joint("front_left_knee").qpos[0])

    # MuJoCo's dry friction creeps.
    assert angles["stiff", 0.03] < 0.6 * angles["healthy", 0.03]
    assert angles["stiff", 0.3] > 0.7 * angles["healthy", 0.3]


def test_the_gain_of_a_servo_holds_less_at_the_same_error_and_as_much_at_most(quadruped: Robot):
    # The knee has 60 N m/rad up to 12 N m.
    forces = {}
    for fault in ("servo-gain", "motor"):
        data = mujoco.MjData(model := built(quadruped, f"{fault}:front_left_knee=0.5"))
        for error in (0.1, 0.6):
            data.actuator("front_left_knee").ctrl = error
            mujoco.mj_forward(model, data)
            forces[fault, error] = float(data.actuator("front_left_knee").force[0])

    assert forces == pytest.approx(
        {
            ("servo-gain", 0.1): 3.0,
            ("servo-gain", 0.6): 12.0,
            ("motor", 0.1): 3.0,
            ("motor", 0.6): 6.0,
        }
    )


def test_a_motor_that_is_off_takes_its_share_of_the_resistance_of_its_own_joint(quadruped: Robot):
    def perturb(model: mujoco.MjModel) -> mujoco.MjModel:
        model = copy.copy(model)
        model.dof_frictionloss[6:], model.actuator_damping[:] = 0.2, 0.1
        return model

    joint, motor = "front_left_knee", quadruped.anatomy.motors.index("front_left_knee")
    before = perturb(quadruped.model)
    space = quadruped.anatomy
    off = build(quadruped, parse(f"motor:{joint}=off0.1", space), perturb=perturb).model
    weak = build(quadruped, parse(f"motor:{joint}=0.5", space), perturb=perturb).model

    for model, share, torque in ((off, 0.1, 0.0), (weak, 1.0, 0.5)):
        resistance, strength = np.ones(model.nv), np.ones(model.nu)
        resistance[model.joint(joint).dofadr[0]], strength[motor] = share, torque
        for name in ("damping", "frictionloss"):
            assert getattr(model, f"dof_{name}") == pytest.approx(
                resistance * getattr(before, f"dof_{name}")
            )
        for name in ("damping", "gainprm", "biasprm", "forcerange"):
            scaled = strength * getattr(before, f"actuator_{name}").T
            assert pytest.approx(scaled) == getattr(model, f"actuator_{name}").T
    assert str(parse(f"motor:{joint}=off1", space)) == f"motor:{joint}=0.0"


def test_the_largest_torque_of_a_motor_without_a_limit_is_that_of_its_largest_command():
    mjcf = with_motor('gear="-3"').mjcf.replace("-1 1", "-0.5 2")
    robot = Robot("geared", mjcf, 0.02)

    assert built(robot, "joint-friction:hip=0.1").dof_frictionloss[-1] == pytest.approx(0.6)


FOOT = "front_left_knee"


def contacts(model: mujoco.MjModel) -> dict[str, mujoco.MjData]:
    """The parameters of the contact of each geom with the ground, in the initial pose, lowered."""
    data = mujoco.MjData(model)
    data.qpos[2] -= 0.02
    mujoco.mj_forward(model, data)
    assert data.ncon == 4
    return {
        model.geom(int(contact.geom[1])).name: (
            contact.friction.copy(),
            contact.solref.copy(),
            contact.solimp.copy(),
            contact.dim,
        )
        for contact in data.contact
    }


def test_one_foot_has_a_fraction_of_its_friction_and_nothing_else_changes(quadruped: Robot):
    slippery, nominal = contacts(built(quadruped, f"grip:{FOOT}=0.2")), contacts(quadruped.model)

    for geom, (friction, solref, solimp, dim) in nominal.items():
        factor = 0.2 if geom == "front_left_lower" else 1.0
        np.testing.assert_allclose(slippery[geom][0][:2], factor * friction[:2])
        np.testing.assert_array_equal(slippery[geom][0][2:], friction[2:])
        np.testing.assert_array_equal(slippery[geom][1], solref)
        np.testing.assert_allclose(slippery[geom][2], solimp)
        assert slippery[geom][3] == dim


def test_only_the_foot_without_grip_slides(quadruped: Robot):
    model = built(quadruped, f"grip:{FOOT}=0.01")
    model.opt.gravity[:] = [1.5, 0.0, -9.81]  # friction above 0.15 holds the robot
    paths = [follow(quadruped, each, 100)[quadruped.root] for each in (model, quadruped.model)]
    assert np.abs(paths[0][-1, :2] - paths[1][-1, :2]).max() > 1e-3

    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 100)  # settled
    feet = [data.site(f"{leg}_foot") for leg in ("front_left", "front_right", "back_left")]
    before = [foot.xpos.copy() for foot in feet]
    data.actuator(FOOT).ctrl = 0.3
    mujoco.mj_step(model, data, 200)
    slid = [np.linalg.norm((foot.xpos - old)[:2]) for foot, old in zip(feet, before, strict=True)]
    assert slid[0] > 3 * max(slid[1:])


def test_the_contact_parameters_are_those_of_the_mixed_geoms():
    mjcf = """<mujoco><worldbody>
      <geom name="ground" type="plane" size="0 0 1" solref="0.04 1" solmix="3" friction="0.4 0.1"
        solimp="0.8 0.9 0.01" condim="1"/>
      <body name="ball" pos="0 0 0.15"><freejoint/><geom name="trunk" size="0.05"/>
        <body name="leg"><joint name="hip" axis="0 1 0" range="-60 60"/>
          <geom name="foot" pos="0 0 -0.1" size="0.06" condim="4"/></body></body></worldbody>
      <actuator><position name="hip" joint="hip" ctrlrange="-1 1"/></actuator></mujoco>"""
    robot = Robot("ball", mjcf, 0.002)
    found = []
    for model in (robot.model, built(robot, "grip:hip=0.5")):
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        (contact,) = data.contact
        found.append((contact.solimp.copy(), contact.friction.copy()))
        assert contact.dim == 4
        np.testing.assert_allclose(contact.solref, [0.035, 1])
    (nominal_solimp, nominal_friction), (solimp, friction) = found
    np.testing.assert_allclose(solimp, nominal_solimp)
    np.testing.assert_allclose(friction[:2], 0.5 * nominal_friction[:2])
    np.testing.assert_array_equal(friction[2:], nominal_friction[2:])


OFFSET = 0.1
JOINT = "front_left_shoulder"


def simulated(robot: Robot, texts: list[str]) -> Trajectory:
    """The trajectories of hypotheses under given commands."""
    runs = [(parse(text, robot.anatomy), playback(robot)) for text in texts]
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
    segments = segments_of(logged, starts)
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
    physical = SimulatedRobot(quadruped, parse(text, quadruped.anatomy))
    logged = collect(quadruped.anatomy.names, physical.run(playback(quadruped), STEPS))

    for signal in SIGNALS:
        np.testing.assert_array_equal(logged[signal], run[signal][0])


def lowered(robot: Robot, steps: int) -> np.ndarray:
    """Motor targets of which that of the joint is lower by the offset."""
    (motor,) = robot.anatomy.joint(JOINT).motors
    return random_motion(robot, steps) - OFFSET * (np.array(robot.anatomy.motors) == motor)


def test_a_robot_with_a_slip_moves_as_under_commands_that_are_lower_by_it(quadruped: Robot):
    slip = built(quadruped, f"encoder-offset:{JOINT}=slip{OFFSET}")
    expected = follow(quadruped, quadruped.model, STEPS, lowered)

    assert_same_paths(follow(quadruped, slip, STEPS), expected, 1e-9)
    nominal = follow(quadruped, quadruped.model, STEPS)
    assert np.abs(expected[JOINT] - nominal[JOINT]).max() > 0.05


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
    assert ENCODER_OFFSET.parts(UNDAMPED.anatomy) == ("hip",)
    assert ENCODER_SLIP.parts(UNDAMPED.anatomy) == ()
