"""Promises of model factors: the model and the MJCF have them; their distributions and sets."""

import copy
import dataclasses

import mujoco
import numpy as np
import pytest

from selfmodel.robot.anatomy import CONTROL_DELAY, FITTED_CONTACTS
from selfmodel.robot.robot import Robot
from selfmodel.simulation.model_factors import (
    JOINT_FIELDS,
    LogNormal,
    Parameters,
    Weighted,
    bases,
    exact,
    factor_names,
    joint_of_motor,
    joint_values,
    kinds_of_joints,
    model_with_parameters,
    nominal,
    prior_deviations,
    with_parameters,
)
from selfmodel.tasks import ROBOTS
from tests.helpers.exactness import bits
from tests.helpers.robots.arms import arm, arm_mjcf, robot_of

FIELDS = (
    *("body_mass", "body_inertia", "body_ipos", "body_iquat", "body_subtreemass"),
    *("geom_friction", "pair_friction", "geom_solref", "pair_solref"),
    *("dof_damping", "dof_dampingpoly", "dof_invweight0", "jnt_stiffness"),
    *("actuator_gainprm", "actuator_biasprm", "actuator_forcerange", "actuator_gear"),
)

LEGS = """
<mujoco>
  <compiler {compiler}/>
  <option timestep="0.01"/>
  <default>
    <joint damping="0.3"/>
    <default class="leg"><joint damping="{damping}"/><geom friction="0.7 0.01 0.001"/></default>
  </default>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1"/>
    <body name="base" pos="0 0 1">
      <freejoint/>{inertial}<geom name="base" type="box" size=".1 .2 .05"/>
      <body {upper}>
        <joint name="hip" axis="0 1 0" range="-1 1" class="leg"/>
        <geom class="leg" type="capsule" fromto="0 0 0 .1 0 -.2" size=".02"/>
        <body {lower} pos=".1 0 -.2">
          <joint name="knee" axis="0 1 0" range="-1 1"/>
          <geom type="capsule" fromto="0 0 0 .1 0 -.2" size=".02"/>
        </body>
      </body>
      <body {still} pos="0 .2 0"><geom type="sphere" size=".03"/></body>
    </body>
  </worldbody>
  <contact><pair geom1="floor" geom2="base" friction="0.6 0.7 0.01"/></contact>
  <actuator>
    <position name="servo" joint="hip" kp="5" kv="0.3"/>
    <motor name="drive" joint="knee" gear="2"/>
  </actuator>
</mujoco>
"""
NAMED = {"upper": 'name="upper"', "lower": 'name="lower"', "still": 'name="still"'}
WAYS = {
    "from the geoms": {},
    "of bodies without a name": dict.fromkeys(NAMED, ""),
    "by a turned diagonal": {
        "inertial": '<inertial mass="3" pos="0 0 .02" euler="10 20 30" diaginertia=".1 .2 .15"/>'
    },
    "from the geoms whatever is said": {
        "compiler": 'inertiafromgeom="true"',
        "inertial": '<inertial mass="3" pos="0 0 .02" diaginertia=".1 .2 .15"/>',
    },
    "by their sum": {"compiler": 'settotalmass="5"'},
    "with a least mass": {"compiler": 'boundmass="1" boundinertia="0.1"'},
    "of bodies that are fused": {"compiler": 'fusestatic="true"'},
    "with damping that grows with speed": {"damping": "0.7 0.2 0.1"},
    "with a spring of a time constant": {"damping": '0.7" springdamper="0.2 1'},
}


def some(robot: Robot, delay: int = 2) -> Parameters:
    motors = tuple(np.linspace(0.5, 1.5, robot.model.nu).tolist())
    return Parameters(1.3, 0.7, 1.2, 0.8, motors, delay, 1.5, 0.6)


def assert_alike(one: mujoco.MjModel, other: mujoco.MjModel) -> None:
    for field in FIELDS:
        expected = getattr(one, field)
        tolerance = 1e-5 * np.abs(expected).max(initial=1.0)
        np.testing.assert_allclose(
            getattr(other, field), expected, rtol=1e-5, atol=tolerance, err_msg=field
        )


def test_a_time_step_of_many_digits_stays_exact(quadruped: Robot):
    text = quadruped.mjcf.replace('timestep="0.005"', f'timestep="{1 / 240!r}"')
    robot = dataclasses.replace(quadruped, mjcf=text, control_timestep=4 / 240)
    fitted = with_parameters(robot, some(robot))

    assert fitted.model.opt.timestep == robot.model.opt.timestep == 1 / 240
    assert (fitted.substeps, fitted.control_timestep) == (4, 4 / 240)


def test_the_mjcf_of_a_robot_contains_its_parameters(robot: Robot):
    before, parameters = bits(robot.model), some(robot)
    fitted = with_parameters(robot, parameters)

    assert_alike(model_with_parameters(robot, parameters), fitted.model)
    assert fitted.control_delay == 2
    assert fitted.anatomy.names == robot.anatomy.names
    assert (fitted.name, fitted.root) == (robot.name, robot.root)
    assert fitted.control_timestep == robot.control_timestep
    assert bits(robot.model) == before


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.filterwarnings("ignore:compiler attribute 'settotalmass' is deprecated")
def test_masses_and_friction_are_written_in_whatever_way_the_model_defines_them(way: str):
    text = LEGS.format(**{"compiler": "", "inertial": "", "damping": "0.7"} | NAMED | WAYS[way])
    robot = Robot("legs", text, 0.01)
    edited, before = model_with_parameters(robot, some(robot)), robot.model

    np.testing.assert_allclose(edited.body("base").mass, 1.3 * before.body("base").mass)
    np.testing.assert_allclose(edited.body_mass[2:], 0.7 * before.body_mass[2:])
    np.testing.assert_allclose(edited.geom_friction[:, 0], before.geom_friction[:, 0] * 1.2)
    np.testing.assert_allclose(edited.dof_dampingpoly, 0.8 * before.dof_dampingpoly)
    np.testing.assert_allclose(edited.pair_friction, [[0.72, 0.84, 0.01, 0.0001, 0.0001]])
    assert_alike(edited, with_parameters(robot, some(robot)).model)


def test_a_new_delay_replaces_the_old_one(quadruped: Robot):
    late = with_parameters(quadruped, some(quadruped, delay=3))
    again = with_parameters(late, dataclasses.replace(nominal(late), delay=1))

    assert nominal(late).delay == 3
    assert again.control_delay == 1
    assert again.mjcf.count("selfmodel_control_delay") == 1


def test_nominal_parameters_change_nothing(robot: Robot):
    parameters, shuffled = nominal(robot), some(robot)

    assert set(parameters.factors) == {1.0}
    assert parameters.delay == 0
    assert not parameters.differs
    assert shuffled.differs
    assert bits(model_with_parameters(robot, parameters)) == bits(robot.model)
    assert len(set(factor_names(robot))) == len(parameters.factors)


@pytest.mark.parametrize("delay", ["-3", "nan", "1e300", "2.3", "6"])
def test_an_invalid_delay_is_refused(quadruped: Robot, delay: str):
    numeric = f'<custom><numeric name="{CONTROL_DELAY}" data="{delay}"/></custom></mujoco>'
    mjcf = quadruped.mjcf.replace("</mujoco>", numeric)

    with pytest.raises(ValueError, match="must be a multiple of 1/2 from 0 to 5"):
        Robot(quadruped.name, mjcf, quadruped.control_timestep)


def test_fitted_contacts_are_marked_once_and_remain_marked(quadruped: Robot):
    softer = dataclasses.replace(nominal(quadruped), contact_stiffness=0.5)
    fitted = with_parameters(quadruped, softer)
    late = dataclasses.replace(nominal(quadruped), delay=1)

    assert not with_parameters(quadruped, late).has_fitted_contacts
    assert fitted.has_fitted_contacts
    assert with_parameters(fitted, softer).has_fitted_contacts
    assert with_parameters(fitted, softer).mjcf.count(FITTED_CONTACTS) == 1


def joints_scaled(robot: Robot, factor: float) -> Parameters:
    parts = dict.fromkeys(JOINT_FIELDS, (factor,) * len(robot.anatomy.hinges))
    return dataclasses.replace(nominal(robot), **parts)


def test_the_mjcf_contains_limits_of_force_that_a_gain_does_not_change():
    robot, count = arm(), arm().model.nu
    limits = tuple(np.linspace(0.5, 1.5, count).tolist())
    parameters = Parameters(motor_gains=(0.7,) * count, force_limits=limits)
    expected = robot.model.actuator_forcerange * np.array(limits)[:, np.newaxis]

    assert robot.model.actuator_forcelimited.all()
    fitted = with_parameters(robot, parameters).model.actuator_forcerange
    np.testing.assert_allclose(fitted, expected, rtol=1e-5)


def test_the_limit_of_a_joint_that_two_motors_drive_is_scaled_once():
    second = '<position name="second" joint="joint1" kp="1" ctrlrange="-1 1"/></actuator>'
    robot = robot_of(arm_mjcf().replace("</actuator>", second))
    model = copy.copy(robot.model)
    model.jnt_actfrcrange[:] = (-2.0, 2.0)
    limits = Parameters(motor_gains=(1.0,) * model.nu, force_limits=(0.5,) * model.nu)

    fitted = model_with_parameters(robot, limits, model)

    assert model.nu == robot.model.njnt + 1
    np.testing.assert_array_equal(fitted.jnt_actfrcrange, model.jnt_actfrcrange / 2)


def test_a_quantity_of_a_joint_is_scaled_and_one_that_is_zero_is_increased():
    same = model_with_parameters(arm(), joints_scaled(arm(), 1.0))
    for field, _ in JOINT_FIELDS.values():
        assert getattr(same, field).tobytes() == getattr(arm().model, field).tobytes()

    twice, less = joints_scaled(arm(), 2.0), joints_scaled(arm(), 0.5)
    before = joint_values(arm(), nominal(arm()), "joint_damping")
    np.testing.assert_allclose(joint_values(arm(), twice, "joint_damping"), 2 * before)
    assert not arm().model.dof_frictionloss.any()
    assert (joint_values(arm(), twice, "dry_friction") > 0).all()
    assert not joint_values(arm(), less, "dry_friction").any()


def test_the_mjcf_contains_the_quantities_of_joints_and_a_delay_of_a_part_of_a_step():
    delay = 1 + 1 / arm().substeps
    parameters = dataclasses.replace(joints_scaled(arm(), 1.35), delay=delay)
    fitted, model = with_parameters(arm(), parameters), model_with_parameters(arm(), parameters)

    assert fitted.control_delay == delay
    for field, _ in JOINT_FIELDS.values():
        np.testing.assert_allclose(getattr(fitted.model, field), getattr(model, field), rtol=1e-5)


def test_legs_of_one_shape_have_the_same_kinds_of_joints(quadruped: Robot):
    kinds = kinds_of_joints(quadruped)

    assert len(set(kinds.tolist())) < len(kinds)
    assert sorted(joint_of_motor(quadruped).tolist()) == list(range(8))
    assert len(set(kinds_of_joints(arm()).tolist())) == 6


@pytest.mark.parametrize("robot", [arm(), ROBOTS["quadruped"].robot()], ids=lambda own: own.name)
def test_the_coordinates_of_a_set_are_those_of_its_parameters(robot: Robot):
    start = dataclasses.replace(nominal(robot), delay=1, contact_damping=0.5)
    prior, sizes = prior_deviations(robot), []
    for _, basis in bases(robot):
        x = np.linspace(-0.5, 0.5, len(basis.prior))
        applied = basis.applied(start, x)
        sizes.append(len(x))

        np.testing.assert_allclose(basis.coordinates(applied), x, atol=1e-12)
        assert (applied.delay, applied.contact_damping) == (1, 0.5)
        for quantity, deviations in basis.by_quantity(basis.prior).items():
            np.testing.assert_array_equal(deviations, prior[quantity])
    assert sizes == sorted(set(sizes))


def test_draws_have_a_median_of_one_and_the_given_deviations(quadruped: Robot):
    bodies, factors = np.full(quadruped.model.nbody, 0.2), np.full(4 + quadruped.model.nu, 0.1)
    distribution, rng = LogNormal(factors, bodies, 0.5), np.random.default_rng(0)
    drawn = [distribution.draw(rng) for _ in range(400)]

    assert not distribution.is_exact
    assert all(own.differs for own in drawn)
    for values, deviation in (
        ([own.factors for own in drawn], 0.1),
        ([own.body_mass for own in drawn], 0.2),
        ([own.body_inertia for own in drawn], 0.2),
        ([(own.contact_stiffness, own.contact_damping) for own in drawn], 0.5),
    ):
        logarithms = np.log(values)
        np.testing.assert_allclose(logarithms.mean(axis=0), 0, atol=deviation / 4)
        np.testing.assert_allclose(logarithms.std(axis=0), deviation, rtol=0.2)
    # Known contacts take no random numbers.
    rng, again = np.random.default_rng(0), np.random.default_rng(0)
    known, count = LogNormal(factors, bodies).draw(rng), len(factors) + 2 * len(bodies)
    assert dataclasses.replace(drawn[0], contact_stiffness=1.0, contact_damping=1.0) == known
    again.standard_normal(count)
    assert rng.random() == again.random()


@pytest.mark.parametrize("contacts", [0.0, 0.1])
def test_each_deviation_draws_the_factor_in_its_place(quadruped: Robot, contacts: float):
    count = len(nominal(quadruped).factors)
    for place in range(count):
        spread = LogNormal(
            np.where(np.arange(count) == place, 0.1, 0.0), np.zeros(quadruped.model.nbody), contacts
        )
        drawn = spread.draw(np.random.default_rng(place))

        assert np.flatnonzero(np.array(drawn.factors) != 1).tolist() == [place]
        assert {drawn.contact_stiffness == 1, drawn.contact_damping == 1} == {not contacts}


def test_a_draw_scales_the_model_of_the_robot(quadruped: Robot):
    masses, inertias = np.ones((2, quadruped.model.nbody))
    masses[2], inertias[3] = 1.2, 0.5
    parameters = dataclasses.replace(
        nominal(quadruped),
        friction=1.5,
        motor_gains=(0.8, *nominal(quadruped).motor_gains[1:]),
        body_mass=tuple(masses.tolist()),
        body_inertia=tuple(inertias.tolist()),
        contact_stiffness=0.5,
    )
    scaled, own = model_with_parameters(quadruped, parameters), quadruped.model

    np.testing.assert_allclose(scaled.geom_friction[:, 0], 1.5 * own.geom_friction[:, 0])
    np.testing.assert_allclose(scaled.actuator_gainprm[0], 0.8 * own.actuator_gainprm[0])
    np.testing.assert_allclose(scaled.body_mass[2], 1.2 * own.body_mass[2])
    np.testing.assert_allclose(scaled.body_inertia[3], 0.5 * own.body_inertia[3])
    np.testing.assert_allclose(scaled.geom("torso").solref, own.geom("torso").solref * [0.5, 1])
    # The constants that follow from the masses are those of the scaled model.
    assert scaled.body_subtreemass[1] > own.body_subtreemass[1]


def test_the_exact_model_is_drawn_to_the_bit(quadruped: Robot):
    drawn = exact(quadruped).draw(np.random.default_rng(0))

    assert not drawn.differs
    assert exact(quadruped).is_exact
    assert bits(model_with_parameters(quadruped, drawn)) == bits(quadruped.model)


def test_a_weighted_sample_draws_its_models_as_often_as_they_are_probable(quadruped: Robot):
    models = [dataclasses.replace(nominal(quadruped), friction=own) for own in (0.9, 1.0, 1.1)]
    sample, rng = Weighted(models, np.array([0.5, 0.25, 0.25])), np.random.default_rng(0)
    drawn = [sample.draw(rng).friction for _ in range(400)]

    assert not sample.is_exact
    assert Weighted(models[1:2], np.ones(1)).is_exact
    for model, weight in zip(models, sample.weights, strict=True):
        assert drawn.count(model.friction) / 400 == pytest.approx(weight, abs=0.08)
