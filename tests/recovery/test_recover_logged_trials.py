"""Promises of diagnosis from logged trials alone, and of what judges them."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from selfmodel.comparators import COMPARATORS, FORWARD_DISPLACEMENT, SEGMENT_PREDICTION
from selfmodel.controllers.playback import Playback
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.diagnosis.losses import LossTable
from selfmodel.errors import InputError
from selfmodel.faults.notation import parse
from selfmodel.logs import read_log
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.writer import write_trial
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.recovery.events import Event, SearchBegins
from selfmodel.recovery.recover import diagnose_trials
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.drivers import random_controllers
from tests.helpers.gaits import changed, gait, logged

SMALL = dataclasses.replace(Settings().scaled(20), generations=4, steps=200)


def trials(robot: Robot, folder: Path, truth: str, count: int) -> list[Trial]:
    """Logged trials of a robot with something wrong, each with another controller."""
    found = []
    for number, controller in enumerate(random_controllers(robot, count, seed=2)):
        plan = TrialPlan(f"trial-{number}", "single", controller, SMALL.steps, 0)
        samples = SimulatedRobot(robot, parse(truth, robot.anatomy)).run(controller, SMALL.steps)
        path = write_trial(folder / f"{number}.mcap", robot, plan, samples, TrialHeader(SMALL))
        found.append(read_log(path).trial)
    return found


def test_each_trial_is_added_in_turn_and_each_diagnosis_seeds_the_next(
    quadruped: Robot, tmp_path: Path
):
    three = trials(quadruped, tmp_path, "break:back_left_shoulder", 3)
    events: list[Event] = []
    search = DiagnosticSearch(Simulator(quadruped, 2), FORWARD_DISPLACEMENT, SMALL)
    last = diagnose_trials(three, search, 4, events.append)
    begins = [event for event in events if isinstance(event, SearchBegins)]
    made = [event for event in events if isinstance(event, Diagnosis)]

    assert [event.kind for event in begins] == ["diagnostic"] * 3
    assert [diagnosis.trials for diagnosis in made] == [1, 2, 3]
    assert made[-1] == last
    fewer = diagnose_trials(
        three[:2],
        DiagnosticSearch(Simulator(quadruped, 1), FORWARD_DISPLACEMENT, SMALL),
        4,
        lambda _: None,
    )
    assert fewer == made[1]


def test_there_must_be_a_trial_to_explain(quadruped: Robot):
    search = DiagnosticSearch(Simulator(quadruped, 1), FORWARD_DISPLACEMENT, SMALL)
    with pytest.raises(InputError, match="at least one trial to explain, got none"):
        diagnose_trials([], search, 0, lambda _: None)


def test_trials_that_cannot_be_judged_are_named_before_any_search(quadruped: Robot, tmp_path: Path):
    three = trials(quadruped, tmp_path, "intact", 3)
    blind = [three[0], *(unobserved(trial) for trial in three[1:])]
    search = DiagnosticSearch(Simulator(quadruped, 1), FORWARD_DISPLACEMENT, SMALL)
    with pytest.raises(InputError, match=r"1\.mcap: .* needs .*; .*2\.mcap: .* needs "):
        diagnose_trials(blind, search, 0, lambda _: pytest.fail("a search began"))


def unobserved(trial: Trial) -> Trial:
    """A trial of which nothing was observed."""
    behaviour = trial.behaviour
    nothing = {signal: np.full_like(rows, np.nan) for signal, rows in behaviour.signals.items()}
    return dataclasses.replace(trial, behaviour=Behaviour(behaviour.names, behaviour.time, nothing))


def test_a_trial_that_other_software_drove_is_explained_by_its_commands(
    quadruped: Robot, tmp_path: Path
):
    (trial,) = trials(quadruped, tmp_path, "break:back_left_shoulder", 1)
    commands = trial.behaviour["commands"]
    plan = dataclasses.replace(trial.plan, controller=Playback(quadruped.anatomy.motors, commands))
    played = dataclasses.replace(trial, plan=plan)
    search = DiagnosticSearch(Simulator(quadruped, 2), FORWARD_DISPLACEMENT, SMALL)
    hypotheses = [parse(text, quadruped.anatomy) for text in ("break:back_left_shoulder", "intact")]
    distances = search.losses.distances(hypotheses, [played])

    assert distances[0] == 0 < distances[1]


@pytest.mark.parametrize("name", COMPARATORS)
def test_a_comparator_says_what_a_trial_lacks(name: str, quadruped: Robot, tmp_path: Path):
    (trial,) = trials(quadruped, tmp_path, "intact", 1)
    with pytest.raises(InputError, match=r"0\.mcap: .* needs \w+"):
        COMPARATORS[name].prepare(unobserved(trial))


def test_a_surrogate_that_cannot_judge_a_trial_is_replaced_by_the_comparator(quadruped: Robot):
    run = gait()
    # Seen at four of the moments that are looked at closely, none of which the screen looks at.
    seen = np.zeros(run.steps, dtype=bool)
    starts = np.linspace(0, run.steps - 1 - SEGMENT_PREDICTION.horizon, 80).round().astype(int)
    seen[starts[[1, 2, 4, 5]]] = True
    angles = np.where(seen[:, np.newaxis], run["joint_positions"], np.nan)
    trial = logged(changed(run, joint_positions=angles))
    simulator = Simulator(quadruped, 1)
    evidence = LossTable(simulator, SEGMENT_PREDICTION)

    with pytest.raises(InputError, match="needs joint_positions at 4 or more of 26 moments"):
        evidence.cheaper[0].check([trial])
    assert evidence.surrogate([trial])[0] is evidence
    DiagnosticSearch(simulator, SEGMENT_PREDICTION, SMALL).check([trial])
