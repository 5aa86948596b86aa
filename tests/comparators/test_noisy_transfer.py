"""Promises of ``noisy-transfer``: noise counts as noise, and agreement as agreement."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from selfmodel.comparators import NOISY_TRANSFER
from selfmodel.comparators.noisy_transfer import WINDOW
from selfmodel.testing import check_comparator, shown
from selfmodel.trials.trajectory import Trajectory
from tests.helpers.comparators import distances_of
from tests.helpers.gaits import TROT, batch, changed, gait, logged

MEMBERS = 6


def ensembles(*groups: list[Trajectory]) -> Trajectory:
    """Ensembles of runs as a simulator gives them, ``(n, members, steps, width)``."""
    members = [batch(*group) for group in groups]
    signals = {
        signal: np.stack([group[signal] for group in members]) for signal in members[0].signals
    }
    return Trajectory(members[0].names, members[0].time, signals)


def turned(run: Trajectory, *by: float) -> list[Trajectory]:
    """The run by members whose joints are all turned, each by so many rad."""
    return [changed(run, joint_positions=run["joint_positions"] + angle) for angle in by]


def around(middle: float, spread: float) -> list[Trajectory]:
    """Members of the made-up walk, spread evenly around an error of their joints, rad."""
    return turned(gait(), *(middle + spread * np.linspace(-1, 1, MEMBERS)))


def distances(*groups: list[Trajectory]) -> np.ndarray:
    return distances_of(NOISY_TRANSFER.prepare(logged(gait())), ensembles(*groups))


@settings(max_examples=6)
@given(
    swing=st.floats(0.01, 2), late=st.floats(0, 1), steps=st.integers(1, 260), seed=st.integers(0)
)
def test_an_ensemble_that_all_did_what_the_trial_shows_is_at_exactly_zero(
    swing: float, late: float, steps: int, seed: int
):
    walking = gait(swing=swing, late=late, steps=steps)
    hidden = np.random.default_rng(seed % 2**32).random((steps, 4)) < 0.3
    joints = np.where(hidden, np.nan, walking["joint_positions"])
    trial = logged(changed(walking, joint_positions=joints))

    losses = NOISY_TRANSFER.prepare(trial).losses(ensembles([walking] * MEMBERS))
    assert np.array_equal(losses, np.zeros((1, -(-steps // WINDOW))))


@settings(max_examples=6)
@given(error=st.floats(0.5, 5), spread=st.floats(0.2, 1))
def test_members_that_disagree_forgive_more_than_members_that_agree(error: float, spread: float):
    agreed, disagreed = distances(around(error, 0), around(error, spread * error))

    assert disagreed < agreed


@settings(max_examples=6)
@given(spread=st.floats(0.01, 5))
def test_an_ensemble_that_would_fit_anything_pays_for_it(spread: float):
    narrow, wide = distances(around(0, spread), around(0, 2 * spread))

    assert 0 < narrow < wide


def test_a_piece_is_a_window_of_the_trial():
    walking = gait(steps=210)
    joints = walking["joint_positions"].copy()
    joints[60:65] += 1
    losses = NOISY_TRANSFER.prepare(logged(walking)).losses(
        ensembles([changed(walking, joint_positions=joints)] * MEMBERS)
    )

    assert losses.shape == (1, 9)
    assert np.flatnonzero(losses[0]).tolist() == [60 // WINDOW]


@pytest.mark.parametrize("steps", [1, 24, 26, 130])
def test_trials_of_any_length_keep_the_contract(steps: int):
    trial = logged(gait(steps=steps))
    perfect = shown(NOISY_TRANSFER.prepare(trial).request, trial)
    walks = [gait(late=0.05 * late, steps=steps) for late in range(MEMBERS)]
    trots = [gait(TROT, swing=0.1 * swing, steps=steps) for swing in range(MEMBERS)]
    others = ensembles(walks, trots)
    signals = {
        signal: np.concatenate([values, others[signal]])
        for signal, values in perfect.signals.items()
    }

    check_comparator(
        NOISY_TRANSFER, trial, Trajectory(trial.trajectory.names, perfect.time, signals)
    )


def test_a_window_of_which_nothing_was_observed_is_no_piece():
    walking = gait(steps=200)
    signals = {signal: values.copy() for signal, values in walking.signals.items()}
    for values in signals.values():
        values[30:110] = np.nan
    trial = logged(changed(walking, **signals))

    # Of steps 25 to 49 and 100 to 124 something was seen, of the two windows between nothing.
    assert NOISY_TRANSFER.prepare(trial).losses(ensembles([walking] * MEMBERS)).shape == (1, 6)
