"""Promises of the results: readable in a few lines, serialisable as JSON, tables."""

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest

import selfmodel
from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.diagnosis.choice import ChosenComparator
from selfmodel.diagnosis.diagnosis import Candidate, Diagnosis
from selfmodel.faults.hypothesis import INTACT
from selfmodel.recovery.result import Recovery, TrialScore
from selfmodel.recovery.scores import DISPLACEMENT
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration import Calibration
from selfmodel.simulation.model_factors import nominal
from selfmodel.simulation.trial_replay import Replay
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trial import Trial

LOGS = Path(__file__).parents[1] / "data" / "logs-0.1" / "recovery" / "trials"


@pytest.fixture
def trial() -> Trial:
    return selfmodel.read_log(LOGS / "00-before.mcap").trial


@pytest.fixture
def different(trial: Trial) -> Replay:
    return selfmodel.replay(trial, "intact", "quadruped")


@pytest.fixture
def fit(quadruped: Robot) -> Calibration:
    parameters = dataclasses.replace(nominal(quadruped), friction=1.25, delay=2)
    return Calibration(quadruped, parameters, np.full(12, 0.15), 0.75, 0.5)


CHOSEN = ChosenComparator(FORWARD_DISPLACEMENT, "given")


def without_base(trial: Trial) -> Trial:
    trajectory = trial.trajectory
    unobserved = np.full_like(trajectory["base_position"], np.nan)
    signals = {**trajectory.signals, "base_position": unobserved}
    return dataclasses.replace(trial, trajectory=dataclasses.replace(trajectory, signals=signals))


def test_an_unobserved_displacement_is_none_everywhere(trial: Trial):
    diagnosis = Diagnosis((Candidate(INTACT, 0.0),), 1, 0.0, (), "explained", "by hand")
    blind = without_base(trial)
    fallen = TrialScore(blind, INTACT, DISPLACEMENT, math.nan, 7)
    scored = (*[dataclasses.replace(fallen, fall=None)] * 2, fallen)
    found = (diagnosis, 0, 0, 0, CHOSEN, *[(math.nan,) * 3] * 2, scored)
    recovery = Recovery((blind,) * 3, (INTACT,) * 3, *found)

    values = json.loads(json.dumps(recovery.to_dict(), allow_nan=False))

    assert math.isnan(recovery.before)
    assert values["displacement"] == {"before": None, "after": None, "recovered": None}
    assert recovery.to_pandas()["displacement"].isna().all()
    first, *ways = [row[2] for row in recovery.table]
    assert (first, ways) == ("displacement, m", ["nan", "nan", "nan, fell at step 7"])


def test_a_calibration_is_readable_serialisable_and_a_table(fit: Calibration):
    title, errors, *rows = repr(fit).splitlines()

    assert title == "<Calibration of quadruped: control delay 2"
    assert errors == "  error 0.75 before, 0.5 after"
    assert rows[2] == "   1.250 (log deviation 0.150)  friction, not determined by these trials"
    assert len(rows) == 12
    assert json.loads(json.dumps(fit.to_dict(), allow_nan=False)) == {
        "root_mass": 1.0,
        "limb_mass": 1.0,
        "friction": 1.25,
        "damping": 1.0,
        "motor_gains": [1.0] * 8,
        "delay": 2,
        "contact_stiffness": 1.0,
        "contact_damping": 1.0,
        "deviations": [0.15] * 12,
        "error_before": 0.75,
        "error": 0.5,
        "set": "factors",
        "determined": [False] * 12,
        "held_out_gain": 0.0,
        "suspicion": None,
    }
    assert fit.to_pandas().loc[2].to_dict() == {
        "name": "friction",
        "factor": 1.25,
        "deviation": 0.15,
        "determined": False,
    }


def test_a_replay_is_serialisable_and_a_table(trial: Trial, different: Replay):
    assert repr(different).startswith("<Replay of 60 steps: first divergence at step 0\n  rms ")
    values = json.loads(json.dumps(different.to_dict(), allow_nan=False))
    table = different.to_pandas()

    names = ["observed", "identical", "first_divergence_step", "diverged", "from_log", "rms"]
    assert list(values) == names
    assert values["rms"] == {signal: different.rms(signal) for signal in SIGNALS}
    assert table["step"].tolist() == list(range(60))
    assert table["commands"][7] == different.errors["commands"][7]
    blind = selfmodel.replay(without_base(trial), "intact", "quadruped")
    assert blind.to_dict()["rms"]["base_position"] is None
