"""Promises of the surrogate of a diagnosis: a low-cost comparison pre-selects hypotheses."""

import dataclasses

import numpy as np
import pytest

from selfmodel.arrays import FloatArray
from selfmodel.comparators import COMPARATORS
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import Behaviour, collect
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.comparators import PreparedPieces
from tests.helpers.drivers import random_controllers
from tests.helpers.gaits import changed

SMALL = dataclasses.replace(Settings().scaled(4), generations=1)


@pytest.fixture
def trial(quadruped: Robot) -> Trial:
    plan = TrialPlan("00-after", "after", random_controllers(quadruped, 1)[0], 300, 0)
    samples = SimulatedRobot(quadruped).run(plan.controller, plan.steps)
    run = collect(quadruped.anatomy.names, samples)
    return Trial(plan, quadruped.name, run, "nowhere.mcap")


@pytest.mark.parametrize(
    "name",
    [
        "gait-pattern",
        pytest.param("sensor-series", marks=pytest.mark.search),
        pytest.param("noisy-transfer", marks=pytest.mark.search),
    ],
)
def test_a_comparator_of_whole_trials_has_their_openings_as_surrogate(
    name: str, quadruped: Robot, trial: Trial
):
    steps = {"evidence": set[int](), "surrogate": set[int]()}
    comparator = COMPARATORS[name]

    class Watched:
        name = comparator.name

        @staticmethod
        def prepare(trial: Trial) -> PreparedPieces:
            prepared = comparator.prepare(trial)

            def losses(simulated: Behaviour) -> FloatArray:
                assert simulated.steps == trial.behaviour.steps
                steps["evidence" if simulated.steps == 300 else "surrogate"].add(simulated.steps)
                return prepared.losses(simulated)

            return PreparedPieces(prepared.request, prepared.distances, losses)

    DiagnosticSearch(Simulator(quadruped, 1), Watched(), SMALL)(
        [trial], [], np.random.default_rng(0), lambda _: None
    )

    assert steps == {"evidence": {300}, "surrogate": {100}}


@pytest.mark.search
def test_where_the_opening_tells_nothing_the_whole_trial_is_the_surrogate(
    quadruped: Robot, trial: Trial
):
    run = trial.behaviour
    late = np.arange(run.steps) >= 150
    hidden = {
        signal: np.where(late[:, np.newaxis], values, np.nan)
        for signal, values in run.signals.items()
        if signal != "commands"
    }
    trial = dataclasses.replace(trial, behaviour=changed(run, **hidden))
    search = DiagnosticSearch(Simulator(quadruped, 1), COMPARATORS["sensor-series"], SMALL)

    search.check([trial])
    found = search([trial], [], np.random.default_rng(0), lambda _: None)

    assert np.isfinite(found.ranked[0].distance)
