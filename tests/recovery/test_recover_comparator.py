"""Promises of a recovery about its comparator: it is checked before the failure."""

import dataclasses
from collections.abc import Sequence

import pytest

from selfmodel.diagnosis.choice import ChosenComparator
from selfmodel.errors import InputError
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.recovery.recover import RecoveryLoop
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial
from tests.helpers.drivers import random_controllers
from tests.helpers.memory import MemoryJournal, in_memory

BUDGET = dataclasses.replace(Settings().scaled(6), generations=2, steps=60)


def test_a_comparator_that_refuses_the_healthy_trial_ends_the_recovery_before_the_failure(
    quadruped: Robot,
):
    events: list[object] = []

    def refuse(_robot: Robot, _trials: Sequence[Trial]) -> ChosenComparator:
        raise InputError("no position")

    with pytest.raises(InputError, match="no position"):
        RecoveryLoop(
            simulator=Simulator(quadruped, 1),
            choose_comparator=refuse,
            run_trial=in_memory(quadruped),
            journal=MemoryJournal(),
            settings=BUDGET,
            seed=1,
            on_event=events.append,
            calibrate=lambda _trials: pytest.fail("calibrated"),
            gait=random_controllers(quadruped, 1)[0],
        ).run(SimulatedRobot(quadruped), SimulatedRobot(quadruped))
    assert [event.plan.stage for event in events if isinstance(event, Trial)] == ["before"]
