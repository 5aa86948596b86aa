"""Promises of mismatches of structure: what each is, and that the log keeps its layout."""

import dataclasses
import json

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from selfmodel.faults.notation import parse
from selfmodel.physical.reality_gap import draw_gap
from selfmodel.physical.simulated_robot import SimulatedRobot
from selfmodel.physical.structural_mismatch import (
    BACKLASH_RANGE,
    BEND_RANGE,
    BENDING_TORQUE,
    FOOT_RADIUS_FACTORS,
    OUTPUT_ARMATURE,
    StructuralMismatch,
    draw_structural_mismatch,
)
from selfmodel.robot.robot import Robot
from selfmodel.tasks import ROBOTS
from selfmodel.trials.behaviour import collect
from selfmodel.trials.signals import SIGNALS
from tests.helpers.drivers import random_controllers

QUADRUPED = ROBOTS["quadruped"].robot()


def drawn(robot: Robot, seed: int = 0) -> StructuralMismatch:
    return draw_structural_mismatch(robot, np.random.default_rng(seed))


def model_of(robot: Robot, structure: StructuralMismatch) -> mujoco.MjModel:
    return SimulatedRobot(robot, structure=structure)._embodiment.model


@given(seed=st.integers(0, 2**32))
@settings(max_examples=50, deadline=None)
def test_the_same_seed_draws_the_same_structure_within_its_bounds(seed: int):
    structure = drawn(QUADRUPED, seed)

    assert structure == drawn(QUADRUPED, seed)
    assert set(structure.play) == set(QUADRUPED.anatomy.hinges)
    assert all(BACKLASH_RANGE[0] <= play <= BACKLASH_RANGE[1] for play in structure.play.values())
    assert BEND_RANGE[0] <= BENDING_TORQUE / structure.stiffness <= BEND_RANGE[1]
    assert FOOT_RADIUS_FACTORS[0] <= structure.foot_factor <= FOOT_RADIUS_FACTORS[1]
    assert structure.soft.endswith("knee")
    assert structure.foot.endswith("lower")
    assert structure.weak in QUADRUPED.anatomy.motors
    assert json.loads(json.dumps(structure.as_dict())) == structure.as_dict()


def test_every_part_is_struck_in_some_drawing():
    drawings = [drawn(QUADRUPED, seed) for seed in range(200)]

    assert {d.weak for d in drawings} == set(QUADRUPED.anatomy.motors)
    assert len({d.foot for d in drawings}) == len({d.soft for d in drawings}) == 4


def test_no_structure_is_the_nominal_robot_to_the_bit(robot: Robot):
    (controller,) = random_controllers(robot, 1)
    runs = [
        collect(robot.anatomy.names, physical.run(controller, 40))
        for physical in (SimulatedRobot(robot), SimulatedRobot(robot, structure=None))
    ]

    assert all(runs[0][s].tobytes() == runs[1][s].tobytes() for s in SIGNALS)


def test_a_motor_saturates_early_and_a_foot_has_another_size(robot: Robot):
    structure = drawn(robot, 4)
    model = model_of(robot, structure)
    for motor in robot.anatomy.motors:
        part = 0.6 if motor == structure.weak else 1.0
        expected = robot.model.actuator(motor).forcerange * part
        np.testing.assert_allclose(model.actuator(motor).forcerange, expected)
    for g in range(robot.model.ngeom):
        name = robot.model.geom(g).name
        body = robot.model.body(robot.model.geom_bodyid[g]).name
        part = structure.foot_factor if body == structure.foot else 1.0
        np.testing.assert_allclose(model.geom(name).size[0], robot.model.geom(name).size[0] * part)


def test_a_foot_of_another_size_still_feels_all_of_its_skin(robot: Robot):
    """The touch sensor's zone reaches as far beyond the foot as it did."""
    structure = dataclasses.replace(drawn(robot), foot_factor=1.4)
    model = model_of(robot, structure)

    def skin(of: mujoco.MjModel) -> float:
        body = of.body(structure.foot).id
        (geom,) = np.flatnonzero(of.geom_bodyid == body)
        (site,) = np.flatnonzero(of.site_bodyid == body)
        return float(of.site_size[site, 0] - of.geom_size[geom, 0])

    np.testing.assert_allclose(skin(model), skin(robot.model))


def test_a_foot_of_several_shapes_grows_as_one_and_so_does_what_feels_it():
    robot = Robot(
        "hopper",
        """<mujoco><option timestep="0.005"/><worldbody><geom type="plane" size="0 0 1"/>
        <body name="trunk" pos="0 0 0.5"><freejoint/><geom type="box" size="0.1 0.1 0.1"/>
          <body name="leg"><joint name="hip" axis="0 1 0" range="-60 60"/>
            <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02"/>
            <geom type="sphere" pos="0 0 -0.3" size="0.03"/>
            <site name="felt" pos="0 0 -0.3" size="0.04"/><site name="mark" size="0.01"/>
            <site name="boxed" type="box" pos="0 0 -0.15" size="0.04 0.05 0.2"/>
          </body></body></worldbody>
        <actuator><position name="hip" joint="hip" kp="50" ctrlrange="-1 1"/></actuator>
        <sensor><touch name="touch" site="felt"/><touch name="all" site="boxed"/></sensor>
        </mujoco>""",
        0.02,
    )
    model = model_of(robot, dataclasses.replace(drawn(robot), foot_factor=1.4))

    leg = model.geom_bodyid == model.body("leg").id
    np.testing.assert_allclose(model.geom_size[leg, 0], [0.028, 0.042])
    np.testing.assert_allclose(model.site("felt").size[0], 0.04 + 0.012)
    np.testing.assert_allclose(model.site("boxed").size, [0.052, 0.062, 0.212])
    np.testing.assert_allclose(model.site("mark").size[0], 0.01)


def pushed(model: mujoco.MjModel, hinge: str, added: str, torque: float) -> float:
    """Where an added hinge comes to rest under a torque, rad; the base and the hinge are held."""
    data = mujoco.MjData(model)
    model.opt.gravity[:] = 0
    model.dof_armature[:] = 1e10
    model.dof_armature[model.joint(added).dofadr[0]] = OUTPUT_ARMATURE
    model.opt.tolerance = 0
    assert hinge in added
    data.joint(added).qfrc_applied[:] = torque
    for _ in range(1000):
        mujoco.mj_step(model, data)
    return float(data.joint(added).qpos[0])


def test_play_turns_freely_to_its_limit_and_little_further(robot: Robot):
    structure = drawn(robot)
    hinge = robot.anatomy.hinges[-1]
    model = model_of(robot, structure)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    for torque in (0.01, -0.01, 1.0):
        angle = pushed(model, hinge, f"{hinge}_play", torque)
        assert np.sign(angle) == np.sign(torque)
        np.testing.assert_allclose(abs(angle), structure.play[hinge], atol=2e-3)


def test_a_soft_limb_bends_as_its_stiffness_says(robot: Robot):
    structure = drawn(robot)
    model = model_of(robot, structure)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    angle = pushed(model, structure.soft, f"{structure.soft}_bend", 5.0)

    np.testing.assert_allclose(angle, 5.0 / structure.stiffness, rtol=0.05)


@pytest.mark.parametrize("text", ["intact", "break:{joint}", "jam:{joint}=0.2"])
def test_structure_changes_a_trial_and_not_its_layout(robot: Robot, text: str):
    truth = parse(text.format(joint=robot.anatomy.joints[0].name), robot.anatomy)
    (controller,) = random_controllers(robot, 1)
    gap = draw_gap(robot, 0.1, np.random.default_rng(0))
    for reality in (None, gap):
        plain = SimulatedRobot(robot, truth, reality)
        built = SimulatedRobot(robot, truth, reality, drawn(robot))
        runs = [
            collect(robot.anatomy.names, physical.run(controller, 100))
            for physical in (plain, built)
        ]
        assert runs[0].names == runs[1].names
        assert np.abs(runs[0]["joint_positions"] - runs[1]["joint_positions"]).max() > 1e-3
        assert np.abs(runs[1]["joint_positions"]).max() < 0.9


def test_a_joint_that_is_jammed_still_has_its_play_but_its_motor_side_is_held(quadruped: Robot):
    structure = drawn(quadruped)
    truth = parse("jam:back_left_knee=0.2", quadruped.anatomy)
    (controller,) = random_controllers(quadruped, 1)
    physical = SimulatedRobot(quadruped, truth, structure=structure)
    trial = collect(quadruped.anatomy.names, physical.run(controller, 300))
    column = quadruped.anatomy.hinges.index("back_left_knee")

    np.testing.assert_allclose(trial["joint_positions"][:, column], 0.2, atol=1e-6)
