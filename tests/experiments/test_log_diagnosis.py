"""Promises of the set-up of a diagnosis: the comparator is chosen before anything is computed."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import selfmodel
from selfmodel.diagnosis.comparator_choice import ChosenComparator
from selfmodel.errors import InputError
from selfmodel.experiments import log_diagnosis
from selfmodel.settings import Settings
from selfmodel.trials.trial import Trial

TRIALS = Path(__file__).parents[1] / "data" / "logs-0.1" / "recovery" / "trials"
TINY = Settings(generations=1).scaled(4)


@pytest.fixture
def blind() -> Trial:
    """A failing trial without the base's position."""
    trial = selfmodel.read_log(TRIALS / "01-after.mcap").trial
    run = trial.behaviour
    lost = {"base_position": np.full_like(run["base_position"], np.nan)}
    behaviour = dataclasses.replace(run, signals={**run.signals, **lost})
    return dataclasses.replace(trial, behaviour=behaviour)


def test_a_comparator_that_cannot_judge_is_refused_before_the_calibration(
    blind: Trial, monkeypatch: pytest.MonkeyPatch
):
    fits: list[object] = []
    monkeypatch.setattr(log_diagnosis, "fitted", lambda *given: fits.append(given))
    healthy = selfmodel.read_log(TRIALS / "00-before.mcap").trial

    with pytest.raises(
        InputError, match=r"needs base_position.*: give the comparator segment-prediction-onboard"
    ):
        selfmodel.diagnose(
            blind, healthy=healthy, robot="quadruped", comparator="segment-prediction"
        )
    assert not fits


@pytest.mark.search
def test_the_default_is_the_best_comparator_that_the_trials_allow_and_is_reported(blind: Trial):
    events: list[object] = []
    selfmodel.diagnose(blind, robot="quadruped", kinds="jam", settings=TINY, on_event=events.append)

    (chosen,) = [event for event in events if isinstance(event, ChosenComparator)]
    assert chosen.comparator.name == "segment-prediction-onboard"
    assert "segment-prediction needs base_position" in chosen.reason
