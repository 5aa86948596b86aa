"""Promises of the repair by layers: never worse than none, and the smallest that regains enough."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from selfmodel.controllers.compensation import Compensated
from selfmodel.controllers.controller import Controller
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.progress import ignore
from selfmodel.recovery.candidates import CandidateController, RobustFitness
from selfmodel.recovery.layers import LayerRepair, layered
from selfmodel.recovery.scores import DISPLACEMENT
from selfmodel.recovery.uncertainty import assumed_uncertainty
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from tests.helpers.drivers import random_cpgs

TINY = dataclasses.replace(Settings().scaled(60), steps=20)
SOUND = 1.0
"""Score of the intact robot, whose layer of zeros scores 0 after the failure."""


@pytest.fixture
def none(quadruped: Robot) -> Controller:
    """A CPG within a layer that changes nothing."""
    return layered(random_cpgs(quadruped, 1)[0])


def found_by(
    robot: Robot,
    none: Controller,
    value: Callable[[np.ndarray], float],
    tried: Sequence[Controller] = (),
    finer: float = 1.0,
) -> tuple[CandidateController, ...]:
    """The candidates of a repair, in a world in which a layer has a value by its genome.

    At a quarter of the time step the values are those times ``finer``.
    """

    def scored(
        fitness: RobustFitness, layers: Sequence[Controller], count: int, *_: object
    ) -> np.ndarray:
        assert len({one.design for one in layers}) == 1, "as a batch must have"
        intact = fitness.hypotheses == (INTACT,)
        share = 1.0 if fitness.simulator.robot is robot else finer
        values = [SOUND if intact else share * value(one.genome) for one in layers]
        fitness.simulator.stats.steps += len(layers) * count * TINY.steps
        return np.repeat(values, count).reshape(len(layers), count)

    repair = LayerRepair(Simulator(robot, 1), TINY, none.design, DISPLACEMENT)
    damage = parse("motor:front_left_knee=0", robot.anatomy)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(RobustFitness, "__call__", scored)
        rng = np.random.default_rng(0)
        uncertainty = assumed_uncertainty(robot)
        return repair((damage,), lambda: uncertainty, [none, *tried], rng, ignore)


def test_where_every_change_is_worse_the_robot_is_not_changed(quadruped: Robot, none: Controller):
    (found,) = found_by(quadruped, none, lambda genome: -np.abs(genome).sum())
    assert not found.controller.genome.any()
    assert found.mean == 0


def test_the_smallest_layer_that_regains_enough_is_the_repair(quadruped: Robot, none: Controller):
    found = found_by(quadruped, none, lambda genome: 5 * genome[0])
    assert {one.controller.design for one in found} == {none.design}
    values = [one.mean for one in found]
    assert values == sorted(values, reverse=True)
    assert values[0] >= 0.8 * SOUND
    assert values[-1] > 0


@pytest.mark.parametrize(("finer", "is_changed"), [(0.5, False), (0.9, True)])
def test_a_layer_that_a_coarse_time_step_flatters_is_no_repair(
    quadruped: Robot, none: Controller, finer: float, *, is_changed: bool
):
    found = found_by(quadruped, none, lambda genome: 5 * genome[0], finer=finer)
    assert (found[0].controller != none) == is_changed
    assert is_changed or len(found) == 1


def test_a_search_that_stalls_goes_on_with_the_larger_layer(quadruped: Robot, none: Controller):
    small = none.design.weights
    found = found_by(quadruped, none, lambda genome: 0.1 * genome[0] + genome[small:].sum())
    best = found[0].controller
    assert best.design == dataclasses.replace(none.design, feedback=True)
    assert best.genome[small:].any()


def test_a_layer_that_was_tried_is_begun_at(quadruped: Robot, none: Controller):
    large = Compensated.around(none, feedback=True)
    tried = Controller(large, np.full(large.weights, 0.3))
    found = found_by(quadruped, none, lambda genome: genome.mean(), [tried])
    assert found[0].mean > 0.3, "the search goes on from what was tried"
    assert {one.controller.design for one in found} == {large}


def test_a_small_layer_that_was_tried_is_the_repair_where_nothing_is_better(
    quadruped: Robot, none: Controller
):
    tried = Controller(none.design, np.full(none.design.weights, 0.3))

    def value(genome: np.ndarray) -> float:
        known = np.array_equal(genome[: none.design.weights], tried.genome)
        return 0.5 if known and not genome[none.design.weights :].any() else -np.abs(genome).sum()

    found = found_by(quadruped, none, value, [tried])
    assert [one.controller for one in found] == [tried]
