"""Promise: the physics step of a self-model is as fine as its trials need."""

import dataclasses

import numpy as np
import pytest

from selfmodel.physical.simulated import SimulatedRobot, draw_gap
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration import EXACT_ERROR, calibrate
from selfmodel.simulation.model_factors import nominal, with_parameters
from selfmodel.tasks import ROBOTS
from selfmodel.trials.trial import Trial
from tests.helpers.drivers import moving_trial

search = pytest.mark.search

QUADRUPED = ROBOTS["quadruped"].robot()


def exact(parts: int, steps: int) -> Trial:
    """A trial of the model with so many physics steps in place of one, without noise."""
    return moving_trial(QUADRUPED, SimulatedRobot(QUADRUPED.finer(parts)), 0, steps)


def noisy(physical: Robot, seed: int, steps: int) -> Trial:
    """A trial of a real robot with the noise and the delay of a gap, and no other difference."""
    gap = draw_gap(QUADRUPED, 0.05, np.random.default_rng(seed))
    return moving_trial(QUADRUPED, SimulatedRobot(physical, gap=gap), seed, steps)


@search
@pytest.mark.parametrize("parts", [1, 4])
def test_the_physics_step_is_halved_for_a_robot_that_moves_as_with_a_finer_one(parts: int):
    physical = with_parameters(QUADRUPED, dataclasses.replace(nominal(QUADRUPED), finer=parts))
    healthy = noisy(physical, 1, 400)
    found = calibrate(QUADRUPED, [healthy], threads=2)
    halved = parts > 1

    assert found.parameters.finer == 1 + halved
    assert found.robot.model.opt.timestep * found.parameters.finer == QUADRUPED.model.opt.timestep
    assert found.robot.control_timestep == QUADRUPED.control_timestep
    assert any("physics step: 2.5 ms, 5 ms before" in line for line in found.changes) == halved
    rebuilt = with_parameters(QUADRUPED, found.parameters)
    assert rebuilt.mjcf == found.robot.mjcf


@search
def test_contacts_that_make_up_for_a_coarse_step_do_not_hide_it():
    found = calibrate(QUADRUPED, [exact(2, 400)], threads=2)

    assert found.parameters.finer == 2
    assert not found.parameters.has_other_contacts
    assert found.error < EXACT_ERROR


@search
def test_a_refit_has_the_physics_step_that_is_asked_for():
    walk, step = exact(2, 100), QUADRUPED.model.opt.timestep
    of_steps = [calibrate(QUADRUPED, [walk], 1, physics_step=one) for one in (step, step / 2)]

    assert [one.robot.model.opt.timestep for one in of_steps] == [step, step / 2]
    assert of_steps[1].error < EXACT_ERROR < of_steps[0].error
