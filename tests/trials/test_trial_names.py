"""Promises of the names of trials: those of the files, and one for each log of a diagnosis."""

import dataclasses

from selfmodel.trials.trial import Trial
from selfmodel.trials.trial_names import trial_names
from tests.helpers.gaits import gait, logged

RUN = logged(gait(steps=2))


def at(path: str) -> Trial:
    """A trial with the plan of every other, and a log of its own."""
    return dataclasses.replace(RUN, path=path)


def test_trials_of_one_plan_have_the_names_of_their_files():
    trials = [at("runs/monday.mcap"), at("tuesday.2.MCAP")]

    assert list(trial_names(trials).values()) == ["monday", "tuesday.2"]


def test_files_of_one_name_have_their_paths_and_other_files_their_names():
    trials = [at("a/walk.mcap"), at("b/walk.mcap"), at("b/run.mcap")]

    assert trial_names(trials) == {
        "a/walk.mcap": "a/walk.mcap",
        "b/walk.mcap": "b/walk.mcap",
        "b/run.mcap": "run",
    }


def test_a_trial_of_arrays_has_the_name_of_its_plan_as_far_as_it_is_alone():
    one, other = at("made-up (0a1b)"), at("made-up (2c3d)")

    assert trial_names([one]) == {one.path: "made-up"}
    assert set(trial_names([one, other]).values()) == {one.path, other.path}
