"""Promises about rough ground: feet feel its shape, and a diagnosis of it is made from that."""

import dataclasses

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
from selfmodel.trials.behaviour import Behaviour, collect
from selfmodel.trials.estimation import JOINTS
from selfmodel.trials.trial import Trial, TrialPlan

STEPS = 1500
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
    drivers = [Controller(cpg, genome) for genome in rng.uniform(-1, 1, (40, cpg.weights))]
    intact = Hypothesis()
    runs = [(intact, driver) for driver in drivers]
    way = Simulator(quadruped, 2).run(runs, STEPS, ["base_position"]).behaviour["base_position"]
    return drivers[int(np.argmax(np.linalg.norm(way[:, -1, :2], axis=1)))]


def observed(robot: Robot, truth: str, walk: Controller) -> Behaviour:
    physical = SimulatedRobot(robot, parse(truth, robot.anatomy))
    return collect(robot.anatomy.names, physical.run(walk, STEPS))


@pytest.mark.parametrize("roughness", [0.02, 0.04])
def test_feet_feel_the_ground_where_they_are(quadruped: Robot, walk: Controller, roughness: float):
    points = ground_contact_points(quadruped, observed(quadruped, f"roughness={roughness}", walk))
    x, y, z = points.T

    assert len(points) > STEPS / 2
    assert np.linalg.norm(points[:, :2], axis=1).max() > 1.2, "it walked on flat ground only"
    assert np.median(np.abs(z - MARGIN - roughness * height(x, y))) < 0.003


def test_on_level_ground_they_feel_no_height(quadruped: Robot, walk: Controller):
    z = ground_contact_points(quadruped, observed(quadruped, "intact", walk))[:, 2]

    assert np.median(np.abs(z - MARGIN)) < 0.001


@pytest.mark.parametrize("truth", ["intact", "roughness=0.01", "roughness=0.02", "roughness=0.04"])
@pytest.mark.parametrize("slope", ["", "slope=0.1"])
def test_the_right_roughness_predicts_best_though_its_bumps_are_unknown(
    quadruped: Robot, walk: Controller, truth: str, slope: str
):
    def both(text: str) -> str:
        return "+".join(filter(None, (slope, text.removeprefix("intact")))) or "intact"

    plan = TrialPlan("00-after", "after", walk, STEPS, 0)
    behaviour = observed(quadruped, both(truth), walk)
    trial = Trial(plan, quadruped.name, behaviour, "nowhere.mcap")
    said = ["intact", "roughness=0.01", "roughness=0.02", "roughness=0.04"]
    hypotheses = [parse(both(one), quadruped.anatomy) for one in said]
    losses = LossTable(Simulator(quadruped, 1), SEGMENT_PREDICTION).distances(hypotheses, [trial])

    assert said[int(np.argmin(losses))] == truth


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


def test_what_was_not_observed_is_not_felt(quadruped: Robot, walk: Controller):
    whole = observed(quadruped, "intact", walk)
    blind = {signal: values.copy() for signal, values in whole.signals.items()}
    blind["base_position"][100:] = np.nan
    silent = {signal: values.copy() for signal, values in whole.signals.items()}
    silent["sensors"][:, :4] = np.nan

    assert (
        0 < len(ground_contact_points(quadruped, dataclasses.replace(whole, signals=blind))) <= 400
    )
    assert ground_contact_points(quadruped, dataclasses.replace(whole, signals=silent)).shape == (
        0,
        3,
    )


def test_a_robot_on_its_back_or_far_away_feels_nothing_and_is_diagnosed_all_the_same(
    quadruped: Robot, walk: Controller
):
    whole = observed(quadruped, "intact", walk)
    in_the_air = {signal: values.copy() for signal, values in whole.signals.items()}
    in_the_air["base_position"][:, 2] += 20
    on_its_back = {signal: values.copy() for signal, values in whole.signals.items()}
    on_its_back["sensors"][:, :4] = 0
    plan = TrialPlan("00-after", "after", walk, STEPS, 0)
    for number, signals in enumerate((in_the_air, on_its_back)):
        behaviour = dataclasses.replace(whole, signals=signals)
        trial = Trial(plan, quadruped.name, behaviour, f"{number}.mcap")
        evidence = LossTable(Simulator(quadruped, 1), SEGMENT_PREDICTION)
        rough = parse("roughness=0.02", quadruped.anatomy)

        assert ground_contact_points(quadruped, behaviour).shape == (0, 3)
        assert np.isfinite(evidence.distances([rough], [trial])).all()


def test_the_ground_is_the_plane_that_lies_level_not_a_wall(quadruped: Robot, walk: Controller):
    wall = '<worldbody><geom type="plane" size="5 5 1" pos="9 0 0" euler="0 -90 0"/>'
    walled = dataclasses.replace(quadruped, mjcf=quadruped.mjcf.replace("<worldbody>", wall, 1))
    behaviour = observed(quadruped, "intact", walk)

    np.testing.assert_allclose(
        ground_contact_points(walled, behaviour),
        ground_contact_points(quadruped, behaviour),
        atol=1e-9,
    )


def test_a_robot_without_touch_feels_nothing():
    swimmer = suite_bodies.robot("swimmer", "swimmer6")
    behaviour = Behaviour(swimmer.anatomy.names, np.arange(2.0), {})

    assert ground_contact_points(swimmer, behaviour).shape == (0, 3)


def test_only_the_feet_beyond_a_lost_encoder_feel_nothing(quadruped: Robot, walk: Controller):
    whole = observed(quadruped, "intact", walk)
    leg = [name.startswith("front_left") for name in quadruped.anatomy.hinges]
    lost = {signal: values.copy() for signal, values in whole.signals.items()}
    others = {signal: values.copy() for signal, values in whole.signals.items()}
    for signal in JOINTS:
        lost[signal][:, np.argmax(leg)] = np.nan
    others["sensors"][:, quadruped.anatomy.names.sensors.index("front_left_touch")] = 0

    found = ground_contact_points(quadruped, dataclasses.replace(whole, signals=lost))
    assert 0 < len(found) < len(ground_contact_points(quadruped, whole))
    np.testing.assert_array_equal(
        found, ground_contact_points(quadruped, dataclasses.replace(whole, signals=others))
    )
