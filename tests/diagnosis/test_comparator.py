"""Promises of the choice of a comparator: it can judge all trials, or is refused with another."""

import dataclasses
from collections.abc import Sequence

import pytest

from selfmodel.comparators import COMPARATORS, PREFERENCE
from selfmodel.diagnosis.choice import chosen_comparator, prepared_trial
from selfmodel.diagnosis.comparator import PreparedTrial, TrialRefusedError
from selfmodel.errors import InputError
from selfmodel.robot.robot import Robot
from selfmodel.tasks import ROBOTS
from selfmodel.trials.signals import Signal
from selfmodel.trials.trial import Trial
from tests.helpers.drivers import random_controllers
from tests.helpers.hostile import lacking
from tests.helpers.memory import trial_of

SEGMENTS, ONBOARD, NOISY, SERIES = (comparator.name for comparator in PREFERENCE)
BASE: tuple[Signal, ...] = ("base_position", "base_linear_velocity")
VELOCITIES: tuple[Signal, ...] = ("joint_velocities",)
MOST: tuple[Signal, ...] = (
    *("sensors", "joint_positions", "joint_velocities"),
    *("base_orientation", "base_linear_velocity", "base_angular_velocity"),
)


@pytest.fixture(scope="module")
def robot() -> Robot:
    return ROBOTS["quadruped"].robot()


@pytest.fixture(scope="module")
def trial(robot: Robot) -> Trial:
    return trial_of(robot, "intact", *random_controllers(robot, 1), steps=100)


def without(trial: Trial, signals: Sequence[Signal], path: str = "a.mcap") -> Trial:
    return dataclasses.replace(lacking(trial, signals), path=path)


@pytest.mark.parametrize(
    ("lost", "expected"), [((), SEGMENTS), (BASE, ONBOARD), (VELOCITIES, NOISY), (MOST, SERIES)]
)
def test_the_best_comparator_is_the_first_that_the_trial_allows(
    lost: Sequence[Signal], expected: str, robot: Robot, trial: Trial
):
    chosen = chosen_comparator(PREFERENCE, robot, [without(trial, lost)])

    assert chosen.comparator.name == expected
    assert all(signal in chosen.reason for signal in lost if signal in {*BASE, *VELOCITIES})
    assert ("all signals" in chosen.reason) == (not lost)


def test_a_given_comparator_is_refused_with_each_log_s_signal_and_with_one_that_can_judge(
    robot: Robot, trial: Trial
):
    blind, slow = without(trial, BASE, "a.mcap"), without(trial, VELOCITIES, "b.mcap")
    segments = COMPARATORS[SEGMENTS]

    assert chosen_comparator(PREFERENCE, robot, [trial], given=segments).comparator is segments
    with pytest.raises(
        InputError,
        match=rf"a\.mcap: {SEGMENTS} needs base_position.*; b\.mcap: {SEGMENTS} needs "
        rf"joint_velocities.*: give the comparator {NOISY}, which can judge all",
    ):
        chosen_comparator(PREFERENCE, robot, [blind, trial, slow], given=segments)


def test_trials_that_no_comparator_can_judge_are_refused_one_by_one(robot: Robot, trial: Trial):
    dark = [without(trial, (*MOST, "base_position"), f"{k}.mcap") for k in range(2)]
    message = r"0\.mcap: .* needs at least one of sensors.*; 1\.mcap: .*: leave these trials out"

    with pytest.raises(InputError, match=message):
        chosen_comparator(PREFERENCE, robot, dark)
    with pytest.raises(InputError, match=r"0\.mcap: .*; 1\.mcap: .*: leave these trials out"):
        chosen_comparator(PREFERENCE, robot, dark, given=PREFERENCE[0])


@pytest.mark.parametrize("name", COMPARATORS)
@pytest.mark.parametrize("kept", [(), *((signal,) for signal in (*MOST, "base_position"))])
def test_the_preferred_comparators_can_judge_all_that_any_other_can(
    name: str, kept: Sequence[Signal], robot: Robot, trial: Trial
):
    lost = [signal for signal in (*MOST, "base_position") if signal not in kept]
    rest = without(trial, lost)

    try:
        prepared_trial(COMPARATORS[name], robot, rest)
    except TrialRefusedError:
        return
    chosen_comparator(PREFERENCE, robot, [rest])


def test_an_error_of_a_third_party_s_comparator_is_a_refusal(robot: Robot, trial: Trial):
    class Picky:
        name = "picky"

        def prepare(self, trial: Trial) -> PreparedTrial:
            raise InputError(f"{trial.path}: picky needs a smell")

    with pytest.raises(TrialRefusedError, match="picky needs a smell"):
        prepared_trial(Picky(), robot, trial)
    with pytest.raises(InputError, match=f"picky needs a smell: give the comparator {SEGMENTS}"):
        chosen_comparator(PREFERENCE, robot, [trial], given=Picky())
