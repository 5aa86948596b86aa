from pathlib import Path

import pytest

from selfmodel.comparators import DEFAULT
from selfmodel.experiments import expected_time
from selfmodel.experiments.arguments import comparator_choice
from selfmodel.experiments.expected_time import (
    TIME_PER_STEP,
    calibration_seconds,
    diagnosis_seconds,
    replay_seconds,
)
from selfmodel.experiments.log_diagnosis import LogDiagnosis, set_up_diagnosis
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.logs import read_log
from selfmodel.robot.mjcf.rehearsal import ModelCost
from selfmodel.robot.robot import Robot
from selfmodel.sandbox.budget import DEFAULT_BUDGET
from selfmodel.settings import Settings

TRIALS = Path(__file__).parents[1] / "data" / "logs-0.1" / "recovery" / "trials"


def planned(robot: Robot, population: int, threads: int = 1) -> LogDiagnosis:
    before, after = (read_log(TRIALS / name).trial for name in ("00-before.mcap", "01-after.mcap"))
    return set_up_diagnosis(
        [after],
        [before],
        robot=robot,
        choose_comparator=comparator_choice(DEFAULT),
        kinds=PAPER_KINDS,
        settings=Settings(generations=5).scaled(population),
        seed=0,
        calibrate=False,
        threads=threads,
    )


@pytest.fixture
def slow_model(monkeypatch: pytest.MonkeyPatch) -> None:
    """A model that takes 1 s for a physics step, and 10 s to compile."""
    cost = ModelCost(1, 1, compile_seconds=10.0, step_seconds=1.0, failure="")
    monkeypatch.setattr(expected_time, "rehearse", lambda *_: cost)


@pytest.mark.usefixtures("slow_model")
def test_the_time_of_a_replay_is_that_of_its_physics_steps_and_its_model(quadruped: Robot):
    trial = read_log(TRIALS / "01-after.mcap").trial

    seconds = replay_seconds(quadruped, trial, DEFAULT_BUDGET)

    assert seconds == TIME_PER_STEP * trial.behaviour.steps * quadruped.substeps + 10


@pytest.mark.usefixtures("slow_model")
def test_more_threads_and_smaller_populations_take_less_time(quadruped: Robot):
    def seconds(population: int, threads: int, *, calibrate: bool = False) -> float:
        return diagnosis_seconds(
            quadruped,
            planned(quadruped, population),
            calibrate=calibrate,
            threads=threads,
            budget=DEFAULT_BUDGET,
        )

    models = 10 * (1 + len(quadruped.anatomy.joints))
    assert seconds(40, 1) > seconds(10, 1) > models
    assert seconds(40, 2) - models == pytest.approx((seconds(40, 1) - models) / 2)
    assert seconds(10, 1, calibrate=True) > seconds(10, 1)


@pytest.mark.usefixtures("slow_model")
def test_a_calibration_takes_the_steps_of_its_predictions(quadruped: Robot):
    trial = read_log(TRIALS / "00-before.mcap").trial

    one = calibration_seconds(quadruped, [trial], threads=1, budget=DEFAULT_BUDGET)
    two = calibration_seconds(quadruped, [trial, trial], threads=1, budget=DEFAULT_BUDGET)

    assert two - 10 == pytest.approx(2 * (one - 10))
