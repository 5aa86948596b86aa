"""Promises of falls: by height and tilt, relative to where the robot began."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.spatial.transform import Rotation

from selfmodel.recovery.falls import FALLEN_HEIGHT, FALLEN_TIME, first_falls
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
    falls = first_falls(Behaviour(NAMES, np.array([0, FALLEN_TIME]), signals), UP, HEIGHT)

    if abs(lean - np.pi / 3) > 1e-6:
        assert falls == (1 if lean > np.pi / 3 else 2)


@pytest.mark.parametrize("height", [0.0, -0.1])
def test_a_base_that_begins_on_the_ground_has_no_height_to_fall_from(height: float):
    signals = {"base_position": np.full((2, 3), height), "base_orientation": np.eye(4)[[0, 0]]}
    signals["base_position"][1] -= 0.01

    assert first_falls(Behaviour(NAMES, np.array([0, FALLEN_TIME]), signals), UP, height) == 2


@given(start=st.integers(0, 2**31), lean=st.floats(0, np.pi))
def test_a_base_leans_from_where_it_started(start: int, lean: float):
    lying = Rotation.random(random_state=start)
    about = Rotation.from_rotvec(lean * np.array([0.6, 0.8, 0]))
    turns = Rotation.concatenate([lying, about * lying]).as_quat(scalar_first=True)
    signals = {"base_position": np.full((2, 3), HEIGHT), "base_orientation": turns}
    falls = first_falls(Behaviour(NAMES, np.array([0, FALLEN_TIME]), signals), UP, HEIGHT)

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
    falls = first_falls(Behaviour(NAMES, np.array([0, FALLEN_TIME]), signals), normal, HEIGHT)

    if abs(height - FALLEN_HEIGHT * HEIGHT) > 1e-6:
        assert falls == (1 if height < FALLEN_HEIGHT * HEIGHT else 2)


def observed(**changes: tuple[slice, object]) -> Behaviour:
    """100 steps of 0.01 s on level ground, of which some poses are replaced."""
    signals = {
        "base_position": np.full((100, 3), HEIGHT),
        "base_orientation": np.tile([1.0, 0, 0, 0], (100, 1)),
    }
    for name, (steps, value) in changes.items():
        signals[f"base_{name}"][steps] = value
    return Behaviour(NAMES, np.arange(100) / 100, signals)


LOW, UPSIDE_DOWN = 0.4 * HEIGHT, [0.0, 1.0, 0, 0]


@pytest.mark.parametrize(
    ("low", "fall"),
    [
        ([(10, 11)], 100),  # a single measurement
        ([(10, 22)], 100),  # 0.12 s
        ([(10, 23)], 10),  # 0.13 s of 0.25 s
        ([(10, 20), (23, 28)], 10),
        ([(10, 14), (50, 90)], 50),
        ([(87, 100)], 87),  # the run ends in it: 0.13 s of its last 0.25 s
        ([(88, 100)], 100),
        ([(80, 86), (93, 100)], 80),
        ([(99, 100)], 100),  # the last measurement alone
        ([(95, 96), (99, 100)], 100),
    ],
)
def test_a_base_has_fallen_that_is_low_in_most_of_a_quarter_of_a_second(
    low: list[tuple[int, int]], fall: int
):
    position = np.full((2, 100, 3), HEIGHT)
    for first, end in low:
        position[1, first:end, 2] = LOW
    orientation = np.broadcast_to([1.0, 0, 0, 0], (2, 100, 4))
    signals = {"base_position": position, "base_orientation": orientation}
    for begin in (0.0, 12.34, 1.7e9):
        time = begin + np.arange(100) / 100
        falls = first_falls(Behaviour(NAMES, time, signals), UP, HEIGHT)
        assert falls.tolist() == [100, fall]


@pytest.mark.parametrize(("low", "fall"), [(1, 8), (4, 8), (5, 3), (8, 0)])
def test_a_run_shorter_than_a_quarter_of_a_second_is_judged_as_a_whole(low: int, fall: int):
    position = np.full((8, 3), HEIGHT)
    position[8 - low :] = LOW
    signals = {"base_position": position, "base_orientation": np.tile([1.0, 0, 0, 0], (8, 1))}
    assert first_falls(Behaviour(NAMES, np.arange(8) / 100, signals), UP, HEIGHT) == fall


@pytest.mark.parametrize("turns", [0.7, 2.5, 3.0, 4.0])  # per second
def test_a_base_that_rolls_has_fallen(turns: float):
    half = np.pi * turns * np.arange(100) / 100
    rolled = np.stack([np.cos(half), np.sin(half), 0 * half, 0 * half], axis=1)
    fall = int(first_falls(observed(orientation=(slice(None), rolled)), UP, HEIGHT))
    assert 60 <= turns * fall / 100 * 360 <= 60 + turns * 3.6


@pytest.mark.parametrize(
    ("pose", "fall"),
    [
        ({"position": (slice(30, None), LOW), "orientation": (slice(None), np.nan)}, 30),
        ({"position": (slice(30, None), LOW), "orientation": (slice(1), np.nan)}, 30),
        ({"orientation": (slice(30, None), UPSIDE_DOWN), "position": (slice(None), np.nan)}, 30),
        ({"position": (slice(None), np.nan), "orientation": (slice(None), np.nan)}, 100),
        ({"position": (slice(20, 60), np.nan), "orientation": (slice(20, 60), np.nan)}, 100),
    ],
)
def test_what_is_observed_of_a_base_is_enough_for_a_fall(
    pose: dict[str, tuple[slice, object]], fall: int
):
    assert first_falls(observed(**pose), UP, HEIGHT) == fall


def test_the_reference_of_the_tilt_is_the_first_orientation_that_is_known():
    poses = np.tile(UPSIDE_DOWN, (100, 1))
    poses[0], poses[50:] = np.nan, [1.0, 0, 0, 0]
    assert first_falls(observed(orientation=(slice(None), poses)), UP, HEIGHT) == 50


def test_a_base_that_is_missed_while_it_is_low_has_fallen():
    position = np.full((100, 3), HEIGHT)
    position[10:20] = LOW
    position[15:60] = np.nan
    orientation = np.where(np.isnan(position[:, :1]), np.nan, [1.0, 0, 0, 0])
    run = observed(position=(slice(None), position), orientation=(slice(None), orientation))
    assert first_falls(run, UP, HEIGHT) == 10
