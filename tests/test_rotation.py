"""Promises of the difference between two orientations, beside scipy's rotations."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.spatial.transform import Rotation

from selfmodel.rotation import cross, rotation_between


def quaternion(rotation: Rotation) -> np.ndarray:
    return rotation.as_quat(scalar_first=True)


def rotations(count: int, seed: int = 0) -> Rotation:
    return Rotation.random(count, rng=np.random.default_rng(seed))


vectors = st.tuples(*[st.floats(-0.05, 0.05)] * 3).map(np.array)


@given(vectors, st.integers(0, 1000))
def test_a_small_turn_is_its_axis_times_its_angle_in_the_frame_of_the_start(
    turn: np.ndarray, seed: int
):
    (start,) = rotations(1, seed)
    to = start * Rotation.from_rotvec(turn)

    np.testing.assert_allclose(
        rotation_between(quaternion(to), quaternion(start)), turn, rtol=1e-3, atol=1e-12
    )


def test_any_turn_is_twice_the_vector_part():
    start, turn = rotations(50), rotations(50, seed=1)
    vector = turn.as_rotvec()
    angle = np.linalg.norm(vector, axis=1, keepdims=True)

    np.testing.assert_allclose(
        rotation_between(quaternion(start * turn), quaternion(start)),
        2 * np.sin(angle / 2) * vector / angle,
        atol=1e-12,
    )


def test_a_quaternion_and_its_negative_are_one_orientation_and_back_is_the_opposite_turn():
    one, other = quaternion(rotations(50)), quaternion(rotations(50, seed=1))
    between = rotation_between(one, other)

    np.testing.assert_array_equal(rotation_between(-one, other), between)
    np.testing.assert_array_equal(rotation_between(one, -other), between)
    np.testing.assert_array_equal(rotation_between(one, -one), np.zeros((50, 3)))
    np.testing.assert_allclose(between, -rotation_between(other, one), atol=1e-12)
    assert np.linalg.norm(between, axis=1).max() <= 2 + 1e-12
    assert not rotation_between(one, one).any()
    # A start is shared by all that broadcast.
    np.testing.assert_array_equal(
        rotation_between(one.reshape(5, 10, 4), other[0]).reshape(50, 3),
        rotation_between(one, np.broadcast_to(other[0], one.shape)),
    )


@pytest.mark.parametrize(
    "shapes", [((3,), (3,)), ((3,), (7, 3)), ((7, 3), (7, 3)), ((5, 1, 3), (7, 3))]
)
def test_cross_products_are_numpy_s_to_the_bit(shapes: tuple[tuple[int, ...], tuple[int, ...]]):
    rng = np.random.default_rng(0)
    first, second = (rng.normal(size=shape) for shape in shapes)

    np.testing.assert_array_equal(cross(first, second), np.cross(first, second))
