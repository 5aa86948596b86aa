"""Promises of the distributions of a model's parameters."""

import mujoco
import numpy as np

from selfmodel.robot.robot import Robot
from selfmodel.simulation.model_distribution import LogNormal, ModelDraw, Weighted, exact


def test_known_contacts_take_no_random_numbers(quadruped: Robot):
    factors, bodies = np.full(4 + quadruped.model.nu, 0.1), np.full(quadruped.model.nbody, 0.1)
    one, other = np.random.default_rng(0), np.random.default_rng(0)
    known, unknown = LogNormal(factors, bodies), LogNormal(factors, bodies, 0.5)
    first = known.draw(one), unknown.draw(other)

    np.testing.assert_array_equal(first[0].inertias, first[1].inertias)
    assert not first[0].contacts.any()
    assert first[1].contacts.all()
    assert known.draw(one).factors.tolist() != unknown.draw(other).factors.tolist()


def test_contacts_have_the_given_deviation_and_change_the_model(quadruped: Robot):
    unknown = LogNormal(np.zeros(4 + quadruped.model.nu), np.zeros(quadruped.model.nbody), 0.5)
    rng = np.random.default_rng(0)
    drawn = [unknown.draw(rng) for _ in range(400)]
    contacts = np.array([own.contacts for own in drawn])

    assert not unknown.is_exact
    assert all(own.differs for own in drawn)
    np.testing.assert_allclose(contacts.mean(axis=0), 0, atol=0.1)
    np.testing.assert_allclose(contacts.std(axis=0), 0.5, rtol=0.2)
    soft = next(own for own in drawn if (own.contacts < 0).all())
    scaled = soft.applied_to(quadruped, quadruped.model)
    torso = quadruped.model.geom("torso").solref
    np.testing.assert_allclose(scaled.geom("torso").solref, torso * np.exp(soft.contacts))


def draws_of(deviation: float, robot: Robot, count: int = 400) -> list[ModelDraw]:
    factors = np.full(4 + robot.model.nu, deviation)
    unknown = LogNormal(factors, np.full(robot.model.nbody, 2 * deviation))
    rng = np.random.default_rng(0)
    return [unknown.draw(rng) for _ in range(count)]


def test_factors_have_a_median_of_one_and_the_given_deviation(quadruped: Robot):
    drawn = draws_of(0.1, quadruped)
    for values, deviation in (
        (np.array([own.factors for own in drawn]), 0.1),
        (np.array([own.masses for own in drawn]), 0.2),
        (np.array([own.inertias for own in drawn]), 0.2),
    ):
        np.testing.assert_allclose(values.mean(axis=0), 0, atol=5 * deviation / 20)
        np.testing.assert_allclose(values.std(axis=0), deviation, rtol=0.2)


def test_a_draw_scales_the_model_of_the_robot(quadruped: Robot):
    bodies, motors = quadruped.model.nbody, quadruped.model.nu
    factors, masses, inertias = np.zeros(4 + motors), np.zeros(bodies), np.zeros(bodies)
    factors[2], factors[4] = np.log(1.5), np.log(0.8)
    masses[2], inertias[3] = np.log(1.2), np.log(0.5)
    drawn = ModelDraw(factors, masses, inertias)
    scaled = drawn.applied_to(quadruped, quadruped.model)
    own = quadruped.model

    np.testing.assert_allclose(scaled.geom_friction[:, 0], 1.5 * own.geom_friction[:, 0])
    np.testing.assert_allclose(scaled.actuator_gainprm[0], 0.8 * own.actuator_gainprm[0])
    np.testing.assert_allclose(scaled.body_mass[2], 1.2 * own.body_mass[2])
    np.testing.assert_allclose(scaled.body_inertia[3], 0.5 * own.body_inertia[3])
    # The constants that follow from the masses are those of the scaled model.
    assert scaled.body_subtreemass[1] > own.body_subtreemass[1]
    assert drawn.differs


def test_the_exact_model_is_drawn_to_the_bit(quadruped: Robot):
    drawn = exact(quadruped).draw(np.random.default_rng(0))
    assert not drawn.differs
    size = mujoco.mj_sizeModel(quadruped.model)
    buffers = [np.empty(size, np.uint8) for _ in range(2)]
    for model, buffer in zip(
        (quadruped.model, drawn.applied_to(quadruped, quadruped.model)), buffers, strict=True
    ):
        mujoco.mj_saveModel(model, None, buffer)
    np.testing.assert_array_equal(*buffers)


def test_weighted_models_are_drawn_by_their_weights(quadruped: Robot):
    models = draws_of(0.1, quadruped, count=3)
    weighted = Weighted(models, np.array([0.0, 0.25, 0.75]))
    rng = np.random.default_rng(0)
    drawn = [weighted.draw(rng) for _ in range(400)]

    assert all(own in models for own in drawn)
    counts = [sum(own is model for own in drawn) for model in models]
    assert counts[0] == 0
    np.testing.assert_allclose(counts[1] / 400, 0.25, atol=0.08)
