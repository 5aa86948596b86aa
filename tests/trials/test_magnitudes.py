"""Numbers that no robot has are named; what was not observed is no number."""

import re

import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.physical.simulated_robot import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.trials.magnitudes import MAX_VALUE, check_magnitudes
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.drivers import random_controllers
from tests.helpers.hostile import with_value
from tests.helpers.memory import in_memory


@pytest.fixture(scope="module")
def trial(quadruped: Robot) -> Trial:
    (controller,) = random_controllers(quadruped, 1)
    plan = TrialPlan("trial", "single", controller, 10, 0)
    return in_memory(quadruped)(SimulatedRobot(quadruped), plan)


@pytest.mark.parametrize("value", [np.inf, -np.inf, 1e308, -1.001 * MAX_VALUE])
def test_the_first_absurd_number_is_named_with_its_column_and_step(trial: Trial, value: float):
    wrong = with_value(trial, "joint_velocities", 3, 2, value)
    name = trial.behaviour.names.hinges[2]
    with pytest.raises(
        InputError, match=re.escape(f"joint_velocities {name} is {value:g} at step 3, ")
    ):
        check_magnitudes(wrong, SIGNALS)
    check_magnitudes(wrong, ("base_position", "commands"))


@pytest.mark.parametrize("value", [np.nan, MAX_VALUE, -5e6])
def test_what_was_not_observed_and_coordinates_of_maps_are_no_absurd_numbers(
    trial: Trial, value: float
):
    check_magnitudes(with_value(trial, "base_position", 0, 1, value), SIGNALS)
