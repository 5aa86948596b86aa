"""Promises about rough ground: feet feel its shape, and a diagnosis of it is made from that."""

import dataclasses
from collections.abc import Callable
from functools import cache

import mujoco
import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from selfmodel.comparators import SEGMENT_PREDICTION
from selfmodel.controllers.controller import Controller
from selfmodel.diagnosis.losses import LossTable
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.faults.world import (
    CELL_SIZE,
    HALF_EXTENT,
    MIN_CELL_CONTACTS,
    MIN_CELLS,
    estimated_heights,
    unit_heights,
)
from selfmodel.physical.simulated import OWN_SEED, SimulatedRobot
from selfmodel.robot.designs import cpg_for
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator, ground_contact_points
from selfmodel.tasks import suite_bodies
from selfmodel.trials.estimation import JOINTS
from selfmodel.trials.signals import Signal
from selfmodel.trials.trajectory import Trajectory, collect
from selfmodel.trials.trial import Trial, TrialPlan

STEPS = 1000
MARGIN = 0.01
"""From which distance on MuJoCo lets the robot's feet touch, m."""
SHAPE = unit_heights(OWN_SEED)
"""Of the terrain that the physical robot walks on, which is not the self-model's."""


def height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Of the terrain of roughness 1 at some places."""
    return map_coordinates(
        SHAPE, [(y + HALF_EXTENT[1]) / CELL_SIZE, (x + HALF_EXTENT[0]) / CELL_SIZE], order=1
    )


@pytest.fixture(scope="module")
def walk(quadruped: Robot) -> Controller:
    """A gait that leaves the flat ground around the start, made without a search."""
    rng = np.random.default_rng(0)
    cpg = cpg_for(quadruped)
    drivers = [Controller(cpg, genome) for genome in rng.uniform(-1, 1, (20, cpg.weights))]
    runs = [(Hypothesis(), driver) for driver in drivers]
    way = Simulator(quadruped, 2).run(runs, 300, ["base_position"]).trajectory["base_position"]
    return drivers[int(np.argmax(np.linalg.norm(way[:, -1, :2], axis=1)))]


Observed = Callable[[str], Trajectory]


@pytest.fixture(scope="module")
def observed(quadruped: Robot, walk: Controller) -> Observed:
    """The walk of a robot with something wrong."""

    @cache
    def run(truth: str) -> Trajectory:
        physical = SimulatedRobot(quadruped, parse(truth, quadruped.anatomy))
        return collect(quadruped.anatomy.names, physical.run(walk, STEPS))

    return run


def logged(trajectory: Trajectory, walk: Controller, path: str) -> Trial:
    return Trial(TrialPlan("00-after", "after", walk, STEPS, 0), "quadruped", trajectory, path)


def changed(run: Trajectory, signal: Signal, place: object, value: float) -> Trajectory:
    values = run[signal].copy()
    values[place] = value
    return run.with_signals({signal: values})


@pytest.mark.parametrize("roughness", [0.0, 0.04])
def test_feet_feel_the_ground_where_they_are(
    quadruped: Robot, observed: Observed, roughness: float
):
    truth = f"roughness={roughness}" if roughness else "intact"
    points = ground_contact_points(quadruped, observed(truth))
    x, y, z = points.T

    assert len(points) > STEPS / 2
    assert np.linalg.norm(points[:, :2], axis=1).max() > 1.2, "it walked on flat ground only"
    error = np.abs(z - MARGIN - roughness * height(x, y))
    assert np.median(error) < (0.003 if roughness else 0.001)


@pytest.mark.parametrize(
    ("truth", "slope"), [("roughness=0.01", "+slope=0.1"), ("roughness=0.04", "")]
)
def test_the_right_roughness_predicts_best_though_its_bumps_are_unknown(
    quadruped: Robot, walk: Controller, observed: Observed, truth: str, slope: str
):
    texts = ["intact", "roughness=0.01", "roughness=0.02", "roughness=0.04"]
    hypotheses = [
        parse((text + slope).removeprefix("intact+"), quadruped.anatomy) for text in texts
    ]
    trial = logged(observed((truth + slope).removeprefix("intact+")), walk, "nowhere.mcap")
    losses = LossTable(Simulator(quadruped, 1), SEGMENT_PREDICTION).distances(hypotheses, [trial])

    assert texts[int(np.argmin(losses))] == truth


def test_the_shape_that_was_felt_is_that_of_the_terrain_however_high():
    rng = np.random.default_rng(1)
    places = rng.uniform((-4, -1), (4, 1), (20_000, 2))
    z = 0.03 * height(*places.T) + 0.01
    shape = estimated_heights(np.column_stack([places, z]))
    row, column = np.round((places[:, ::-1] + HALF_EXTENT[::-1]) / CELL_SIZE).astype(int).T

    assert np.corrcoef(shape[row, column], SHAPE[row, column])[0, 1] > 0.97
    assert np.median(np.abs(shape[row, column] - SHAPE[row, column])) < 0.15


def test_where_too_little_was_felt_the_ground_is_level():
    few = np.array([[2 + 0.2 * k, 0, 0.01 * k] for k in range(MIN_CELLS - 1)]).repeat(
        MIN_CELL_CONTACTS, axis=0
    )
    near = np.random.default_rng(2).uniform(-0.5, 0.5, (5000, 3))
    beyond = np.random.default_rng(2).uniform(50, 60, (5000, 3))

    for points in (np.empty((0, 3)), few, near, beyond):
        assert not estimated_heights(points).any()


def test_a_touch_that_errs_does_not_raise_the_ground():
    rng = np.random.default_rng(3)
    cells = np.round(rng.uniform((-30, -10), (30, 10), (500, 2))) * CELL_SIZE
    right = np.column_stack([cells, 0.03 * height(*cells.T)]).repeat(9, axis=0)
    wrong, once = right.copy(), np.array([[3.4, 1.4, 5.0]])
    wrong[: len(wrong) // 2 : 9, 2] += 0.5

    np.testing.assert_array_equal(estimated_heights(wrong), estimated_heights(right))
    np.testing.assert_array_equal(
        estimated_heights(np.vstack([right, once])), estimated_heights(right)
    )


def test_what_was_not_observed_is_not_felt(quadruped: Robot, observed: Observed):
    whole, hinges = observed("intact"), quadruped.anatomy.hinges
    blind = changed(whole, "base_position", slice(100, None), np.nan)
    silent = changed(whole, "sensors", np.s_[:, :4], np.nan)
    hip = next(k for k, name in enumerate(hinges) if name.startswith("front_left"))
    lost = changed(changed(whole, JOINTS[0], np.s_[:, hip], np.nan), JOINTS[1], np.s_[:, hip], 0)
    touch = quadruped.anatomy.names.sensors.index("front_left_touch")
    others = changed(whole, "sensors", np.s_[:, touch], 0)
    points, by_others = (ground_contact_points(quadruped, own) for own in (lost, others))

    assert 0 < len(ground_contact_points(quadruped, blind)) <= 400
    assert ground_contact_points(quadruped, silent).shape == (0, 3)
    # Only the foot beyond a lost encoder feels nothing.
    assert 0 < len(points) < len(ground_contact_points(quadruped, whole))
    np.testing.assert_array_equal(points, by_others)


def test_a_robot_on_its_back_or_far_away_feels_nothing_and_is_diagnosed_all_the_same(
    quadruped: Robot, walk: Controller, observed: Observed
):
    whole = observed("intact")
    in_the_air = changed(whole, "base_position", np.s_[:, 2], 20)
    on_its_back = changed(whole, "sensors", np.s_[:, :4], 0)
    for number, trajectory in enumerate((in_the_air, on_its_back)):
        trial = logged(trajectory, walk, f"{number}.mcap")
        losses = LossTable(Simulator(quadruped, 1), SEGMENT_PREDICTION)
        rough = parse("roughness=0.02", quadruped.anatomy)

        assert ground_contact_points(quadruped, trajectory).shape == (0, 3)
        assert np.isfinite(losses.distances([rough], [trial])).all()


def test_the_ground_is_the_plane_that_lies_level_not_a_wall(quadruped: Robot, observed: Observed):
    wall = '<worldbody><geom type="plane" size="5 5 1" pos="9 0 0" euler="0 -90 0"/>'
    walled = dataclasses.replace(quadruped, mjcf=quadruped.mjcf.replace("<worldbody>", wall, 1))
    points = [ground_contact_points(robot, observed("intact")) for robot in (walled, quadruped)]

    np.testing.assert_allclose(*points, atol=1e-9)


def test_of_several_geoms_of_a_foot_the_lowest_counts(quadruped: Robot, observed: Observed):
    spec = quadruped.specification()
    for name in ("front_left_lower", "back_right_lower"):
        spec.body(name).add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.01, 0, 0], mass=0)
    knobbed = dataclasses.replace(quadruped, mjcf=spec.to_xml())
    points = [ground_contact_points(robot, observed("intact")) for robot in (knobbed, quadruped)]

    np.testing.assert_allclose(*points, atol=1e-4)


def test_a_robot_without_touch_feels_nothing():
    swimmer = suite_bodies.robot("swimmer", "swimmer6")
    trajectory = Trajectory(swimmer.anatomy.names, np.arange(2.0), {})

    assert ground_contact_points(swimmer, trajectory).shape == (0, 3)
