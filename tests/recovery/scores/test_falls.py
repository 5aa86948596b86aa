"""Promises of falls: by height and tilt, relative to where the robot began."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.spatial.transform import Rotation

from selfmodel.recovery.scores.falls import FALLEN_HEIGHT, first_falls
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.signals import Names

NAMES = Names(sensors=("touch",), motors=("motor",), hinges=("hinge",))
UP = np.array([0.0, 0.0, 1.0])
HEIGHT = 0.3


@given(lean=st.floats(0, np.pi), heading=st.floats(-np.pi, np.pi), about=st.floats(-np.pi, np.pi))
def test_a_base_has_fallen_when_it_leans_by_more_than_sixty_degrees_whatever_its_heading(
    lean: float, heading: float, about: float
):
    axis = np.array([np.cos(about), np.sin(about), 0])
    turned = Rotation.from_rotvec(lean * axis) * Rotation.from_euler("z", heading)
    x, y, z, w = turned.as_quat()
    orientation = np.array([[1, 0, 0, 0], [w, x, y, z]])
    signals = {"base_position": np.full((2, 3), HEIGHT), "base_orientation": orientation}
    falls = first_falls(Behaviour(NAMES, np.array([0, 0.01]), signals), UP, HEIGHT)

    if abs(lean - np.pi / 3) > 1e-6:
        assert falls == (1 if lean > np.pi / 3 else 2)


@pytest.mark.parametrize("height", [0.0, -0.1])
def test_a_base_that_begins_on_the_ground_has_no_height_to_fall_from(height: float):
    signals = {"base_position": np.full((2, 3), height), "base_orientation": np.eye(4)[[0, 0]]}
    signals["base_position"][1] -= 0.01

    assert first_falls(Behaviour(NAMES, np.array([0, 0.01]), signals), UP, height) == 2


@given(start=st.integers(0, 2**31), lean=st.floats(0, np.pi))
def test_a_base_leans_from_where_it_started(start: int, lean: float):
    lying = Rotation.random(random_state=start)
    about = Rotation.from_rotvec(lean * np.array([0.6, 0.8, 0]))
    turns = Rotation.concatenate([lying, about * lying]).as_quat(scalar_first=True)
    signals = {"base_position": np.full((2, 3), HEIGHT), "base_orientation": turns}
    falls = first_falls(Behaviour(NAMES, np.array([0, 0.01]), signals), UP, HEIGHT)

    if abs(lean - np.pi / 3) > 1e-6:
        assert falls == (1 if lean > np.pi / 3 else 2)


@given(way=st.floats(-10, 10), height=st.floats(0, 2), slope=st.floats(-0.3, 0.3))
def test_a_base_has_fallen_when_it_is_near_the_ground_however_far_up_or_down_a_slope_it_is(
    way: float, height: float, slope: float
):
    along = np.array([np.cos(slope), 0, np.sin(slope)])
    normal = np.array([-np.sin(slope), 0, np.cos(slope)])
    position = np.array([HEIGHT * normal, way * along + height * normal])
    signals = {"base_position": position, "base_orientation": np.tile([1.0, 0, 0, 0], (2, 1))}
    falls = first_falls(Behaviour(NAMES, np.array([0, 0.01]), signals), normal, HEIGHT)

    if abs(height - FALLEN_HEIGHT * HEIGHT) > 1e-6:
        assert falls == (1 if height < FALLEN_HEIGHT * HEIGHT else 2)
