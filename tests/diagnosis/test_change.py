"""Promises of a change: on synthetic losses along a timeline, and of jams in mid-trial."""

import dataclasses
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from selfmodel.comparators import (
    SEGMENT_PREDICTION,
    SEGMENT_PREDICTION_ONBOARD,
    segment_prediction,
)
from selfmodel.controllers.controller import Controller
from selfmodel.diagnosis.diagnose import (
    DiagnosticSearch,
    Split,
    best_split,
    change_at,
    is_better_than_always,
    is_change,
)
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.diagnosis.losses import LossFunction as Losses, LossTable, Timeline
from selfmodel.diagnosis.significance import MIN_PIECES, MIN_Z_OF_CHANGE
from selfmodel.faults.hypothesis import INTACT, Hypothesis, canonical
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation import requests
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import ROBOTS
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial
from tests.diagnosis.synthetic import Synthetic
from tests.helpers.drivers import random_controllers
from tests.helpers.memory import trial_of

ANATOMY = ROBOTS["quadruped"].robot().anatomy
JAM = parse("jam:front_left_knee", ANATOMY)
BREAK = parse("break:back_left_knee", ANATOMY)
PIECES = 60
PIECE = 0.12
"""Seconds of a piece."""


def of(rows: Mapping[Hypothesis, np.ndarray]) -> Losses:
    return lambda hypotheses: np.array([rows[one] for one in hypotheses])


def losses_of(change: int, *, pieces: int = PIECES, noise: float = 0.2, seed: int = 0) -> Losses:
    """Losses of a robot that is intact before a piece, and jammed from it on."""
    rng = np.random.default_rng(seed)
    common = rng.gamma(2, 0.1, pieces)
    jammed = np.arange(pieces) >= change
    rows = {INTACT: jammed * 1.0, JAM: ~jammed * 1.0, BREAK: np.full(pieces, 0.9)}
    return of({one: common + row + noise * rng.uniform(0, 1, pieces) for one, row in rows.items()})


def timeline_of(*pieces: int) -> Timeline:
    """Times of the pieces of trials with so many pieces each."""
    begin = np.concatenate([np.arange(count) * PIECE for count in pieces])
    return Timeline(np.repeat(np.arange(len(pieces)), pieces), begin, begin + PIECE)


def split_of(losses: Losses) -> Split | None:
    return best_split([INTACT], [JAM, BREAK], losses, losses)


@settings(max_examples=30)
@given(
    change=st.integers(MIN_PIECES, PIECES - MIN_PIECES),
    noise=st.floats(0, 0.5),
    seed=st.integers(0, 2**32 - 1),
)
def test_the_interval_contains_the_true_time_of_a_change(change: int, noise: float, seed: int):
    losses = losses_of(change, noise=noise, seed=seed)
    split = split_of(losses)
    assert split == Split(INTACT, JAM, change)

    found = change_at(split, losses, timeline_of(PIECES), ["only"])
    assert (found.trial, found.index, found.before, found.after) == ("only", 0, INTACT, JAM)
    assert found.time == pytest.approx(change * PIECE)
    assert found.earliest < found.time < found.latest
    assert found.latest - found.earliest <= 12 * PIECE


def test_the_interval_contains_the_true_time_where_the_found_one_is_wrong():
    covered, wrong = 0, 0
    for seed in range(60):
        losses = losses_of(27, noise=2.0, seed=seed)
        split = split_of(losses)
        assert split is not None
        found = change_at(split, losses, timeline_of(PIECES), ["only"])
        covered += found.earliest <= 27 * PIECE <= found.latest
        wrong += split.piece != 27

    assert wrong > 6
    assert covered >= 0.95 * 60


@settings(max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), pieces=st.integers(1, 80))
def test_there_is_no_change_in_noise(seed: int, pieces: int):
    rng = np.random.default_rng(seed)
    rows = {one: rng.gamma(2, 0.1, pieces) for one in (INTACT, JAM, BREAK)}
    losses = of(rows)
    best = min(rows, key=lambda one: rows[one].sum())
    split = split_of(losses)

    assert split is None or not is_change(split, best, losses)


@pytest.mark.parametrize("change", [20, 30, 40])
def test_a_change_is_significant_against_either_hypothesis_alone(change: int):
    losses = losses_of(change)
    split = split_of(losses)

    assert split == Split(INTACT, JAM, change)
    assert is_change(split, INTACT, losses)
    assert is_change(split, JAM, losses)
    assert not is_change(Split(JAM, INTACT, change), INTACT, losses), "in the wrong order"


def test_a_hypothesis_that_is_no_better_after_than_before_is_no_change():
    """The whole timeline is predicted better by another hypothesis than before and after."""
    losses = losses_of(30)
    rows = dict(zip([INTACT, JAM], losses([INTACT, JAM]), strict=True))
    rows[BREAK] = np.full(PIECES, 0.01)

    assert is_change(Split(INTACT, JAM, 30), INTACT, of(rows))
    assert not is_change(Split(INTACT, JAM, 30), BREAK, of(rows))


@pytest.mark.parametrize(("together", "expected"), [(0.1, False), (0.9, True)])
def test_a_change_of_a_long_trial_has_to_beat_the_faults_of_both_sides_together(
    together: float,
    expected: bool,  # noqa: FBT001  # what is expected
):
    early, ripple = np.arange(PIECES) < 30, np.linspace(0.0, 0.01, PIECES)
    both = canonical([*BREAK.faults, *JAM.faults], ANATOMY)
    rows = {JAM: np.where(early, 0.1, 1.0), BREAK: np.where(early, 1.0, 0.1)}
    losses = of({one: row + ripple for one, row in {**rows, both: together}.items()})
    problem = Synthetic(HypothesisSpace(ANATOMY, PAPER_KINDS), losses)

    assert is_better_than_always(Split(JAM, BREAK, 30), problem) == expected


@pytest.mark.parametrize(("z", "expected"), [(1.01, True), (0.99, False)])
def test_a_difference_after_the_time_has_to_be_clear(z: float, *, expected: bool):
    after, swing = np.arange(PIECES) >= 30, np.resize([1.0, -1.0], PIECES)
    gain = 0.1 * (MIN_Z_OF_CHANGE * z + swing * np.sqrt(29))
    rows = {
        INTACT: 2.0 + after * gain,
        JAM: 2.0 + ~after * (1.0 + 0.1 * swing),
        BREAK: 3.0 + 0.1 * swing,
    }

    assert is_change(Split(INTACT, JAM, 30), BREAK, of(rows)) == expected


@settings(max_examples=15)
@given(
    change=st.integers(MIN_PIECES, 47),
    first=st.integers(1, 49),
    noise=st.floats(0, 2),
    seed=st.integers(0, 1000),
)
def test_the_bounds_are_within_the_trial_of_the_change(
    change: int, first: int, noise: float, seed: int
):
    losses = losses_of(change, pieces=50, noise=noise, seed=seed)
    split = split_of(losses)
    assert split is not None
    counts = (first, 50 - first)
    found = change_at(split, losses, timeline_of(*counts), ["first", "second"])

    assert found.trial == ("first" if split.piece < first else "second")
    assert 0 <= found.earliest <= found.time <= found.latest
    assert found.latest <= counts[found.index] * PIECE + 1e-9


def test_a_timeline_with_too_few_pieces_has_no_change():
    assert split_of(losses_of(2, pieces=2 * MIN_PIECES - 1)) is None
    assert split_of(losses_of(MIN_PIECES, pieces=2 * MIN_PIECES)) is not None
    assert best_split([INTACT], [], losses_of(30), losses_of(30)) is None
    assert best_split([INTACT], [INTACT], losses_of(30), losses_of(30)) is None


def test_the_surrogate_selects_and_the_comparator_itself_decides():
    """A surrogate with fewer pieces that ranks another hypothesis first."""
    losses = losses_of(30)
    few = 2 * MIN_PIECES + 4
    coarse = of({INTACT: np.linspace(0, 1, few), JAM: np.full(few, 0.7), BREAK: np.full(few, 0.4)})
    assert best_split([INTACT], [JAM, BREAK], coarse, coarse).after == BREAK
    asked: set[Hypothesis] = set()

    def recorded(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        asked.update(hypotheses)
        return losses(hypotheses)

    assert best_split([INTACT], [JAM, BREAK], coarse, recorded) == Split(INTACT, JAM, 30)
    assert asked == {INTACT, JAM, BREAK}


def test_without_a_difference_before_the_time_there_is_no_change():
    after = np.arange(PIECES) >= 30
    swing = np.resize([0.1, -0.1], PIECES)
    rows = {INTACT: 0.2 + (1 + swing) * after, JAM: np.full(PIECES, 0.2), BREAK: 2.0 + swing}

    assert not is_change(Split(INTACT, JAM, 30), BREAK, of(rows))


def test_a_hypothesis_that_diverged_is_on_neither_side_of_a_change():
    rows = dict(zip([INTACT, JAM, BREAK], losses_of(30)([INTACT, JAM, BREAK]), strict=True))
    rows[JAM][3] = np.inf
    split = split_of(of(rows))
    assert split is not None
    assert split.after == BREAK

    rows[INTACT][40] = np.inf
    assert split_of(of(rows)) is None


STEPS = 400
SMALL = dataclasses.replace(Settings().scaled(12), generations=2)
STUCK = "jam:front_left_knee"


@pytest.fixture(scope="module")
def gait(quadruped: Robot) -> Controller:
    return random_controllers(quadruped, 1)[0]


trial = partial(trial_of, steps=STEPS)


def glued(first: Trial, second: Trial, step: int) -> Trial:
    """The rows of one trial before a step, and of another from it on."""
    signals = {
        name: np.concatenate([values[:step], second.trajectory[name][step:]])
        for name, values in first.trajectory.signals.items()
    }
    trajectory = Trajectory(first.trajectory.names, first.trajectory.time, signals)
    return dataclasses.replace(second, trajectory=trajectory, path=f"glued-{step}.mcap")


def diagnosed(robot: Robot, *trials: Trial, intact: tuple[Trial, ...] = ()) -> Diagnosis:
    search = DiagnosticSearch(
        Simulator(robot, 1), SEGMENT_PREDICTION, SMALL, PAPER_KINDS, healthy_trials=intact
    )
    return search(list(trials), [], np.random.default_rng(0), lambda _: None)


@pytest.mark.search
def test_a_jam_in_the_middle_of_a_trial_is_found_and_dated(quadruped: Robot, gait: Controller):
    step = 120
    healthy = trial(quadruped, "intact", gait)
    damaged = glued(healthy, trial(quadruped, STUCK, gait), step)
    found = diagnosed(quadruped, damaged, intact=(healthy,))
    onset = step * quadruped.control_timestep

    assert str(found.best) == STUCK
    assert found.change is not None
    assert (found.change.before, str(found.change.after)) == (INTACT, STUCK)
    assert (found.change.index, found.change.trial) == (0, f"glued-{step}")
    assert found.change.earliest <= onset <= found.change.latest
    assert abs(found.change.time - onset) <= 0.2


@pytest.mark.search
def test_a_jam_in_the_second_of_three_trials_is_dated_in_that_trial(
    quadruped: Robot, gait: Controller
):
    healthy, jammed = (trial(quadruped, truth, gait) for truth in ("intact", STUCK))
    first = trial(quadruped, "intact", gait, steps=200)
    found = diagnosed(quadruped, first, glued(healthy, jammed, 180), jammed)

    assert str(found.best) == STUCK
    assert found.change is not None
    assert (found.change.index, found.change.trial) == (1, "glued-180")
    assert abs(found.change.time - 1.8) <= 0.2
    assert found.trials == 3


@pytest.mark.search
def test_a_jam_of_a_robot_that_has_lost_a_limb_before_is_found_with_both_hypotheses(
    quadruped: Robot, gait: Controller
):
    lost = "break:back_right_knee"
    healthy = trial(quadruped, "intact", gait)
    before, after = (trial(quadruped, truth, gait) for truth in (lost, f"{lost}+{STUCK}"))
    found = diagnosed(quadruped, glued(before, after, 150), intact=(healthy,))

    assert str(found.best) == f"{lost}+{STUCK}"
    assert found.change is not None
    assert str(found.change.before) == lost
    assert abs(found.change.time - 1.5) <= 0.2


@pytest.mark.search
def test_a_clear_change_of_a_long_trial_is_found_without_an_ea_or_a_refinement_of_the_whole(
    quadruped: Robot, gait: Controller, monkeypatch: pytest.MonkeyPatch
):
    for module in (requests, segment_prediction):
        monkeypatch.setattr(module, "MAX_CHAIN", 1.5)
    healthy = trial(quadruped, "intact", gait)
    damaged = glued(healthy, trial(quadruped, STUCK, gait), 200)
    found, evaluations, simulators = [], [], [Simulator(quadruped, 1) for _ in range(2)]
    for simulator in simulators:
        search = DiagnosticSearch(
            *(simulator, SEGMENT_PREDICTION_ONBOARD, SMALL, PAPER_KINDS), healthy_trials=[healthy]
        )
        found.append(search([damaged], [], np.random.default_rng(0), lambda _: None))
        evaluations.append(search.evaluations)
        monkeypatch.setattr(LossTable, "has_sections", lambda *_: False)
    quick, thorough = found

    assert str(quick.best) == STUCK
    assert evaluations[0] == 0
    assert (quick.best, quick.verdict, quick.change) == (
        *(thorough.best, thorough.verdict, thorough.change),
    )
    assert simulators[0].stats.steps < simulators[1].stats.steps
