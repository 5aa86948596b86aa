"""Promises of the score ``upright``: displacement counts until the robot falls."""

import numpy as np
import pytest

from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.recovery.falls import FALLEN_TIME, fall_of, falls_of
from selfmodel.recovery.scores import DISPLACEMENT, UPRIGHT
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.drivers import random_controllers, random_cpgs
from tests.helpers.robots.arms import arm

STEPS = 5


def walked(robot: Robot, x: list[float], tilts: list[float], heights: list[float]) -> Behaviour:
    """A run of the base alone, tilted about its y axis by angles in rad."""
    half = np.array(tilts) / 2
    orientation = np.stack([np.cos(half), 0 * half, np.sin(half), 0 * half], axis=1)
    position = np.stack([x, np.zeros(len(x)), heights], axis=1)
    signals = {"base_position": position[None], "base_orientation": orientation[None]}
    return Behaviour(robot.anatomy.names, np.arange(len(x)) * FALLEN_TIME, signals)


def test_a_run_without_a_fall_has_its_displacement(quadruped: Robot):
    height = quadruped.standing_height
    run = walked(quadruped, [0, 1, 2, 3, 4], [0.0] * STEPS, [height] * STEPS)
    assert UPRIGHT.of(quadruped, INTACT, run) == DISPLACEMENT.of(quadruped, INTACT, run) == 4
    assert falls_of(quadruped, INTACT, run) == STEPS


@pytest.mark.parametrize("fall", range(1, STEPS))
def test_nothing_counts_from_a_fall_on_its_back_or_on_its_belly(quadruped: Robot, fall: int):
    height = quadruped.standing_height
    x, turned = [0.0, 1, 2, 30, 400], [0.0] * fall + [np.pi] + [0.0] * (STEPS - fall - 1)
    low = [height] * fall + [0.3 * height] + [height] * (STEPS - fall - 1)
    for run in (
        walked(quadruped, x, turned, [height] * STEPS),
        walked(quadruped, x, [0.0] * STEPS, low),
    ):
        assert UPRIGHT.of(quadruped, INTACT, run) == x[fall - 1]
        assert falls_of(quadruped, INTACT, run) == fall


def test_the_ground_of_a_slope_is_that_of_the_hypothesis(quadruped: Robot):
    slope = parse("slope=-0.5", quadruped.anatomy)
    runs = [(slope, driver) for driver in random_controllers(quadruped, 1)]
    behaviour = Simulator(quadruped, 1).run(runs, 2, UPRIGHT.record).behaviour
    assert falls_of(quadruped, slope, behaviour) == 2


def test_height_is_measured_from_the_sloping_ground(quadruped: Robot):
    slope = parse("slope=-0.5", quadruped.anatomy)
    normal = build(quadruped, slope).normal
    x = np.arange(STEPS) * np.sign(normal[0])  # downhill
    heights = (quadruped.standing_height - normal[0] * x) / normal[2]
    run = walked(quadruped, x.tolist(), [0.0] * STEPS, heights.tolist())
    assert falls_of(quadruped, slope, run) == STEPS
    assert falls_of(quadruped, INTACT, run) == 1


def test_a_run_that_begins_with_a_fall_has_no_displacement(quadruped: Robot):
    run = walked(quadruped, [0, 1, 2, 3, 4], [0.0] * STEPS, [0.01] * STEPS)
    assert UPRIGHT.of(quadruped, INTACT, run) == 0


def test_the_score_of_a_run_does_not_depend_on_its_batch(quadruped: Robot):
    runs = [(INTACT, driver) for driver in random_controllers(quadruped, 6, seed=3)]
    behaviour = Simulator(quadruped, 1).run(runs, 150, UPRIGHT.record).behaviour
    alone = [
        UPRIGHT.of(
            quadruped,
            INTACT,
            Behaviour(
                behaviour.names,
                behaviour.time,
                {signal: values[k : k + 1] for signal, values in behaviour.signals.items()},
            ),
        )[0]
        for k in range(len(runs))
    ]
    assert UPRIGHT.of(quadruped, INTACT, behaviour).tolist() == alone


@pytest.mark.parametrize(("planned", "fall"), [(60, 39), (40, None)])
def test_the_last_pose_of_a_trial_that_ended_early_counts_as_if_it_remained(
    quadruped: Robot, planned: int, fall: int | None
):
    (driver,) = random_controllers(quadruped, 1)
    batch = walked(quadruped, [0.0] * 40, [0.0] * 39 + [np.pi], [quadruped.standing_height] * 40)
    signals = {name: values[0] for name, values in batch.signals.items()}
    behaviour = Behaviour(batch.names, np.arange(40) * 0.01, signals)
    trial = Trial(
        TrialPlan("single", "single", driver, planned, 0), quadruped.name, behaviour, "a log"
    )

    assert fall_of(quadruped, INTACT, trial) == fall


def test_a_fixed_base_does_not_fall():
    runs = [(INTACT, driver) for driver in random_cpgs(arm(), 1)]
    behaviour = Simulator(arm(), 1).run(runs, 50, UPRIGHT.record).behaviour
    assert falls_of(arm(), INTACT, behaviour) == 50
