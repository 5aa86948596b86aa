"""Promise: sensitivity is how much an error of the state grows, and nothing else."""

import dataclasses

import numpy as np
import pytest

from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.simulation import segments
from selfmodel.simulation.calibration import sensitivity
from selfmodel.simulation.model_factors import nominal, with_parameters
from selfmodel.tasks import ROBOTS
from selfmodel.trials.estimation import BASE
from selfmodel.trials.trial import Trial
from tests.helpers.drivers import moving_trial
from tests.helpers.hostile import lacking

search = pytest.mark.search

QUADRUPED = ROBOTS["quadruped"].robot()
HEAVY = with_parameters(QUADRUPED, dataclasses.replace(nominal(QUADRUPED), root_mass=1.25, delay=2))


def walk_of(steps: int) -> Trial:
    """A trial of a robot that its self-model predicts badly."""
    return moving_trial(HEAVY, SimulatedRobot(HEAVY), 0, steps)


@search
def test_sensitivity_is_of_errors_of_the_state_and_not_of_the_model(
    monkeypatch: pytest.MonkeyPatch,
):
    walk = walk_of(200)
    knee = parse("motor:front_left_knee=0.3", QUADRUPED.anatomy)
    known = sensitivity(QUADRUPED, walk, INTACT, 1)

    assert known > 0
    assert sensitivity(QUADRUPED, walk, INTACT, 2) == known
    assert sensitivity(QUADRUPED, walk, knee, 1) not in {0.0, known}
    monkeypatch.setattr(segments, "STATE_ERROR", 2 * segments.STATE_ERROR)
    assert sensitivity(QUADRUPED, walk, INTACT, 1) > 1.5 * known
    monkeypatch.setattr(segments, "STATE_ERROR", 0.0)
    assert sensitivity(QUADRUPED, walk, INTACT, 1) == pytest.approx(0.0, abs=1e-9)


@search
def test_sensitivity_is_of_the_steps_that_count():
    given = lacking(walk_of(400), BASE)
    now = given.trajectory
    is_late = np.arange(now.steps) % 20 == 7
    delayed = dataclasses.replace(given, trajectory=dataclasses.replace(now, late=is_late))
    blind = np.where(np.arange(len(now.names.hinges)) < 3, np.nan, now["joint_positions"])
    signals = {**now.signals, "joint_positions": blind}
    lost = dataclasses.replace(given, trajectory=dataclasses.replace(now, signals=signals))
    known, by_late, by_lost = (
        sensitivity(QUADRUPED, one, INTACT, 1) for one in (given, delayed, lost)
    )

    assert by_late == pytest.approx(known, rel=0.3)
    assert 0.3 * known < by_lost < 1.5 * known
